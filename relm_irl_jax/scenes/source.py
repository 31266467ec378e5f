"""What a source of scenes is: poses, and what an engine says when it is asked to move or to look.

A source is one function that returns a `Source`; `relm_irl_jax.scenes.record.record_scene` walks it into a `Scene` and
does the rest: graph, distances, checks, resuming, progress. `relm_irl_jax.scenes.vizdoom` and
`relm_irl_jax.scenes.thor` are two of them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import UInt8

from relm_irl_jax.scenes.scene import ACTIONS, GRID_STEP

AHEAD, RIGHT, LEFT, BACK = ACTIONS


class Pose(NamedTuple):
    """Where a camera stands and looks.

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
    """What an engine shows at a pose.

    Attributes:
        pose: the pose as the engine reports it; the recorder leaves out states that the engine moved.
        frame: the picture, RGB.
        visible: share of the frame that each category of objects covers, in (0, 1]; empty without labels.
    """

    pose: Pose
    frame: UInt8[np.ndarray, "height width 3"]
    visible: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Source:
    """One place of one engine, ready to be walked.

    Attributes:
        name: name of the scene, for example `map01`.
        room_type: which scenes it belongs to; training has one head for each.
        origin: engine, its version and every setting that pictures or moves depend on; a record that was cut off goes
            on only under the same origin. It becomes `Scene.source`.
        poses: the states, on one grid of `GRID_STEP` with headings at right angles, in any order, each once.
        move: where one of `ACTIONS` leads from a pose, None for a collision. It must not depend on earlier calls.
        view: what the camera shows at a pose, None where it cannot stand there. It must not depend on earlier calls.
    """

    name: str
    room_type: str
    origin: str
    poses: Sequence[Pose]
    move: Callable[[Pose, str], Pose | None]
    view: Callable[[Pose], View | None]


def stepped(pose: Pose, action: str) -> Pose:
    """Where an action leads if nothing is in the way.

    Args:
        pose: where it starts.
        action: one of `ACTIONS`.

    Returns:
        The pose one grid step or one right angle on.
    """
    if action in (RIGHT, LEFT):
        return pose._replace(rotation=(pose.rotation + (90 if action == RIGHT else -90)) % 360)
    angle = math.radians(pose.rotation)
    step = GRID_STEP if action == AHEAD else -GRID_STEP
    return pose._replace(x=pose.x + step * round(math.sin(angle)), z=pose.z + step * round(math.cos(angle)))
