"""Consistency checks of scenes.

`load_scene` refuses datasets with a wrong shape or range. The checks here compare datasets with each other: moves and
turns agree with `location` and `rotation`, every action can be undone, `shortest_path_distance` agrees with `graph`,
and no pose occurs twice. A scene in which all turns have the opposite direction gets a note only, because nothing
depends on the direction.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich import box
from rich.table import Table

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.scene import ACTIONS, COLLISION, GRID_STEP, UNREACHABLE, Scene, shortest_path_distances
from relm_irl_jax.scenes.scene_file import load_scene

AHEAD, RIGHT, LEFT, BACK = range(len(ACTIONS))

TOLERANCE = 0.01
"""Metres and degrees by which poses may differ from the grid: simulators add rounding errors."""


@dataclass(frozen=True)
class SceneCheck:
    """Result of the checks of one file.

    Attributes:
        path: the file.
        scene: the scene without its views; None if the file could not be read.
        image_size: rows and columns of the views; None if the file could not be read.
        faults: errors that make the scene unusable for training, one sentence each; empty for a valid scene.
        notes: unusual properties that do not matter.
    """

    path: Path
    scene: Scene | None
    image_size: tuple[int, int] | None
    faults: tuple[str, ...]
    notes: tuple[str, ...]


def check_files(paths: Sequence[Path]) -> tuple[SceneCheck, ...]:
    """Check scene files; one that cannot be read does not stop the others.

    Args:
        paths: the files.

    Returns:
        One result for each file.
    """
    checked = []
    for path in paths:
        try:
            scene = load_scene(path)
        except InputError as error:
            checked.append(SceneCheck(path, None, None, (str(error),), ()))
            continue
        faults, notes = check_scene(scene)
        rows, columns = scene.views.shape[1:3]
        named = tuple(f"{path}: {fault}" for fault in faults)
        checked.append(SceneCheck(path, scene.without_views(), (rows, columns), named, notes))
    return tuple(checked)


def check_scene(scene: Scene) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Check one scene.

    Args:
        scene: the scene.

    Returns:
        Faults, each naming its dataset, and notes.
    """
    turn_faults, notes = _check_turns(scene)
    faults = (
        *_check_poses(scene),
        *turn_faults,
        *_check_moves(scene),
        *_check_inverse_actions(scene),
        *_check_distances(scene),
    )
    return faults, notes


def _check_poses(scene: Scene) -> list[str]:
    """Headings are multiples of 90 degrees, and no pose occurs twice."""
    faults = []
    off = np.abs(scene.rotation - 90 * np.round(scene.rotation / 90))
    if off.max() > TOLERANCE:
        state = int(off.argmax())
        faults.append(
            f"dataset `rotation` has {scene.rotation[state]:g} at state {state}; headings are 0, 90, 180, 270."
        )
    poses = np.column_stack([np.round(scene.location / TOLERANCE), np.round(scene.rotation) % 360])
    _, first, counts = np.unique(poses, axis=0, return_index=True, return_counts=True)
    if (counts > 1).any():
        state = int(first[counts > 1].min())
        duplicates = int((counts > 1).sum())
        faults.append(f"datasets `location` and `rotation` have {duplicates} duplicate poses, first at state {state}.")
    return faults


def _check_turns(scene: Scene) -> tuple[list[str], tuple[str, ...]]:
    """Turns keep the position and change the heading by 90 degrees, RotateRight always in the same direction."""
    faults, signs = [], []
    for action, sign in ((RIGHT, 1), (LEFT, -1)):
        state = np.flatnonzero(scene.graph[:, action] != COLLISION)
        next_state = scene.graph[state, action]
        moved = np.abs(scene.location[next_state] - scene.location[state]).max(1) > TOLERANCE
        if moved.any():
            faults.append(f"dataset `graph`: {ACTIONS[action]} from state {state[moved][0]} changes the position.")
        change = sign * _angle(scene.rotation[next_state] - scene.rotation[state])
        odd = np.abs(np.abs(change) - 90) > TOLERANCE
        if odd.any():
            faults.append(f"dataset `graph`: {ACTIONS[action]} from state {state[odd][0]} does not turn by 90 degrees.")
        signs.append(np.sign(change[~odd]))
    directions = np.concatenate(signs)
    if (directions > 0).any() and (directions < 0).any():
        faults.append("dataset `graph`: turns have different directions.")
    return faults, ("turns have the opposite direction",) if len(directions) and (directions < 0).all() else ()


def _check_moves(scene: Scene) -> list[str]:
    """Moves keep the heading, and change the position by one grid step along the heading or against it."""
    radians = np.deg2rad(scene.rotation)
    heading = np.column_stack([np.sin(radians), np.cos(radians)])
    faults = []
    for action, sign in ((AHEAD, 1.0), (BACK, -1.0)):
        state = np.flatnonzero(scene.graph[:, action] != COLLISION)
        next_state = scene.graph[state, action]
        turned = np.abs(_angle(scene.rotation[next_state] - scene.rotation[state])) > TOLERANCE
        if turned.any():
            faults.append(f"dataset `graph`: {ACTIONS[action]} from state {state[turned][0]} changes the heading.")
        step = scene.location[next_state] - scene.location[state]
        off_target = np.abs(step - sign * GRID_STEP * heading[state]).max(1) > TOLERANCE
        if off_target.any():
            faults.append(
                f"dataset `graph`: {ACTIONS[action]} does not move by {GRID_STEP} m along the heading in "
                f"{int(off_target.sum())} states, first from state {state[off_target][0]}."
            )
    return faults


def _check_inverse_actions(scene: Scene) -> list[str]:
    """Each action is undone by its opposite."""
    faults = []
    for action, opposite in ((AHEAD, BACK), (BACK, AHEAD), (RIGHT, LEFT), (LEFT, RIGHT)):
        state = np.flatnonzero(scene.graph[:, action] != COLLISION)
        stuck = scene.graph[scene.graph[state, action], opposite] != state
        if stuck.any():
            faults.append(
                f"dataset `graph`: {ACTIONS[opposite]} does not undo {ACTIONS[action]} from state {state[stuck][0]}."
            )
    return faults


def _check_distances(scene: Scene) -> list[str]:
    """Distances are those of a breadth-first search on the graph."""
    wrong = scene.shortest_path_distance != shortest_path_distances(scene.graph)
    if not wrong.any():
        return []
    start, end = np.argwhere(wrong)[0]
    return [
        f"dataset `shortest_path_distance` disagrees with `graph` in {int(wrong.sum())} pairs, first from state "
        f"{start} to {end}."
    ]


def _angle(degrees: np.ndarray) -> np.ndarray:
    """Map angles to (−180, 180]."""
    return -((-degrees + 180) % 360 - 180)


def check_table(checked: Sequence[SceneCheck]) -> Table:
    """Format results as a table, one row for each file.

    Args:
        checked: results of `check_files`.

    Returns:
        The table.
    """
    table = Table(
        title="Scene files",
        caption="unreached: states that no other state can reach; longest: longest of all shortest paths",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for heading in ("file", "type", "states", "unreached", "longest", "views", "features", "labels", "verdict"):
        numeric = heading in ("states", "unreached", "longest")
        table.add_column(heading, justify="right" if numeric else "left", no_wrap=heading != "verdict")
    for result in checked:
        scene = result.scene
        if scene is None or result.image_size is None:
            table.add_row(result.path.name, *[""] * 7, "cannot be read")
            continue
        n_faults = len(result.faults)
        verdict = {0: "valid", 1: "1 fault"}.get(n_faults, f"{n_faults} faults")
        distance = scene.shortest_path_distance
        table.add_row(
            result.path.stem,
            scene.room_type,
            f"{scene.n_states}",
            f"{scene.n_states - len(scene.reachable)}",
            f"{int(distance[distance != UNREACHABLE].max())}",
            "×".join(map(str, result.image_size)),
            "no" if scene.features is None else "yes",
            "no" if scene.visible_object is None else f"{len(scene.categories)}",
            "; ".join((verdict, *result.notes)),
        )
    return table
