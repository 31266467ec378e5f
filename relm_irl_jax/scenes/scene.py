"""The scene: a finite navigation problem with one view for each state.

A *state* is a pose: a position on a 0.5 m grid, here called a *place*, with one of four headings. An *action* moves the
camera by one step or turns it by 90 degrees.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, Float64, Int, Int32, Int64, UInt8

from relm_irl_jax.errors import InputError

ACTIONS = ("MoveAhead", "RotateRight", "RotateLeft", "MoveBack")
"""Names of the four actions, in the order of the columns of `Scene.graph`."""

GRID_STEP = 0.5
"""Length of one move in metres."""

HEADINGS = (0.0, 90.0, 180.0, 270.0)
"""Headings in degrees: 0 faces +z, 90 faces +x."""

COLLISION = -1
"""Entry of `Scene.graph` where the action would collide and leaves the state unchanged."""

ROWS_AT_ONCE = 512
"""Rows of the table of distances that are in memory at once while it is computed or searched."""

UNREACHABLE = -1
"""Entry of `Scene.shortest_path_distance` where no path exists."""


@dataclass(frozen=True)
class Scene:
    """One scene, as arrays on the host.

    Attributes:
        name: unique name, for example `bathroom-0`.
        room_type: one of `ROOM_TYPES`, or another name for scenes from other sources.
        location: place (x, z) of each state, in metres.
        rotation: heading of each state, in degrees, one of `HEADINGS`.
        graph: next state for each action of `ACTIONS`, or `COLLISION`.
        shortest_path_distance: smallest number of actions from row to column, or `UNREACHABLE`. That of a large scene
            may be a part of its file, which is read where it is used.
        observation: view of each state as RGB; None if the views were not loaded.
        features: encoded view of each state; None before encoding.
        visible_object: share of the view that each category covers, in [0, 1]; None without labels.
        categories: name of each column of `visible_object`.
        source: program and version that made the scene, for example `rooms/3`.
        encoder: name of the encoder of `features`; empty before encoding.
    """

    name: str
    room_type: str
    location: Float64[np.ndarray, "states 2"]
    rotation: Float64[np.ndarray, "states"]
    graph: Int32[np.ndarray, "states 4"]
    shortest_path_distance: Int32[np.ndarray, "states states"]
    observation: UInt8[np.ndarray, "states height width 3"] | None = None
    features: Float32[np.ndarray, "states feature"] | None = None
    visible_object: Float32[np.ndarray, "states category"] | None = None
    categories: tuple[str, ...] = ()
    source: str = ""
    encoder: str = ""

    @property
    def n_states(self) -> int:
        """Number of states."""
        return len(self.graph)

    @property
    def reachable(self) -> Int64[np.ndarray, "reachable"]:
        """States that some other state can reach, ascending; in the original scenes, not all states are reachable."""
        reached = np.zeros(self.n_states, bool)
        for first in range(0, self.n_states, ROWS_AT_ONCE):
            reached |= (self.shortest_path_distance[first : first + ROWS_AT_ONCE] > 0).any(0)
        return np.flatnonzero(reached)

    def without_views(self) -> "Scene":
        """The same scene with `observation` None."""
        return replace(self, observation=None)

    @property
    def views(self) -> UInt8[np.ndarray, "states height width 3"]:
        """The views; raises InputError if they were not loaded."""
        if self.observation is None:
            raise InputError(f"{self.name}: the scene has no views; load or generate it with views.")
        return self.observation

    @property
    def encoded(self) -> Float32[np.ndarray, "states feature"]:
        """The features; raises InputError before encoding."""
        if self.features is None:
            raise InputError(f"{self.name}: the scene has no features; encode its views first.")
        return self.features


def first_of_each_type(scenes: Sequence[Scene]) -> dict[str, int]:
    """Choose one scene of each room type, for figures.

    Args:
        scenes: the scenes.

    Returns:
        Index of the first scene of each room type.
    """
    first: dict[str, int] = {}
    for number, scene in enumerate(scenes):
        first.setdefault(scene.room_type, number)
    return first


def pose_graph(
    places: Sequence[tuple[int, int]],
) -> tuple[Float64[np.ndarray, "states 2"], Float64[np.ndarray, "states"], Int32[np.ndarray, "states 4"]]:
    """Build states and moves from the free places of a grid.

    Every free place has four states, one for each heading, in the order of `HEADINGS`. MoveAhead and MoveBack lead to
    the neighbouring place along the heading if it is free, and collide otherwise; turns keep the place.

    Args:
        places: distinct integer grid coordinates (column along x, row along z) of the free places.

    Returns:
        Location in metres, rotation in degrees and graph, as in `Scene`.
    """
    index = {place: number for number, place in enumerate(places)}
    forward = ((0, 1), (1, 0), (0, -1), (-1, 0))
    graph = np.full((4 * len(places), 4), COLLISION, np.int32)
    for (column, row), number in index.items():
        for heading, (dx, dz) in enumerate(forward):
            ahead = index.get((column + dx, row + dz))
            back = index.get((column - dx, row - dz))
            graph[4 * number + heading] = (
                COLLISION if ahead is None else 4 * ahead + heading,
                4 * number + (heading + 1) % 4,
                4 * number + (heading - 1) % 4,
                COLLISION if back is None else 4 * back + heading,
            )
    location = np.repeat(np.asarray(places, np.float64).reshape(-1, 2) * GRID_STEP, 4, axis=0)
    rotation = np.tile(np.asarray(HEADINGS), len(places))
    return location, rotation, graph


def shortest_path_distances(graph: Int[np.ndarray, "states 4"]) -> Int32[np.ndarray, "states states"]:
    """Smallest number of actions between all pairs of states.

    Args:
        graph: next state for each action, or `COLLISION`.

    Returns:
        Distance from row to column, `UNREACHABLE` where there is no path.
    """
    from scipy.sparse import csr_array  # here, since most readers of scenes do not need it
    from scipy.sparse.csgraph import shortest_path

    state, action = np.nonzero(graph != COLLISION)
    ends = (state.astype(np.int32), graph[state, action].astype(np.int32))  # SciPy 1.14 takes no longer numbers
    edges = csr_array((np.ones(len(state)), ends), shape=(len(graph), len(graph)))
    distances = np.empty((len(graph), len(graph)), np.int32)
    for first in range(0, len(graph), ROWS_AT_ONCE):  # scipy's own table has 64 bits
        rows = np.arange(first, min(first + ROWS_AT_ONCE, len(graph)))
        found = shortest_path(edges, method="D", unweighted=True, indices=rows)
        distances[rows] = np.where(np.isinf(found), UNREACHABLE, found)
    return distances


def successors(graph: Int[np.ndarray, "states 4"]) -> Int32[np.ndarray, "states 4"]:
    """Next state for each action; a collision leaves the state unchanged.

    Args:
        graph: next state for each action, or `COLLISION`.

    Returns:
        Next state for each action; every entry is a state.
    """
    return np.where(graph == COLLISION, np.arange(len(graph), dtype=np.int32)[:, None], graph).astype(np.int32)


def grid_poses(scene: Scene) -> Int32[np.ndarray, "states 3"]:
    """Poses in right angles and steps of the grid.

    Args:
        scene: a scene whose states lie on a grid.

    Returns:
        Heading, z and x of each state; z and x count from the scene's corner.
    """
    cells = np.rint((scene.location - scene.location.min(0)) / GRID_STEP).astype(np.int32)
    heading = np.rint(scene.rotation / 90).astype(np.int32) % 4
    return np.stack([heading, cells[:, 1], cells[:, 0]], 1)
