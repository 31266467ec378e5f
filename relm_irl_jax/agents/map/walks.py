"""Walks through rooms and their odometry: all that the mapping agent learns from.

A walk begins at a random pose, often turns around there, and then follows shortest paths to one random pose after the
other. Its views, its poses in the frame of its start and the places that can be stood on are the agent's own
experience: nothing here is read from a map, a depth image or labels, except that most targets are the best views of
objects where the scene has labels.

In a wide scene, a walk and its targets keep to the places within an extent from the walk's start: a view reaches a few
places, so that wider maps would take longer and teach nothing more.
"""

from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Array, Bool, Float32, Int32, UInt8

from relm_irl_jax.agents.map.geometry import Extent
from relm_irl_jax.agents.map.rooms import Room


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Walks:
    """Walks through one room, and targets there.

    Attributes:
        views: the distinct views of each walk in the order in which they were met.
        pose: their poses in the frame of the walk's start.
        valid: False where a walk met fewer distinct views.
        target_views: views of the targets.
        target_pose: poses of the targets in the frame of each walk; not all of them lie in its extent.
        free: places that can be stood on, in the frame of each walk, by z and x.
        convolution: weights of the convolution that all views pass through first; None for the views as they are.
    """

    views: UInt8[np.ndarray | Array, "walks steps height width 3"]
    pose: Int32[np.ndarray | Array, "walks steps 3"]
    valid: Bool[np.ndarray | Array, "walks steps"]
    target_views: UInt8[np.ndarray | Array, "targets height width 3"]
    target_pose: Int32[np.ndarray | Array, "walks targets 3"]
    free: Bool[np.ndarray | Array, "walks z x"]
    convolution: Float32[np.ndarray | Array, "3 3 3 3"] | None = None

    @property
    def extent(self) -> Extent:
        """How far the map of a walk reaches."""
        return Extent.of_side(self.free.shape[-1])


def relative_pose(pose: Int32[np.ndarray, "*poses 3"], origin: Int32[np.ndarray, "3"]) -> Int32[np.ndarray, "*poses 3"]:
    """Poses in the frame of another one.

    Args:
        pose: heading, z and x.
        origin: pose of the frame's origin.

    Returns:
        Heading, z and x as seen from there: z ahead, x to the right.
    """
    dz, dx = pose[..., 1] - origin[1], pose[..., 2] - origin[2]
    z, x = [(dz, dx), (dx, -dz), (-dz, -dx), (-dx, dz)][origin[0]]
    return np.stack([(pose[..., 0] - origin[0]) % 4, z, x], -1).astype(np.int32)


def walk(room: Room, generator: np.random.Generator, steps: int, extent: Extent) -> list[int]:
    """Distinct states of one walk in the order in which they are met.

    Args:
        room: where to walk.
        generator: source of randomness.
        steps: number of distinct states at most.
        extent: states farther from the start are passed, but not met.

    Returns:
        The states; fewer where the walk keeps meeting the same ones.
    """
    state = int(generator.integers(len(room.pose)))
    near = within(room.pose, state, extent)
    goals = np.flatnonzero(near)
    met = {state: None}
    turn = int(generator.integers(1, 3))
    for _ in range(int(generator.choice((0, 1, 2, 3, 3)))):
        state = int(room.successor[state, turn])
        met[state] = None
    goal = state
    for _ in range(4 * steps):
        if len(met) >= steps:
            break
        while goal == state or room.distance[state, goal] < 0:
            goal = int(goals[generator.integers(len(goals))])
        following = room.successor[state]
        left = room.distance[following, goal] + generator.random(4) * 0.5
        state = int(following[left.argmin()])
        if near[state]:
            met[state] = None
    return list(met)[:steps]


def within(pose: Int32[np.ndarray, "states 3"], start: int, extent: Extent) -> Bool[np.ndarray, "states"]:
    """Which states lie in the extent of a walk.

    Args:
        pose: heading, z and x of each state.
        start: the walk's first state.
        extent: how far its map reaches.

    Returns:
        Whether each state does.
    """
    return np.abs(pose[:, 1:] - pose[start, 1:]).max(1) <= extent.radius


def draw_walks(
    room: Room,
    generator: np.random.Generator,
    *,
    walks: int,
    steps: int,
    targets: int,
    best_share: float,
    extent: Extent = Extent(),  # noqa: B008 (frozen)
) -> Walks:
    """Draw walks and targets.

    Args:
        room: where to walk.
        generator: source of randomness.
        walks: number of walks.
        steps: distinct views of a walk.
        targets: number of targets, the same for all walks.
        best_share: share of the targets that are best views of objects.
        extent: how far the maps of walks reach; targets lie in that of one of the walks, if any does.

    Returns:
        The walks.
    """
    paths = [walk(room, generator, steps, extent) for _ in range(walks)]
    near = np.any([within(room.pose, path[0], extent) for path in paths], 0)
    objects, anything = room.best[near[room.best]], room.targets[near[room.targets]]
    wanted = min(int(targets * best_share), len(objects))
    best = generator.permutation(objects)[:wanted]
    others = generator.choice(anything if len(anything) else room.targets, targets - wanted)
    goal = np.concatenate([best, others]).astype(np.int64)
    padded = np.array([path + path[-1:] * (steps - len(path)) for path in paths])
    free = np.zeros((walks, extent.side, extent.side), bool)
    poses, target_poses = [], []
    for number, path in enumerate(paths):
        frame = relative_pose(room.pose, room.pose[path[0]])
        z, x = frame[within(room.pose, path[0], extent), 1:].T + extent.radius
        free[number, z, x] = True
        poses.append(frame[padded[number]])
        target_poses.append(frame[goal])
    return Walks(
        views=room.views[padded],
        pose=np.stack(poses),
        valid=np.arange(steps) < np.array([[len(path)] for path in paths]),
        target_views=room.views[goal],
        target_pose=np.stack(target_poses),
        free=free,
    )
