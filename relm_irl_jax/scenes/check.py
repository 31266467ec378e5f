"""Everything that training relies on in a scene, checked.

`load_scene` refuses files of the wrong shape; this looks at whether the content makes sense: moves and turns lead where
location and rotation say, every move can be undone, distances are those of a breadth-first search, and no pose occurs
twice. A scene whose turns all go the other way round is reported, not refused: nothing depends on the direction.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich import box
from rich.table import Table

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.dump import load_scene
from relm_irl_jax.scenes.scene import ACTIONS, COLLISION, GRID_STEP, UNREACHABLE, Scene, shortest_path_distances

AHEAD, RIGHT, LEFT, BACK = range(len(ACTIONS))

TOLERANCE = 0.01
"""Metres and degrees by which poses may be off: simulators add rounding noise."""


@dataclass(frozen=True)
class SceneCheck:
    """What was found in one file.

    Attributes:
        path: the file.
        scene: the scene, without its frames; None where it could not be read.
        unreachable: states that no other state can reach.
        faults: what training would trip over, one sentence each; empty for a sound scene.
        notes: what is unusual and harmless.
    """

    path: Path
    scene: Scene | None
    unreachable: int
    faults: tuple[str, ...]
    notes: tuple[str, ...]


def check_files(paths: Sequence[Path]) -> tuple[SceneCheck, ...]:
    """Check scene files; one that cannot be read does not stop the others.

    Args:
        paths: the files.

    Returns:
        One record a file.
    """
    checked = []
    for path in paths:
        try:
            scene = load_scene(path)
        except InputError as error:
            checked.append(SceneCheck(path, None, 0, (str(error),), ()))
            continue
        faults, notes = check_scene(scene)
        unreachable = scene.n_states - len(scene.reachable)
        checked.append(SceneCheck(path, scene, unreachable, tuple(f"{path}: {fault}" for fault in faults), notes))
    return tuple(checked)


def check_scene(scene: Scene) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Check one scene.

    Args:
        scene: the scene.

    Returns:
        Faults, each naming its dataset, and notes.
    """
    turn_faults, notes = _turns(scene)
    return (*_poses(scene), *turn_faults, *_moves(scene), *_undone(scene), *_distances(scene)), notes


def _poses(scene: Scene) -> list[str]:
    faults = []
    off = np.abs(scene.rotation - 90 * np.round(scene.rotation / 90))
    if off.max() > TOLERANCE:
        state = int(off.argmax())
        faults.append(
            f"dataset `rotation` holds {scene.rotation[state]:g} at state {state}; headings are 0, 90, 180, 270."
        )
    poses = np.column_stack([np.round(scene.location / TOLERANCE), np.round(scene.rotation) % 360])
    _, first, counts = np.unique(poses, axis=0, return_index=True, return_counts=True)
    if (counts > 1).any():
        state = int(first[counts > 1].min())
        faults.append(
            f"datasets `location` and `rotation` hold {int((counts > 1).sum())} poses twice, first state {state}."
        )
    return faults


def _turns(scene: Scene) -> tuple[list[str], tuple[str, ...]]:
    """Turns keep the place and change the heading by 90 degrees, all the same way."""
    faults, signs = [], []
    for action, sign in ((RIGHT, 1), (LEFT, -1)):
        state = np.flatnonzero(scene.graph[:, action] != COLLISION)
        onward = scene.graph[state, action]
        moved = np.abs(scene.location[onward] - scene.location[state]).max(1) > TOLERANCE
        if moved.any():
            faults.append(f"dataset `graph`: {ACTIONS[action]} from state {state[moved][0]} leaves its place.")
        change = sign * _angle(scene.rotation[onward] - scene.rotation[state])
        odd = np.abs(np.abs(change) - 90) > TOLERANCE
        if odd.any():
            faults.append(f"dataset `graph`: {ACTIONS[action]} from state {state[odd][0]} is no turn by 90 degrees.")
        signs.append(np.sign(change[~odd]))
    both = np.concatenate(signs)
    if len(both) and (both > 0).any() and (both < 0).any():
        faults.append("dataset `graph`: some turns go one way round and some the other.")
    return faults, ("turns go the other way round",) if len(both) and (both < 0).all() else ()


def _moves(scene: Scene) -> list[str]:
    """Moves keep the heading and go one step along it, or against it."""
    radians = np.deg2rad(scene.rotation)
    heading = np.column_stack([np.sin(radians), np.cos(radians)])
    faults = []
    for action, sign in ((AHEAD, 1.0), (BACK, -1.0)):
        state = np.flatnonzero(scene.graph[:, action] != COLLISION)
        onward = scene.graph[state, action]
        turned = np.abs(_angle(scene.rotation[onward] - scene.rotation[state])) > TOLERANCE
        if turned.any():
            faults.append(f"dataset `graph`: {ACTIONS[action]} from state {state[turned][0]} changes the heading.")
        step = scene.location[onward] - scene.location[state]
        astray = np.abs(step - sign * GRID_STEP * heading[state]).max(1) > TOLERANCE
        if astray.any():
            faults.append(
                f"dataset `graph`: {ACTIONS[action]} leads {int(astray.sum())} times elsewhere than {GRID_STEP} m "
                f"along the heading, first from state {state[astray][0]}."
            )
    return faults


def _undone(scene: Scene) -> list[str]:
    """What one action does, its opposite undoes."""
    faults = []
    for action, opposite in ((AHEAD, BACK), (BACK, AHEAD), (RIGHT, LEFT), (LEFT, RIGHT)):
        state = np.flatnonzero(scene.graph[:, action] != COLLISION)
        stuck = scene.graph[scene.graph[state, action], opposite] != state
        if stuck.any():
            faults.append(
                f"dataset `graph`: {ACTIONS[opposite]} does not undo {ACTIONS[action]} from state {state[stuck][0]}."
            )
    return faults


def _distances(scene: Scene) -> list[str]:
    wrong = scene.shortest_path_distance != shortest_path_distances(scene.graph)
    if not wrong.any():
        return []
    start, end = np.argwhere(wrong)[0]
    return [
        f"dataset `shortest_path_distance` disagrees with `graph` in {int(wrong.sum())} pairs, first from state "
        f"{start} to {end}."
    ]


def _angle(degrees: np.ndarray) -> np.ndarray:
    """Angle in (−180, 180]."""
    return -((-degrees + 180) % 360 - 180)


def check_table(checked: Sequence[SceneCheck]) -> Table:
    """One line a file.

    Args:
        checked: what was found.

    Returns:
        The table, ready to print.
    """
    table = Table(
        title="Scene files",
        caption="unreached: states that no other state reaches; far: the longest path",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for heading in ("file", "type", "states", "unreached", "far", "frames", "features", "labels", "verdict"):
        numeric = heading in ("states", "unreached", "far")
        table.add_column(heading, justify="right" if numeric else "left", no_wrap=heading != "verdict")
    for record in checked:
        verdict = (
            "sound" if not record.faults else f"{len(record.faults)} faults" if len(record.faults) > 1 else "fault"
        )
        if record.scene is None:
            table.add_row(record.path.name, *[""] * 7, "cannot be read")
            continue
        scene = record.scene
        distance = scene.shortest_path_distance
        table.add_row(
            record.path.stem,
            scene.room_type,
            f"{scene.n_states}",
            f"{record.unreachable}",
            f"{int(distance[distance != UNREACHABLE].max())}",
            "×".join(map(str, scene.views.shape[1:3])),
            "no" if scene.features is None else "yes",
            "no" if scene.visible_object is None else f"{len(scene.categories)}",
            "; ".join((verdict, *record.notes)),
        )
    return table
