"""Walks through rooms and their odometry: all that the mapping agent learns from.

A walk begins at a random pose, often turns around there, and then follows shortest paths to one random pose after the
other. Its views, its poses in the frame of its start and the places that can be stood on are the agent's own
experience: nothing here is read from a map, a depth image or labels, except that most targets are the best views of
objects where the scene has labels.

Built-in training rooms are numbered from `FIRST_ROOM`, apart from every room that any task evaluates on.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Array, Bool, Int, Int32, UInt8

from relm_irl_jax.agents.map.geometry import FORWARD, RADIUS, SIDE
from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.scenes.scene import (
    COLLISION,
    GRID_STEP,
    ROOM_TYPES,
    Scene,
    shortest_path_distances,
    successors,
)

FIRST_ROOM = 1000
"""Number of the first built-in training room of each type."""

LAST_ROOM = 9999
"""Number of the last one. Rooms 0 to 99 and those from 10000 on are for evaluation."""


@dataclass(frozen=True)
class Room:
    """A scene as walks need it.

    Attributes:
        views: view of each state.
        pose: heading, z and x of each state, in right angles and cells.
        successor: next state for each action; a collision leads back.
        distance: least number of actions between states.
        best: states that see an object best; empty without labels.
    """

    views: UInt8[np.ndarray, "states height width 3"]
    pose: Int32[np.ndarray, "states 3"]
    successor: Int[np.ndarray, "states 4"]
    distance: Int[np.ndarray, "states states"]
    best: Int[np.ndarray, "best"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Walks:
    """Walks through one room, and targets there.

    Attributes:
        views: the distinct views of each walk in the order in which they were met.
        pose: their poses in the frame of the walk's start.
        valid: False where a walk met fewer distinct views.
        target_views: views of the targets.
        target_pose: poses of the targets in the frame of each walk.
        free: places that can be stood on, in the frame of each walk, by z and x.
    """

    views: UInt8[np.ndarray | Array, "walks steps height width 3"]
    pose: Int32[np.ndarray | Array, "walks steps 3"]
    valid: Bool[np.ndarray | Array, "walks steps"]
    target_views: UInt8[np.ndarray | Array, "targets height width 3"]
    target_pose: Int32[np.ndarray | Array, "walks targets 3"]
    free: Bool[np.ndarray | Array, "walks z x"]


def check_training_rooms(numbers: Sequence[int]) -> None:
    """Refuse rooms that are kept for evaluation.

    Args:
        numbers: numbers of built-in rooms.

    Raises:
        InputError: one lies outside `FIRST_ROOM` to `LAST_ROOM`.
    """
    for number in numbers:
        if not FIRST_ROOM <= number <= LAST_ROOM:
            raise InputError(
                f"Room {number} is kept for evaluation; the mapping agent trains on rooms {FIRST_ROOM} to {LAST_ROOM}."
            )


def to_room(scene: Scene) -> Room:
    """Take from a scene what walks need.

    Args:
        scene: a scene with views.

    Returns:
        The room.

    Raises:
        InputError: the scene has no views, or is too large.
    """
    cells = np.rint((scene.location - scene.location.min(0)) / GRID_STEP).astype(np.int32)
    if cells.max() > RADIUS:
        raise InputError(
            f"{scene.name}: {cells.max() + 1} places along one side, the mapping agent's map holds {RADIUS + 1}."
        )
    heading = np.rint(scene.rotation / 90).astype(np.int32) % 4
    return Room(
        views=scene.views,
        pose=np.stack([heading, cells[:, 1], cells[:, 0]], 1),
        successor=successors(scene.graph),
        distance=scene.shortest_path_distance,
        best=np.array(sorted(set(best_views(scene).values())), np.int32),
    )


def room_from_graph(
    views: UInt8[np.ndarray, "states height width 3"],
    successor: Int[np.ndarray, "states 4"],
    best: Int[np.ndarray, "best"],
) -> Room:
    """A room whose poses are counted along its moves, from its first state on: odometry of a walk through all of it.

    Args:
        views: view of each state.
        successor: next state for each action; a collision leads back.
        best: states that are preferred as targets.

    Returns:
        The room. States that the first one cannot reach are left out.

    Raises:
        InputError: the room is too large.
    """
    pose = {0: (0, 0, 0)}
    queue = [0]
    for state in queue:
        heading, z, x = pose[state]
        dx, dz = FORWARD[heading].tolist()
        arrivals = (
            (heading, z + dz, x + dx),
            ((heading + 1) % 4, z, x),
            ((heading - 1) % 4, z, x),
            (heading, z - dz, x - dx),
        )
        for following, arrival in zip(successor[state].tolist(), arrivals, strict=True):
            if following not in pose:
                pose[following] = arrival
                queue.append(following)
    kept = np.array(sorted(pose))
    place = np.full(len(successor), -1)
    place[kept] = np.arange(len(kept))
    graph = np.where(successor == np.arange(len(successor))[:, None], COLLISION, place[successor])[kept].astype(
        np.int32
    )
    poses = np.array([pose[state] for state in kept.tolist()], np.int32)
    extent = np.ptp(poses[:, 1:], axis=0).max()
    if extent > RADIUS:
        raise InputError(f"A scene has {extent + 1} places along one side; the mapping agent's map holds {RADIUS + 1}.")
    return Room(
        views=views[kept],
        pose=poses,
        successor=successors(graph),
        distance=shortest_path_distances(graph),
        best=place[best][place[best] >= 0].astype(np.int32),
    )


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


def walk(room: Room, generator: np.random.Generator, steps: int) -> list[int]:
    """Distinct states of one walk in the order in which they are met.

    Args:
        room: where to walk.
        generator: source of randomness.
        steps: number of distinct states at most.

    Returns:
        The states; fewer where the walk keeps meeting the same ones.
    """
    state = int(generator.integers(len(room.pose)))
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
            goal = int(generator.integers(len(room.pose)))
        following = room.successor[state]
        left = room.distance[following, goal] + generator.random(4) * 0.5
        state = int(following[left.argmin()])
        met[state] = None
    return list(met)[:steps]


def draw_walks(
    room: Room,
    generator: np.random.Generator,
    *,
    walks: int,
    steps: int,
    targets: int,
    best_share: float,
) -> Walks:
    """Draw walks and targets.

    Args:
        room: where to walk.
        generator: source of randomness.
        walks: number of walks.
        steps: distinct views of a walk.
        targets: number of targets, the same for all walks.
        best_share: share of the targets that are best views of objects.

    Returns:
        The walks.
    """
    paths = [walk(room, generator, steps) for _ in range(walks)]
    wanted = min(int(targets * best_share), len(room.best))
    best = generator.permutation(room.best)[:wanted]
    goal = np.concatenate([best, generator.integers(len(room.pose), size=targets - wanted)]).astype(np.int64)
    padded = np.array([path + path[-1:] * (steps - len(path)) for path in paths])
    free = np.zeros((walks, SIDE, SIDE), bool)
    poses, target_poses = [], []
    for number, path in enumerate(paths):
        frame = relative_pose(room.pose, room.pose[path[0]])
        free[number, frame[:, 1] + RADIUS, frame[:, 2] + RADIUS] = True
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


def training_numbers(rooms: int) -> list[tuple[str, int]]:
    """Type and number of the built-in training rooms.

    Args:
        rooms: how many, spread over the room types.

    Returns:
        The rooms, the types in turn.
    """
    numbers = [(ROOM_TYPES[i % len(ROOM_TYPES)], FIRST_ROOM + i // len(ROOM_TYPES)) for i in range(rooms)]
    check_training_rooms([number for _, number in numbers])
    return numbers
