"""Rooms as walks need them: views, odometry and moves.

A room is made of a scene, or counted along the moves of a world's graph, as a walk through all of it would.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int, Int32, UInt8

from relm_irl_jax.agents.map.geometry import FORWARD, RADIUS
from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.scenes.scene import COLLISION, Scene, grid_poses, shortest_path_distances, successors


@dataclass(frozen=True)
class Room:
    """A scene as walks need it.

    Attributes:
        views: view of each state.
        pose: heading, z and x of each state, in right angles and cells.
        successor: next state for each action; a collision leads back.
        distance: least number of actions between states.
        best: states that see an object best; empty without labels.
        targets: states that may be targets; evaluation targets are not among them.
    """

    views: UInt8[np.ndarray, "states height width 3"]
    pose: Int32[np.ndarray, "states 3"]
    successor: Int[np.ndarray, "states 4"]
    distance: Int[np.ndarray, "states states"]
    best: Int[np.ndarray, "best"]
    targets: Int[np.ndarray, "targets"]


def to_room(scene: Scene) -> Room:
    """Take from a scene what walks need.

    Args:
        scene: a scene with views.

    Returns:
        The room.

    Raises:
        InputError: the scene has no views, or is too large.
    """
    pose = grid_poses(scene)
    _check_extent(scene.name, pose[:, 1:])
    return Room(
        views=scene.views,
        pose=pose,
        successor=successors(scene.graph),
        distance=scene.shortest_path_distance,
        best=np.array(sorted(set(best_views(scene).values())), np.int32),
        targets=np.arange(scene.n_states),
    )


def count_poses(
    successor: Int[np.ndarray, "states 4"], name: str
) -> tuple[Int[np.ndarray, "kept"], Int32[np.ndarray, "kept 3"]]:
    """Count poses along the moves of a scene, from its first state on: odometry of a walk through all of it.

    Args:
        successor: next state for each action; a collision leads back.
        name: the scene's name, for messages.

    Returns:
        The states that the first one can reach, ascending, and their poses: heading, z and x.

    Raises:
        InputError: the scene is too large.
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
    poses = np.array([pose[state] for state in kept.tolist()], np.int32)
    _check_extent(name, poses[:, 1:])
    return kept, poses


def _check_extent(name: str, cells: Int[np.ndarray, "states 2"]) -> None:
    """Refuse a scene that does not fit into the square of poses from every start."""
    extent = np.ptp(cells, axis=0).max()
    if extent > RADIUS:
        raise InputError(f"{name}: {extent + 1} places along one side; the mapping agent's map holds {RADIUS + 1}.")


def room_from_graph(
    views: UInt8[np.ndarray, "states height width 3"],
    successor: Int[np.ndarray, "states 4"],
    best: Int[np.ndarray, "best"],
    targets: Int[np.ndarray, "targets"],
    name: str = "scene",
) -> Room:
    """A room whose poses are counted along its moves.

    Args:
        views: view of each state.
        successor: next state for each action; a collision leads back.
        best: states that are preferred as targets.
        targets: states that may be targets.
        name: the scene's name, for messages.

    Returns:
        The room. States that the first one cannot reach are left out.

    Raises:
        InputError: the room is too large.
    """
    kept, pose = count_poses(successor, name)
    number = np.full(len(successor), -1)
    number[kept] = np.arange(len(kept))
    graph = np.where(successor == np.arange(len(successor))[:, None], COLLISION, number[successor])[kept].astype(
        np.int32
    )
    return Room(
        views=views[kept],
        pose=pose,
        successor=successors(graph),
        distance=shortest_path_distances(graph),
        best=number[best][number[best] >= 0],
        targets=number[targets][number[targets] >= 0],
    )
