"""Scenes of AI2-THOR 5.0: iTHOR's rooms by name and ProcTHOR's houses by JSON file.

- **States** are the reachable positions on a 0.5 m grid, requested once after a reset, with four headings each.
- **Views and moves** each start with a teleport to their pose. The recorder checks the pose that the simulator reports,
  and leaves out poses that it refused or changed.
- **Objects** are those that the simulator reports as visible, with the share of the view that they cover.

The simulator downloads its Unity build (about 1 GB) on the first start. Without a display it needs Vulkan, and if
CUDA_VISIBLE_DEVICES is set, also the program `vulkaninfo`.
"""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.recording.settings import ThorSettings
from relm_irl_jax.scenes.recording.simulator import Pose, SceneOpener, SimulatorScene, View
from relm_irl_jax.scenes.scene import GRID_STEP, HEADINGS

VISIBILITY_DISTANCE = 100.0
"""Distance in metres up to which objects count as visible; with the default of 1.5 m, most targets would be missing."""

FIELD_OF_VIEW = 90
"""Field of view in degrees, as in the built-in rooms."""

_ROOM_TYPES = {0: "kitchen", 2: "living_room", 3: "bedroom", 4: "bathroom"}
"""Room types of iTHOR's scenes, by the hundreds of their numbers."""


def thor_scenes(names: Sequence[str], settings: ThorSettings) -> dict[str, SceneOpener]:
    """Prepare the recording of several scenes; nothing is started if one of them cannot be read.

    Args:
        names: iTHOR's names, for example `FloorPlan401`, or JSON files of ProcTHOR houses.
        settings: size and rendering of the views.

    Returns:
        For each scene a function that starts the simulator in it.

    Raises:
        InputError: AI2-THOR is not installed, or a file cannot be read as a house.
    """
    _controller_class()
    openers: dict[str, SceneOpener] = {}
    for name in names:
        is_file = name.endswith(".json")
        stem = Path(name).stem if is_file else name
        if stem in openers:
            raise InputError(f"scenes: {stem} is given twice; give each scene once.")
        plan = read_house(Path(name)) if is_file else name
        openers[stem] = partial(thor_scene, stem, plan, settings)
    return openers


def read_house(path: Path) -> dict[str, Any]:
    """Read a ProcTHOR house.

    Args:
        path: JSON file of one house.

    Returns:
        The house, in AI2-THOR's format.

    Raises:
        InputError: the file is not a house.
    """
    try:
        house = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as JSON ({error}); give a ProcTHOR house.") from error
    if not isinstance(house, dict) or not isinstance(house.get("rooms"), list):
        raise InputError(f"{path}: is not a ProcTHOR house, since it has no list of `rooms`; give another file.")
    metadata = house.get("metadata")
    if not isinstance(metadata, dict) or not isinstance(metadata.get("agent"), dict):
        raise InputError(f"{path}: the agent's start pose is missing; add `metadata.agent`.")
    return house


def room_type_of_floor_plan(name: str) -> str:
    """Room type of an iTHOR scene.

    Args:
        name: for example `FloorPlan401`.

    Returns:
        The room type by its number; `house` for other scenes.
    """
    number = re.fullmatch(r"FloorPlan(\d+)(_physics)?", name)
    return _ROOM_TYPES.get(int(number[1]) // 100, "house") if number else "house"


@contextmanager
def thor_scene(
    name: str,
    plan: str | dict[str, Any],
    settings: ThorSettings,
    make_controller: Callable[..., Any] | None = None,
) -> Iterator[SimulatorScene]:
    """Start the simulator in a scene.

    Args:
        name: name of the scene.
        plan: iTHOR's name, or a ProcTHOR house.
        settings: size and rendering of the views.
        make_controller: makes the controller; by default AI2-THOR's class.

    Yields:
        The scene; the simulator runs until the context ends.

    Raises:
        InputError: AI2-THOR is not installed or cannot start, or the scene has no reachable position.
    """
    controller = _start(plan, settings, make_controller)
    try:
        if isinstance(plan, dict):
            # In a house the agent starts at the origin, which may be inside a wall.
            _step(controller, "TeleportFull", **plan["metadata"]["agent"])
        positions = _reachable_positions(controller, name)
        agent = _Agent(controller, positions)
        poses = [Pose(x, z, heading) for x, z in sorted(positions) for heading in HEADINGS]
        source = f"ai2thor/5.0 {name} {settings.image_size} pixels {FIELD_OF_VIEW} degrees"
        yield SimulatorScene(name, room_type_of_floor_plan(name), source, poses, agent.move, agent.view)
    finally:
        controller.stop()


class _Agent:
    """The agent of a running simulator."""

    def __init__(self, controller: Any, positions: dict[tuple[float, float], dict[str, float]]):
        self._controller = controller
        self._positions = positions

    def move(self, pose: Pose, action: str) -> Pose | None:
        """The pose after an action, None if the simulator refuses it."""
        if not self._teleport(pose):
            return None
        event = _step(self._controller, action)
        return _pose(event) if event.metadata["lastActionSuccess"] else None

    def view(self, pose: Pose) -> View | None:
        """The view at a pose, None if the simulator refuses the teleport."""
        event = self._teleport(pose)
        return View(_pose(event), np.array(event.frame[:, :, :3]), _visible_objects(event)) if event else None

    def _teleport(self, pose: Pose) -> Any:
        """The event of a teleport, None if the simulator refuses it."""
        event = _step(
            self._controller,
            "Teleport",
            position=self._positions[pose.x, pose.z],
            rotation={"x": 0, "y": pose.rotation, "z": 0},
            horizon=0,
            standing=True,
        )
        return event if event.metadata["lastActionSuccess"] else None


def _reachable_positions(controller: Any, name: str) -> dict[tuple[float, float], dict[str, float]]:
    """Reachable positions by (x, z) in metres, without rounding errors."""
    event = _step(controller, "GetReachablePositions")
    positions = event.metadata["actionReturn"] if event.metadata["lastActionSuccess"] else None
    if not positions:
        raise InputError(f"{name}: AI2-THOR finds no reachable position; leave the scene out.")
    first = positions[0]
    on_grid = {}
    for position in positions:
        x, z = (
            round(first[axis] + GRID_STEP * round((position[axis] - first[axis]) / GRID_STEP), 3) for axis in ("x", "z")
        )
        on_grid.setdefault((x, z), dict(position))
    return on_grid


def _pose(event: Any) -> Pose:
    agent = event.metadata["agent"]
    return Pose(agent["position"]["x"], agent["position"]["z"], agent["rotation"]["y"])


def _visible_objects(event: Any) -> dict[str, float]:
    """Share of the image that each visible object type covers."""
    types = {item["objectId"]: item["objectType"] for item in event.metadata["objects"] if item["visible"]}
    segmentation = event.instance_segmentation_frame
    if segmentation is None:
        return {}
    colours, counts = np.unique(segmentation.reshape(-1, segmentation.shape[-1]), axis=0, return_counts=True)
    shares: dict[str, float] = {}
    for colour, count in zip(colours.tolist(), counts.tolist(), strict=True):
        category = types.get(event.color_to_object_id.get(tuple(colour), ""))
        if category:
            shares[category] = shares.get(category, 0.0) + count / (segmentation.shape[0] * segmentation.shape[1])
    return shares


def _step(controller: Any, action: str, **arguments: Any) -> Any:
    """Take one action of the controller; raises InputError if the simulator has stopped."""
    try:
        return controller.step(action, **arguments)
    except (RuntimeError, TimeoutError) as error:
        cause = str(error).strip().splitlines()
        raise InputError(
            f"AI2-THOR stopped at {action} ({cause[0] if cause else type(error).__name__}); "
            "repeat the command to continue the recording."
        ) from error


def _controller_class() -> Callable[..., Any]:
    try:
        return import_module("ai2thor.controller").Controller
    except ImportError as error:
        raise InputError("AI2-THOR is not installed; run: pip install 'relm-irl-jax[thor]'.") from error


def _start(plan: str | dict[str, Any], settings: ThorSettings, make_controller: Callable[..., Any] | None) -> Any:
    make_controller = make_controller or _controller_class()
    platform = {}
    if settings.cloud_rendering:
        platform = {"platform": import_module("ai2thor.platform").CloudRendering}
    try:
        return make_controller(
            scene=plan,
            agentMode="default",
            gridSize=GRID_STEP,
            snapToGrid=True,
            rotateStepDegrees=90,
            visibilityDistance=VISIBILITY_DISTANCE,
            renderInstanceSegmentation=True,
            width=settings.image_size,
            height=settings.image_size,
            fieldOfView=FIELD_OF_VIEW,
            **platform,
        )
    except Exception as error:  # download, display, Vulkan and Unity raise many kinds of exceptions
        cause = str(error).strip().splitlines()
        raise InputError(
            f"AI2-THOR does not start ({cause[0] if cause else type(error).__name__}); it needs its Unity build, which "
            "it downloads once, and a display, or --cloud-rendering with Vulkan."
        ) from error
