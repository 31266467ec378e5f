"""Recording of scenes: every state of a simulator's scene is visited once, and the results become a scene file.

During a recording, the results are stored in a SQLite database in the same folder as the scene file, one row for each
finished state. An interrupted recording continues from the database. When all states are finished, the scene file is
written and the database deleted.
"""

import hashlib
import json
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Int32, Int64, UInt8
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from relm_irl_jax.errors import InputError
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.scenes.consistency import TOLERANCE
from relm_irl_jax.scenes.recording.simulator import Pose, SimulatorScene, View, next_pose
from relm_irl_jax.scenes.scene import ACTIONS, COLLISION, GRID_STEP, Scene, shortest_path_distances
from relm_irl_jax.scenes.scene_file import save_scene

OPPOSITE = (3, 2, 1, 0)
"""Number of the action that undoes each of `ACTIONS`."""

Key = tuple[int, int, int]
"""A pose in integers: columns and rows relative to the first pose, and quarter turns."""


@dataclass(frozen=True)
class Recording:
    """A recorded scene, with counts of what was left out.

    Attributes:
        scene: the scene.
        refused: number of poses that were left out because the simulator refused or changed them.
        closed: number of moves that became collisions because they led elsewhere or could not be undone.
        disconnected: number of states that were left out because they are outside the largest connected component.
    """

    scene: Scene
    refused: int
    closed: int
    disconnected: int


def record_scene(simulated: SimulatorScene, path: Path) -> Recording:
    """Record a scene of a simulator as a scene file.

    Args:
        simulated: the scene to visit.
        path: file to write; the folder also contains a database until the recording is complete.

    Returns:
        The recorded scene, and counts of what was left out.

    Raises:
        InputError: there is no usable state, or views differ in size.
        ValueError: poses are off the grid or occur twice, or views are not uint8 RGB images.
    """
    grid = _Grid(simulated.poses)
    path.parent.mkdir(parents=True, exist_ok=True)
    database_path = path.with_name(f".{path.stem}.record")
    with closing(_open_database(database_path, simulated)) as database:
        done = {number for (number,) in database.execute("SELECT number FROM state")}
        with progress_bar(f"recording {simulated.name}", len(simulated.poses), "states") as advance:
            advance(len(done))
            for number, pose in enumerate(simulated.poses):
                if number in done:
                    continue
                row = (number, *_visit(simulated, grid, pose))
                with database:
                    database.execute("INSERT INTO state VALUES (?, ?, ?, ?, ?)", row)
                advance(1)
        recording = _build_scene(simulated, grid, database)
    save_scene(recording.scene, path)
    database_path.unlink()
    return recording


class _Grid:
    """The grid of a scene's poses."""

    def __init__(self, poses: Sequence[Pose]):
        if not poses:
            raise InputError("The simulator gives no pose; start it at another position.")
        self.first = poses[0]
        self.keys = [self.key(pose) for pose in poses]
        if None in self.keys:
            raise ValueError(f"{poses[self.keys.index(None)]} is off the grid of the first pose.")
        self.number = {key: number for number, key in enumerate(self.keys)}
        if len(self.number) < len(poses):
            raise ValueError("The simulator gives the same pose twice.")

    def key(self, pose: Pose | None) -> Key | None:
        """The pose in integers; None for a pose that is off the grid by more than rounding errors."""
        if pose is None or not np.isfinite(pose).all():
            return None
        steps = (pose.x - self.first.x) / GRID_STEP, (pose.z - self.first.z) / GRID_STEP, pose.rotation / 90
        column, row, quarter = (round(step) for step in steps)
        off = (abs(steps[0] - column) * GRID_STEP, abs(steps[1] - row) * GRID_STEP, abs(steps[2] - quarter) * 90)
        return (column, row, quarter % 4) if max(off) <= TOLERANCE else None


def _open_database(path: Path, simulated: SimulatorScene) -> sqlite3.Connection:
    """Open the database of a recording; if it is damaged or has another source, it is replaced by an empty one."""
    poses = hashlib.sha256(repr([tuple(pose) for pose in simulated.poses]).encode()).hexdigest()
    identity = json.dumps([1, simulated.name, simulated.room_type, simulated.source, poses])
    for attempt in range(2):
        database = sqlite3.connect(path)
        try:
            # Without synchronisation, a killed process loses nothing; only a power failure could.
            database.execute("PRAGMA synchronous = OFF")
            with database:
                database.execute("CREATE TABLE IF NOT EXISTS source (identity TEXT)")
                database.execute(
                    "CREATE TABLE IF NOT EXISTS state"
                    " (number INTEGER PRIMARY KEY, shape TEXT, frame BLOB, visible TEXT, moves TEXT)"
                )
                stored = database.execute("SELECT identity FROM source").fetchone()
                if stored is None:
                    database.execute("INSERT INTO source VALUES (?)", (identity,))
                    stored = (identity,)
            database.execute("SELECT number, shape, visible, moves FROM state").fetchall()
            if stored == (identity,):
                return database
        except sqlite3.DatabaseError:
            if attempt:
                raise
        database.close()
        path.unlink()
    raise AssertionError("a new database is of this source")


def _visit(simulated: SimulatorScene, grid: _Grid, pose: Pose) -> tuple[str | None, bytes | None, str | None, str]:
    """Take the view and try all actions at one pose; returns the columns of its row, without image if it is refused."""
    view: View | None = simulated.view(pose)
    if view is None or grid.key(view.pose) != grid.key(pose):
        return None, None, None, "[]"
    image = view.image
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise ValueError(f"{simulated.name}: views must be uint8 RGB, not {image.dtype} {image.shape}.")
    # Each action can only lead to one pose; the row says whether it does: null for a collision, false for another pose.
    arrived = []
    for action in ACTIONS:
        reached = simulated.move(pose, action)
        arrived.append(None if reached is None else grid.key(reached) == grid.key(next_pose(pose, action)))
    visible = {category: float(share) for category, share in view.visible_objects.items() if share > 0}
    return json.dumps(image.shape), image.tobytes(), json.dumps(visible), json.dumps(arrived)


def _build_scene(simulated: SimulatorScene, grid: _Grid, database: sqlite3.Connection) -> Recording:
    """Build the scene from all rows of the database."""
    rows = database.execute("SELECT number, moves FROM state WHERE frame IS NOT NULL ORDER BY number").fetchall()
    n_poses = len(simulated.poses)
    if not rows:
        raise InputError(f"{simulated.name}: the simulator refuses all {n_poses} poses; start it at another position.")
    graph, n_elsewhere = _recorded_moves(simulated, grid, rows)
    graph, n_one_way = _close_one_way_moves(graph)
    kept = _largest_component(graph, np.asarray([number for number, _ in rows]))
    renumbered = np.full(n_poses + 1, COLLISION, np.int32)  # the last entry is for collisions
    renumbered[kept] = np.arange(len(kept))
    graph = renumbered[graph[kept]]
    images, visible = _recorded_views(simulated, database, kept)
    categories = tuple(sorted({category for shares in visible for category in shares}))
    shares = np.asarray([[shares.get(c, 0.0) for c in categories] for shares in visible], np.float32)
    keys = np.asarray([grid.keys[number] for number in kept], np.float64)
    scene = Scene(
        name=simulated.name,
        room_type=simulated.room_type,
        location=np.asarray([grid.first.x, grid.first.z]) + GRID_STEP * keys[:, :2],
        rotation=90.0 * keys[:, 2],
        graph=graph,
        shortest_path_distance=shortest_path_distances(graph),
        observation=images,
        visible_object=shares if categories else None,
        categories=categories,
        source=simulated.source,
    )
    return Recording(
        scene=scene,
        refused=n_poses - len(rows),
        closed=n_elsewhere + n_one_way,
        disconnected=len(rows) - len(kept),
    )


def _recorded_moves(
    simulated: SimulatorScene, grid: _Grid, rows: list[tuple[int, str]]
) -> tuple[Int32[np.ndarray, "states 4"], int]:
    """Graph over all poses, and the number of moves that led elsewhere."""
    graph = np.full((len(simulated.poses), 4), COLLISION, np.int32)
    accepted = {number for number, _ in rows}
    n_elsewhere = 0
    for number, moves in rows:
        for action, arrived in enumerate(json.loads(moves)):
            next_number = grid.number.get(grid.key(next_pose(simulated.poses[number], ACTIONS[action])))
            if arrived and next_number in accepted:
                graph[number, action] = next_number
            n_elsewhere += arrived is False
    return graph, n_elsewhere


def _close_one_way_moves(graph: Int32[np.ndarray, "states 4"]) -> tuple[Int32[np.ndarray, "states 4"], int]:
    """Replace moves that the opposite action does not undo by collisions; returns the graph and their number."""
    state, action = np.nonzero(graph != COLLISION)
    one_way = graph[graph[state, action], np.asarray(OPPOSITE)[action]] != state
    closed = graph.copy()
    closed[state[one_way], action[one_way]] = COLLISION
    return closed, int(one_way.sum())


def _largest_component(
    graph: Int32[np.ndarray, "states 4"], accepted: Int64[np.ndarray, "accepted"]
) -> Int64[np.ndarray, "kept"]:
    """States of the largest connected component, ascending."""
    state, action = np.nonzero(graph != COLLISION)
    edges = csr_array((np.ones(len(state)), (state, graph[state, action])), shape=(len(graph), len(graph)))
    component = connected_components(edges, directed=False)[1]
    return accepted[component[accepted] == np.bincount(component[accepted]).argmax()]


def _recorded_views(
    simulated: SimulatorScene, database: sqlite3.Connection, kept: Int64[np.ndarray, "kept"]
) -> tuple[UInt8[np.ndarray, "kept height width 3"], list[dict[str, float]]]:
    """Images and shares of visible objects of the kept states."""
    images, visible = None, []
    for state, number in enumerate(kept):
        shape, image, shares = database.execute(
            "SELECT shape, frame, visible FROM state WHERE number = ?", (int(number),)
        ).fetchone()
        if images is None:
            images = np.empty((len(kept), *json.loads(shape)), np.uint8)
        if tuple(json.loads(shape)) != images.shape[1:]:
            raise InputError(f"{simulated.name}: views of {shape} and {list(images.shape[1:])} in one scene.")
        images[state] = np.frombuffer(image, np.uint8).reshape(images.shape[1:])
        visible.append(json.loads(shares))
    assert images is not None
    return images, visible
