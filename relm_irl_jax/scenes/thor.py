"""Scenes from AI2-THOR (5.0), live: iTHOR's rooms by name and ProcTHOR's houses by JSON file.

- **States** are the reachable positions on a 0.5 m grid, asked for once after a reset, with four headings each.
- **Views and moves** each begin with a teleport to their pose, and the recorder compares the pose that the simulator
  reports: what it refused or moved is left out.
- **Objects** are those that the simulator calls visible, with the share of the view that their segmentation covers.

The simulator downloads its Unity build (about 1 GB) when it is first started. Without a display it needs Vulkan; where
CUDA_VISIBLE_DEVICES is set it then also asks for `vulkaninfo`.
"""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.dump import NAME_PATTERN
from relm_irl_jax.scenes.scene import GRID_STEP, HEADINGS
from relm_irl_jax.scenes.source import Pose, Source, View

VISIBILITY_METRES = 100.0
"""Distance up to which the simulator calls objects visible; its own 1.5 m would leave most targets out."""

_ROOM_TYPES = {0: "kitchen", 2: "living_room", 3: "bedroom", 4: "bathroom"}
"""Room types of iTHOR's scenes, by the hundreds of their numbers."""


@dataclass(frozen=True)
class ThorSettings:
    """What is recorded of a scene."""

    image_size: int = Field(default=224, ge=8)
    """Rows and columns of a view."""
    field_of_view: float = Field(default=90, gt=0, lt=180)
    """Angle in degrees that a view covers."""
    room_type: str = Field(default="", pattern=f"^({NAME_PATTERN})?$")
    """Room type of the scenes; by default iTHOR's own by number, and `house` for houses."""
    cloud_rendering: bool = False
    """Render without a display, by Vulkan."""


def thor_scenes(
    names: Sequence[str], settings: ThorSettings
) -> dict[str, Callable[[], AbstractContextManager[Source]]]:
    """What opens each of several scenes; refuses before anything runs if one cannot be read.

    Args:
        names: iTHOR's names, for example `FloorPlan401`, or JSON files of ProcTHOR houses.
        settings: what is recorded.

    Returns:
        For each scene a function that opens it.

    Raises:
        InputError: AI2-THOR is not installed, or a file cannot be read as a house.
    """
    _simulator_package()
    openers: dict[str, Callable[[], AbstractContextManager[Source]]] = {}
    for name in names:
        is_file = name.endswith(".json")
        stem = Path(name).stem if is_file else name
        if stem in openers:
            raise InputError(f"scenes: {stem} is given twice; give each scene once.")
        place = read_house(Path(name)) if is_file else name
        openers[stem] = partial(thor_scene, stem, place, settings)
    return openers


def read_house(path: Path) -> dict[str, Any]:
    """Read a ProcTHOR house.

    Args:
        path: JSON file of one house.

    Returns:
        The house as AI2-THOR takes it.

    Raises:
        InputError: the file is no house.
    """
    try:
        house = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as JSON ({error}); give a ProcTHOR house.") from error
    if not isinstance(house, dict) or not isinstance(house.get("rooms"), list):
        raise InputError(f"{path}: is no ProcTHOR house; it has no list of `rooms`.")
    metadata = house.get("metadata")
    if not isinstance(metadata, dict) or not isinstance(metadata.get("agent"), dict):
        raise InputError(f"{path}: says not where the agent starts; add `metadata.agent`.")
    return house


def room_type_of_plan(name: str) -> str:
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
    place: str | dict[str, Any],
    settings: ThorSettings,
    controller: Callable[..., Any] | None = None,
) -> Iterator[Source]:
    """Open a scene.

    Args:
        name: name of the scene.
        place: iTHOR's name, or a ProcTHOR house.
        settings: what is recorded.
        controller: makes the controller, by default AI2-THOR's own.

    Yields:
        The scene as a source; the simulator runs until the block ends.

    Raises:
        InputError: AI2-THOR is not installed or cannot start, or the scene has no reachable position.
    """
    simulator = _start(place, settings, controller)
    try:
        if isinstance(place, dict):
            # A house's agent starts at the origin, which may lie in a wall.
            _step(simulator, "TeleportFull", **place["metadata"]["agent"])
        positions = _reachable(simulator, name)
        agent = _Agent(simulator, positions)
        poses = [Pose(x, z, heading) for x, z in sorted(positions) for heading in HEADINGS]
        room_type = settings.room_type or room_type_of_plan(name)
        origin = f"ai2thor/5.0 {name} {settings.image_size} pixels {settings.field_of_view:g} degrees"
        yield Source(name, room_type, origin, poses, agent.move, agent.view)
    finally:
        simulator.stop()


class _Agent:
    """The agent of a running simulator."""

    def __init__(self, simulator: Any, positions: dict[tuple[float, float], dict[str, float]]):
        self._simulator = simulator
        self._positions = positions

    def move(self, pose: Pose, action: str) -> Pose | None:
        """Where an action leads, None where the simulator refuses it."""
        if not self._teleport(pose):
            return None
        event = _step(self._simulator, action)
        return _pose(event) if event.metadata["lastActionSuccess"] else None

    def view(self, pose: Pose) -> View | None:
        """What the agent sees, None where the simulator refuses the teleport."""
        event = self._teleport(pose)
        return View(_pose(event), np.array(event.frame[:, :, :3]), _visible(event)) if event else None

    def _teleport(self, pose: Pose) -> Any:
        """Teleport; the simulator's answer, None where it refuses."""
        event = _step(
            self._simulator,
            "Teleport",
            position=self._positions[pose.x, pose.z],
            rotation={"x": 0, "y": pose.rotation, "z": 0},
            horizon=0,
            standing=True,
        )
        return event if event.metadata["lastActionSuccess"] else None


def _reachable(simulator: Any, name: str) -> dict[tuple[float, float], dict[str, float]]:
    """Reachable positions by (x, z) in metres, without the simulator's rounding noise."""
    event = _step(simulator, "GetReachablePositions")
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


def _visible(event: Any) -> dict[str, float]:
    """Share of the frame by object type."""
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


def _step(simulator: Any, action: str, **arguments: Any) -> Any:
    """Ask the simulator; when it stops, what is recorded already is kept."""
    try:
        return simulator.step(action, **arguments)
    except (RuntimeError, TimeoutError) as error:
        cause = str(error).strip().splitlines()
        raise InputError(
            f"AI2-THOR stopped at {action} ({cause[0] if cause else type(error).__name__}); "
            "give the same command again and the record goes on."
        ) from error


def _simulator_package() -> Callable[..., Any]:
    try:
        return import_module("ai2thor.controller").Controller
    except ImportError as error:
        raise InputError("AI2-THOR is not installed; run: pip install 'relm-irl-jax[thor]'.") from error


def _start(place: str | dict[str, Any], settings: ThorSettings, controller: Callable[..., Any] | None) -> Any:
    make = controller or _simulator_package()
    platform = {}
    if settings.cloud_rendering:
        platform = {"platform": import_module("ai2thor.platform").CloudRendering}
    try:
        return make(
            scene=place,
            agentMode="default",
            gridSize=GRID_STEP,
            snapToGrid=True,
            rotateStepDegrees=90,
            visibilityDistance=VISIBILITY_METRES,
            renderInstanceSegmentation=True,
            width=settings.image_size,
            height=settings.image_size,
            fieldOfView=settings.field_of_view,
            **platform,
        )
    except Exception as error:  # whatever download, display, Vulkan or Unity say
        cause = str(error).strip().splitlines()
        raise InputError(
            f"AI2-THOR does not start ({cause[0] if cause else type(error).__name__}); it needs its Unity build, which "
            "it downloads once, and a display, or --cloud-rendering with Vulkan."
        ) from error
