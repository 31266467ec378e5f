"""Consistency of a scene's datasets with each other.

Moves and turns agree with `location` and `rotation`, every action can be undone, `shortest_path_distance` agrees with
`graph`, and no pose occurs twice. A scene in which all turns have the opposite direction gets a note only, because
nothing depends on the direction. `load_scene` refuses a scene with a fault; `relm-irl scenes check` lists all faults.
"""

import hashlib
from contextlib import suppress
from pathlib import Path

import numpy as np

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import cache_folder
from relm_irl_jax.scenes.scene import ACTIONS, COLLISION, GRID_STEP, UNREACHABLE, Scene, successors

AHEAD, RIGHT, LEFT, BACK = range(len(ACTIONS))

TOLERANCE = 0.01
"""Metres and degrees by which poses may differ from the grid: simulators add rounding errors."""

ROWS_AT_ONCE = 256
"""Rows of the table of distances that are checked at once."""

VERSION = 1
"""Version of the checks. Increase it if a scene that passed may have a fault now."""


def require_consistent(scene: Scene, path: Path) -> None:
    """Check a scene that was read from a file; the checksum of a scene that passed is kept, and not checked again.

    Args:
        scene: the scene.
        path: its file.

    Raises:
        InputError: the scene has a fault.
    """
    digest = hashlib.sha256(f"{VERSION} {scene.n_states}".encode())
    for array in (scene.location, scene.rotation, scene.graph, scene.shortest_path_distance):
        digest.update(np.ascontiguousarray(array).data)
    passed = cache_folder() / "checked-scenes" / digest.hexdigest()
    if passed.exists():
        return
    faults, _ = check_scene(scene)
    if faults:
        more = f" (and {len(faults) - 1} more: see `relm-irl scenes check {path}`)" if len(faults) > 1 else ""
        raise InputError(f"{path}: {faults[0]}{more}")
    with suppress(OSError):  # without a cache folder, the scene is checked again
        passed.parent.mkdir(parents=True, exist_ok=True)
        passed.touch()


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
    """Distances satisfy Bellman's equation, d(s, g) = 1 + min over a of d(s'_a, g) and d(g, g) = 0.

    Its only solution are the shortest paths: from a finite d(s, g), following the smallest value reaches g in as many
    steps, since it falls by 1 a step and is 0 at g alone. It is checked row by row, in little memory.
    """
    distance, n_states = scene.shortest_path_distance, scene.n_states
    far = np.int32(2**30)
    next_states, wrong, first = successors(scene.graph), 0, None
    for start in range(0, n_states, ROWS_AT_ONCE):
        state = np.arange(start, min(start + ROWS_AT_ONCE, n_states))
        expected = np.full((len(state), n_states), far, np.int32)
        for action in range(len(ACTIONS)):
            onward = distance[next_states[state, action]]
            np.minimum(expected, np.where(onward == UNREACHABLE, far, onward + 1), out=expected)
        expected[np.arange(len(state)), state] = 0
        given = np.where(distance[state] == UNREACHABLE, far, distance[state])
        faults = expected != given
        wrong += int(faults.sum())
        if first is None and faults.any():
            row, end = np.argwhere(faults)[0]
            first = int(state[row]), int(end)
    if first is None:
        return []
    return [
        f"dataset `shortest_path_distance` disagrees with `graph` in {wrong} pairs, first from state {first[0]} to "
        f"{first[1]}."
    ]


def _angle(degrees: np.ndarray) -> np.ndarray:
    """Map angles to (−180, 180]."""
    return -((-degrees + 180) % 360 - 180)
