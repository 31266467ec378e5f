"""From any source to a scene file: every state is visited once, and a record that was cut off goes on where it stopped.

While a scene is recorded, what the engine said lies in a small database beside the scene file, one row a state, written
as soon as the state is done. The scene file appears when all states are, and the database goes.
"""

import hashlib
import json
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Int32, Int64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from relm_irl_jax.errors import InputError
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.scenes.check import TOLERANCE
from relm_irl_jax.scenes.dump import save_scene
from relm_irl_jax.scenes.scene import ACTIONS, COLLISION, GRID_STEP, Scene, shortest_path_distances
from relm_irl_jax.scenes.source import Pose, Source, View, stepped

OPPOSITE = (3, 2, 1, 0)
"""Number of the action that undoes each of `ACTIONS`."""

Key = tuple[int, int, int]
"""A pose on the grid: columns and rows from the first pose, quarter turns."""


@dataclass(frozen=True)
class Recording:
    """A recorded scene and what was left out of it.

    Attributes:
        scene: the scene.
        dropped: poses at which the engine could not stand, or that it moved.
        closed: moves that led elsewhere or could not be undone, and became collisions.
        cut_off: states outside the largest connected part, left out.
    """

    scene: Scene
    dropped: int
    closed: int
    cut_off: int


def record_scene(source: Source, path: Path) -> Recording:
    """Walk a source into a scene file.

    Args:
        source: where to walk.
        path: file to write; beside it lies a database while the record is not complete.

    Returns:
        The scene as written, and counts of what was left out.

    Raises:
        InputError: no state can be used, or views differ in size.
    """
    grid = _Grid(source.poses)
    path.parent.mkdir(parents=True, exist_ok=True)
    side = path.with_name(f".{path.stem}.record")
    with closing(_open(side, source)) as database:
        done = {number for (number,) in database.execute("SELECT number FROM state")}
        with progress_bar(f"recording {source.name}", len(source.poses), "states") as advance:
            advance(len(done))
            for number, pose in enumerate(source.poses):
                if number in done:
                    continue
                with database:
                    database.execute("INSERT INTO state VALUES (?, ?, ?, ?, ?)", (number, *_visit(source, grid, pose)))
                advance(1)
        recording = _assemble(source, grid, database)
    save_scene(recording.scene, path)
    side.unlink()
    return recording


class _Grid:
    """The grid on which a source's poses lie."""

    def __init__(self, poses: Sequence[Pose]):
        if not poses:
            raise InputError("The source gives no pose; start it in another place.")
        self.first = poses[0]
        self.keys = [self.key(pose) for pose in poses]
        if None in self.keys:
            raise ValueError(f"{poses[self.keys.index(None)]} is off the grid of the source's first pose.")
        self.number = {key: number for number, key in enumerate(self.keys)}
        if len(self.number) < len(poses):
            raise ValueError("The source gives a pose twice.")

    def key(self, pose: Pose | None) -> Key | None:
        """Place and heading in whole steps; None off the grid, where engines leave rounding noise or worse."""
        if pose is None or not np.isfinite(pose).all():
            return None
        steps = (pose.x - self.first.x) / GRID_STEP, (pose.z - self.first.z) / GRID_STEP, pose.rotation / 90
        column, row, quarter = (round(step) for step in steps)
        off = (abs(steps[0] - column) * GRID_STEP, abs(steps[1] - row) * GRID_STEP, abs(steps[2] - quarter) * 90)
        return (column, row, quarter % 4) if max(off) <= TOLERANCE else None


def _open(side: Path, source: Source) -> sqlite3.Connection:
    """Open the database of a record; one of another source, or a damaged one, is begun again."""
    poses = hashlib.sha256(repr([tuple(pose) for pose in source.poses]).encode()).hexdigest()
    identity = json.dumps([1, source.name, source.room_type, source.origin, poses])
    for attempt in range(2):
        database = sqlite3.connect(side)
        try:
            # A killed process loses nothing without waiting for the disk; only a power failure could.
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
        side.unlink()
    raise AssertionError("a database that was just begun is of this source")


def _visit(source: Source, grid: _Grid, pose: Pose) -> tuple[str | None, bytes | None, str | None, str]:
    """Look and try all actions at one pose: the columns of its row; no frame where the engine did not stay."""
    view: View | None = source.view(pose)
    if view is None or grid.key(view.pose) != grid.key(pose):
        return None, None, None, "[]"
    if view.frame.dtype != np.uint8 or view.frame.ndim != 3 or view.frame.shape[2] != 3:
        raise ValueError(f"{source.name}: views must be uint8 RGB, not {view.frame.dtype} {view.frame.shape}.")
    # Where an action may lead is known; what remains to be recorded is whether it does.
    moves = [source.move(pose, action) for action in ACTIONS]
    outcome = [
        None if onward is None else grid.key(onward) == grid.key(stepped(pose, action))
        for action, onward in zip(ACTIONS, moves, strict=True)
    ]
    visible = {category: float(share) for category, share in view.visible.items() if share > 0}
    return json.dumps(view.frame.shape), view.frame.tobytes(), json.dumps(visible), json.dumps(outcome)


def _assemble(source: Source, grid: _Grid, database: sqlite3.Connection) -> Recording:
    """Build the scene from all rows."""
    rows = database.execute("SELECT number, moves FROM state WHERE frame IS NOT NULL ORDER BY number").fetchall()
    if not rows:
        raise InputError(f"{source.name}: the engine stays at none of {len(source.poses)} poses; start it elsewhere.")
    graph, closed = _two_way(*_moves(source, grid, rows))
    kept = _largest_part(graph, np.asarray([number for number, _ in rows]))
    renumbered = np.full(len(source.poses) + 1, COLLISION, np.int32)  # the last entry serves collisions
    renumbered[kept] = np.arange(len(kept))
    graph = renumbered[graph[kept]]
    frames, visible = _views(source, database, kept)
    categories = tuple(sorted({category for shares in visible for category in shares}))
    keys = np.asarray([grid.keys[number] for number in kept], np.float64)
    scene = Scene(
        name=source.name,
        room_type=source.room_type,
        location=np.asarray([grid.first.x, grid.first.z]) + GRID_STEP * keys[:, :2],
        rotation=90.0 * keys[:, 2],
        graph=graph,
        shortest_path_distance=shortest_path_distances(graph),
        observation=frames,
        visible_object=np.asarray([[shares.get(c, 0.0) for c in categories] for shares in visible], np.float32)
        if categories
        else None,
        categories=categories,
        source=source.origin,
    )
    return Recording(scene, len(source.poses) - len(rows), closed, len(rows) - len(kept))


def _moves(source: Source, grid: _Grid, rows: list[tuple[int, str]]) -> tuple[Int32[np.ndarray, "states 4"], int]:
    """Graph over all poses, and the number of moves that led elsewhere."""
    graph = np.full((len(source.poses), 4), COLLISION, np.int32)
    stayed = {number for number, _ in rows}
    astray = 0
    for number, moves in rows:
        for action, arrived in enumerate(json.loads(moves)):
            onward = grid.number.get(grid.key(stepped(source.poses[number], ACTIONS[action])))
            if arrived and onward in stayed:
                graph[number, action] = onward
            astray += arrived is False
    return graph, astray


def _two_way(graph: Int32[np.ndarray, "states 4"], astray: int) -> tuple[Int32[np.ndarray, "states 4"], int]:
    """Close moves that the opposite action does not undo: drops, and gaps that open one way."""
    state, action = np.nonzero(graph != COLLISION)
    stuck = graph[graph[state, action], np.asarray(OPPOSITE)[action]] != state
    two_way = graph.copy()
    two_way[state[stuck], action[stuck]] = COLLISION
    return two_way, astray + int(stuck.sum())


def _largest_part(graph: Int32[np.ndarray, "states 4"], stayed: Int64[np.ndarray, "stayed"]) -> np.ndarray:
    """States of the largest connected part, ascending."""
    state, action = np.nonzero(graph != COLLISION)
    edges = csr_array((np.ones(len(state)), (state, graph[state, action])), shape=(len(graph), len(graph)))
    part = connected_components(edges, directed=False)[1]
    return stayed[part[stayed] == np.bincount(part[stayed]).argmax()]


def _views(source: Source, database: sqlite3.Connection, kept: np.ndarray) -> tuple[np.ndarray, list[dict[str, float]]]:
    """Frames and visible objects of the states that are kept."""
    frames, visible = None, []
    for place, number in enumerate(kept):
        shape, frame, shares = database.execute(
            "SELECT shape, frame, visible FROM state WHERE number = ?", (int(number),)
        ).fetchone()
        if frames is None:
            frames = np.empty((len(kept), *json.loads(shape)), np.uint8)
        if tuple(json.loads(shape)) != frames.shape[1:]:
            raise InputError(f"{source.name}: views of {shape} and {list(frames.shape[1:])} in one scene.")
        frames[place] = np.frombuffer(frame, np.uint8).reshape(frames.shape[1:])
        visible.append(json.loads(shares))
    assert frames is not None
    return frames, visible
