"""Recording of AI2-THOR against a stand-in for its controller that answers, and fails, as the simulator does."""

import inspect
import json
import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from relm_irl_jax.cli import main
from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.consistency import check_scene
from relm_irl_jax.scenes.recording.record import record_scene
from relm_irl_jax.scenes.recording.settings import ThorSettings
from relm_irl_jax.scenes.recording.thor import read_house, room_type_of_floor_plan, thor_scene

SETTINGS = ThorSettings(image_size=8)
PLAN = ["...", ".#.", "..."]  # places 0.5 m apart, the first at (-1.25, 2.75)
HOUSE = {"rooms": [], "metadata": {"agent": {"position": {"x": 0, "y": 0.9, "z": 0}, "rotation": {"y": 90}}}}


class Controller:
    """A room of text that answers like `ai2thor.controller.Controller` 5.0, with rounding noise in every number.

    Arguments:
        refused: places (x, z) to which it does not teleport.
        drifting: places that it leaves a little after a teleport.
        dies_after: number of actions after which it fails; None for never.
        given: what it is started with.
    """

    def __init__(self, *, refused=(), drifting=(), dies_after=None, **given):
        self.refused, self.drifting, self.dies_after, self.given = refused, drifting, dies_after, given
        self.free = {
            (0.5 * x - 1.25, 0.5 * z + 2.75) for z, row in enumerate(PLAN) for x, c in enumerate(row) if c == "."
        }
        self.noise = np.random.default_rng(0)
        self.actions = []
        self.stopped = False
        self.x, self.z, self.rotation = -1.25, 2.75, 0.0

    def step(self, action, **arguments):
        if self.dies_after is not None and len(self.actions) >= self.dies_after:
            raise TimeoutError("Reading from AI2-THOR backend timed out")
        self.actions.append(action)
        value, success = None, True
        if action == "GetReachablePositions":
            value = [{"x": self._noisy(x), "y": 0.9, "z": self._noisy(z)} for x, z in sorted(self.free, reverse=True)]
        elif action in ("Teleport", "TeleportFull"):
            success = self._teleport(**arguments)
        elif action in ("RotateRight", "RotateLeft"):
            self.rotation = (self.rotation + (90 if action == "RotateRight" else -90)) % 360
        else:
            success = self._walk(1 if action == "MoveAhead" else -1)
        return self._event(value, success)

    def stop(self):
        self.stopped = True

    def _teleport(self, position, rotation, horizon=0, standing=True):
        place = (round(position["x"], 2), round(position["z"], 2))
        if place in self.refused:
            return False
        drift = 0.12 if place in self.drifting else 0.0
        self.x, self.z, self.rotation = place[0] + drift, place[1], rotation["y"]
        return True

    def _walk(self, sign):
        angle = math.radians(self.rotation)
        onward = (self.x + sign * 0.5 * round(math.sin(angle)), self.z + sign * 0.5 * round(math.cos(angle)))
        if (round(onward[0], 2), round(onward[1], 2)) not in self.free:
            return False
        self.x, self.z = onward
        return True

    def _noisy(self, value):
        return value + self.noise.uniform(-2e-6, 2e-6)

    def _event(self, value, success):
        """A view whose left half is a sink and whose right half is a chair that is hidden unless the agent faces +z."""
        segmentation = np.zeros((8, 8, 3), np.uint8)
        segmentation[:, :4], segmentation[:, 4:] = (1, 2, 3), (4, 5, 6)
        agent = {
            "position": {"x": self._noisy(self.x), "y": 0.9, "z": self._noisy(self.z)},
            "rotation": {"x": 0.0, "y": self._noisy(self.rotation), "z": 0.0},
        }
        objects = [
            {"objectId": "Sink|1", "objectType": "Sink", "visible": True},
            {"objectId": "Chair|1", "objectType": "Chair", "visible": self.rotation == 0},
        ]
        return SimpleNamespace(
            metadata={"lastActionSuccess": success, "actionReturn": value, "agent": agent, "objects": objects},
            frame=np.full((8, 8, 4), 7, np.uint8),  # cloud rendering has a fourth channel
            instance_segmentation_frame=segmentation,
            color_to_object_id={(1, 2, 3): "Sink|1", (4, 5, 6): "Chair|1", (9, 9, 9): "Chair"},
        )


def recorded(path, name="FloorPlan401", place="FloorPlan401", **misbehaviour):
    """Record with a stand-in; the recording and the stand-in."""
    controllers = []

    def make(**given):
        controllers.append(Controller(**given, **misbehaviour))
        return controllers[-1]

    with thor_scene(name, place, SETTINGS, make) as scene:
        recording = record_scene(scene, path)
    return recording, controllers[0]


def test_a_room_becomes_a_valid_scene(tmp_path):
    recording, controller = recorded(tmp_path / "room.h5")
    scene = recording.scene
    assert check_scene(scene) == ((), ())
    assert (scene.n_states, scene.room_type, scene.views.shape) == (32, "bathroom", (32, 8, 8, 3))
    assert (recording.refused, recording.closed, recording.disconnected) == (0, 0, 0)
    assert tuple(scene.location[0]) == (-1.25, 2.75)
    assert scene.categories == ("Chair", "Sink")
    assert scene.visible_object is not None
    np.testing.assert_array_equal(scene.visible_object[:, 0], np.where(scene.rotation == 0, 0.5, 0))
    np.testing.assert_array_equal(scene.visible_object[:, 1], 0.5)
    assert controller.stopped
    given = controller.given
    assert (given["gridSize"], given["snapToGrid"], given["rotateStepDegrees"]) == (0.5, True, 90)
    assert given["visibilityDistance"] > 10


def test_every_action_starts_with_a_teleport(tmp_path):
    _, controller = recorded(tmp_path / "room.h5")
    assert controller.actions[0] == "GetReachablePositions"
    assert controller.actions.count("GetReachablePositions") == 1
    pairs = list(zip(controller.actions, controller.actions[1:], strict=False))
    assert all(before == "Teleport" for before, action in pairs if action.startswith(("Move", "Rotate")))


def test_refused_teleports_and_drifted_poses_are_left_out(tmp_path):
    recording, _ = recorded(tmp_path / "room.h5", refused=[(-1.25, 2.75)], drifting=[(-0.75, 2.75)])
    assert (recording.refused, recording.scene.n_states) == (8, 24)
    assert check_scene(recording.scene)[0] == ()


def test_a_simulator_that_dies_midway_is_one_sentence_and_the_recording_continues(tmp_path):
    path = tmp_path / "room.h5"
    with pytest.raises(InputError, match=r"stopped at \w+ \(Reading from .* timed out\); repeat the command"):
        recorded(path, dies_after=100)
    recording, controller = recorded(path)
    whole, undisturbed = recorded(tmp_path / "whole.h5")
    assert len(controller.actions) <= len(undisturbed.actions) - 90
    np.testing.assert_array_equal(recording.scene.graph, whole.scene.graph)
    np.testing.assert_array_equal(recording.scene.views, whole.scene.views)


def test_a_house_starts_at_its_agent(tmp_path):
    path = tmp_path / "house-7.json"
    path.write_text(json.dumps(HOUSE))
    recording, controller = recorded(tmp_path / "house.h5", "house-7", read_house(path))
    assert controller.actions[:2] == ["TeleportFull", "GetReachablePositions"]
    assert controller.given["scene"] == HOUSE
    assert recording.scene.room_type == "house"


@pytest.mark.parametrize(
    ("content", "fault"),
    [("{", "as JSON"), ("[]", "not a ProcTHOR house"), ('{"rooms": []}', "start pose is missing")],
)
def test_files_that_are_no_houses(tmp_path, content, fault):
    path = tmp_path / "house.json"
    path.write_text(content)
    with pytest.raises(InputError, match=f"house.json.*{fault}"):
        read_house(path)


def test_without_the_simulator_the_command_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "ai2thor.controller", None)
    monkeypatch.setattr(sys, "argv", ["relm-irl", "scenes", "export", "thor", "--scenes", "FloorPlan401", "--out", "x"])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 2
    assert capsys.readouterr().err == ("relm-irl: AI2-THOR is not installed; run: pip install 'relm-irl-jax[thor]'.\n")


def test_a_simulator_that_does_not_start():
    def no_build(**given):
        raise ConnectionError("cannot reach the build\nmore")

    with (
        pytest.raises(InputError, match=r"does not start \(cannot reach the build\)"),
        thor_scene("FloorPlan1", "FloorPlan1", SETTINGS, no_build),
    ):
        pass


def test_a_scene_without_reachable_positions():
    class Empty(Controller):
        def step(self, action, **arguments):
            self.free = set()
            return super().step(action, **arguments)

    with pytest.raises(InputError, match="no reachable position"), thor_scene("FloorPlan1", "x", SETTINGS, Empty):
        pass


@pytest.mark.parametrize(
    ("name", "room_type"),
    [
        ("FloorPlan1", "kitchen"),
        ("FloorPlan230", "living_room"),
        ("FloorPlan301_physics", "bedroom"),
        ("FloorPlan430", "bathroom"),
        ("FloorPlan_Train1_1", "house"),
    ],
)
def test_room_types_of_floor_plans(name, room_type):
    assert room_type_of_floor_plan(name) == room_type


def test_the_calls_fit_the_real_package():
    """Every argument that the controller is started with is one of its own, or one of the simulator's."""
    ai2thor = pytest.importorskip("ai2thor.controller", reason="ai2thor is not installed")
    own = set(inspect.signature(ai2thor.Controller.__init__).parameters)
    assert {"scene", "width", "height", "platform", "unity_initialization_parameters"} <= own
    assert list(inspect.signature(ai2thor.Controller.step).parameters)[:2] == ["self", "action"]
