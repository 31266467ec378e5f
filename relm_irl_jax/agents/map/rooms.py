"""Rooms as walks need them: views, odometry and moves.

A room is made of a scene, or counted along the moves of a world's graph, as a walk through all of it would.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int, Int32, UInt8

from relm_irl_jax.agents.map.geometry import FORWARD, Extent
from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.scenes.scene import COLLISION, Scene, grid_poses, shortest_path_distances, successors
from relm_irl_jax.world import World


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
        InputError: the scene has no views.
    """
    return Room(
        views=scene.views,
        pose=grid_poses(scene),
        successor=successors(scene.graph),
        distance=scene.shortest_path_distance,
        best=np.array(sorted(set(best_views(scene).values())), np.int32),
        targets=np.arange(scene.n_states),
    )


def count_poses(
    successor: Int[np.ndarray, "states 4"], first: int = 0
) -> tuple[Int[np.ndarray, "kept"], Int32[np.ndarray, "kept 3"]]:
    """Count poses along the moves of a scene: odometry of a walk through all of it.

    Args:
        successor: next state for each action; a collision leads back.
        first: state where the walk begins, which has the pose (0, 0, 0).

    Returns:
        The states that the first one can reach, ascending, and their poses: heading, z and x.
    """
    pose = {first: (0, 0, 0)}
    queue = [first]
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
    return kept, np.array([pose[state] for state in kept.tolist()], np.int32)


def places_along_side(successor: Int[np.ndarray, "states 4"]) -> int:
    """Places along the longer side of a scene.

    Args:
        successor: next state for each action; a collision leads back.

    Returns:
        Their number; where parts of the scene cannot reach each other, that of the widest part.
    """
    left, places = set(range(len(successor))), 1
    while left:
        kept, pose = count_poses(successor, min(left))
        places = max(places, int(np.ptp(pose[:, 1:], axis=0).max()) + 1)
        left -= set(kept.tolist())
    return places


def world_extent(world: World) -> Extent:
    """The extent that holds every scene of a world from every start.

    Args:
        world: the scenes.

    Returns:
        It.
    """
    scene, successor = np.asarray(world.scene), np.asarray(world.successor)
    states = [np.flatnonzero(scene == number) for number in range(world.n_scenes)]
    return Extent.of_places(max(places_along_side(successor[part] - part[0]) for part in states))


def room_from_graph(
    views: UInt8[np.ndarray, "states height width 3"],
    successor: Int[np.ndarray, "states 4"],
    best: Int[np.ndarray, "best"],
    targets: Int[np.ndarray, "targets"],
) -> Room:
    """A room whose poses are counted along its moves.

    Args:
        views: view of each state.
        successor: next state for each action; a collision leads back.
        best: states that are preferred as targets.
        targets: states that may be targets.

    Returns:
        The room. States that the first one cannot reach are left out.
    """
    kept, pose = count_poses(successor)
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
