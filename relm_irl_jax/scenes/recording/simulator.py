"""The interface between a simulator and the recorder: poses, the result of each action, and the view at each pose.

A simulator provides one function that returns a `SimulatorScene`; `relm_irl_jax.scenes.record_scene` visits all its
poses and builds the `Scene`. `recording.vizdoom` and `recording.thor` are examples.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import UInt8

from relm_irl_jax.scenes.scene import ACTIONS, GRID_STEP

AHEAD, RIGHT, LEFT, BACK = ACTIONS


class Pose(NamedTuple):
    """Position and heading of a camera.

    Attributes:
        x: metres.
        z: metres.
        rotation: degrees; 0 faces +z, 90 faces +x.
    """

    x: float
    z: float
    rotation: float


@dataclass(frozen=True)
class View:
    """The view at a pose.

    Attributes:
        pose: the pose that the simulator reports; if it differs from the requested pose, the recording leaves it out.
        image: RGB.
        visible_objects: share of the image that each category of objects covers, in (0, 1]; empty without labels.
    """

    pose: Pose
    image: UInt8[np.ndarray, "height width 3"]
    visible_objects: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SimulatorScene:
    """A scene of a running simulator, ready to be recorded.

    Attributes:
        name: name of the scene, for example `map01`.
        room_type: room type of the scene.
        source: simulator, version and all settings on which views or moves depend; becomes `Scene.source`. An
            interrupted recording only continues if the source is the same.
        poses: the states, on one grid of `GRID_STEP` with headings at right angles, in any order, without duplicates.
        move: maps a pose and one of `ACTIONS` to the next pose, None for a collision. Must not depend on earlier calls.
        view: maps a pose to its view, None if the camera cannot be there. Must not depend on earlier calls.
    """

    name: str
    room_type: str
    source: str
    poses: Sequence[Pose]
    move: Callable[[Pose, str], Pose | None]
    view: Callable[[Pose], View | None]


def next_pose(pose: Pose, action: str) -> Pose:
    """The pose after an action that nothing obstructs.

    Args:
        pose: pose before the action.
        action: one of `ACTIONS`.

    Returns:
        The pose one grid step or one right angle further.
    """
    if action in (RIGHT, LEFT):
        return pose._replace(rotation=(pose.rotation + (90 if action == RIGHT else -90)) % 360)
    angle = math.radians(pose.rotation)
    step = GRID_STEP if action == AHEAD else -GRID_STEP
    return pose._replace(x=pose.x + step * round(math.sin(angle)), z=pose.z + step * round(math.cos(angle)))


SceneOpener = Callable[[], AbstractContextManager[SimulatorScene]]
"""Starts a simulator in one scene; it stops when the context ends."""
