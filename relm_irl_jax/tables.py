"""Scenes and targets as NumPy tables, in which the environment is a matter of looking up.

The states of all scenes are numbered consecutively, scene by scene, so that one integer identifies a state of any
scene. `relm_irl_jax.world` holds the same tables as JAX arrays.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.scene import UNREACHABLE, Scene, successors
from relm_irl_jax.tasks import Target


@dataclass(frozen=True, eq=False)
class TargetTables:
    """Targets of episodes, in the order of their scenes; see `relm_irl_jax.world.Targets` for the fields.

    Attributes:
        state: the target's state in the world.
        scene: number of the target's scene.
        start: states that can reach the target, without the target itself; rows are padded at the end.
        n_starts: number of valid entries in each row of `start`.
        distance: smallest number of actions to the target from each local state of its scene; -1 if there is no path,
            and in the padding.
    """

    state: Int32[np.ndarray, "targets"]
    scene: Int32[np.ndarray, "targets"]
    start: Int32[np.ndarray, "targets starts"]
    n_starts: Int32[np.ndarray, "targets"]
    distance: Int32[np.ndarray, "targets locals"]


def scene_offsets(scenes: Sequence[Scene]) -> list[int]:
    """World number of each scene's first state.

    Args:
        scenes: the scenes in the order of the world.

    Returns:
        One offset for each scene.
    """
    return [int(offset) for offset in np.cumsum([0, *(scene.n_states for scene in scenes)])[:-1]]


def successor_table(scenes: Sequence[Scene]) -> Int32[np.ndarray, "states 4"]:
    """Next state in the world for each state and action; a collision leads back to the state.

    Args:
        scenes: the scenes in the order of the world.

    Returns:
        The table.
    """
    tables = [successors(scene.graph) + offset for scene, offset in zip(scenes, scene_offsets(scenes), strict=True)]
    return np.concatenate(tables).astype(np.int32)


def target_tables(scenes: Sequence[Scene], targets: Sequence[Target]) -> TargetTables:
    """Tabulate starts and distances of targets.

    Args:
        scenes: the scenes of the world, in its order.
        targets: the targets in the order of their scenes; `Target.scene` is an index into `scenes`.

    Returns:
        The tables, one row for each target.

    Raises:
        InputError: no other state of its scene can reach a target.
        ValueError: the targets are not in the order of their scenes.
    """
    offsets = scene_offsets(scenes)
    if any(later.scene < earlier.scene for earlier, later in pairwise(targets)):
        raise ValueError("Targets must come in the order of their scenes.")
    longest = max(scene.n_states for scene in scenes)
    start = np.zeros((len(targets), longest), np.int32)
    distance = np.full((len(targets), longest), UNREACHABLE, np.int32)
    n_starts = np.zeros(len(targets), np.int32)
    for row, target in enumerate(targets):
        scene = scenes[target.scene]
        to_target = scene.shortest_path_distance[:, target.state]
        reachable = np.flatnonzero(to_target > 0)
        if len(reachable) == 0:
            raise InputError(f"{scene.name}: no state can reach target {target.state}; choose another target.")
        start[row, : len(reachable)] = reachable + offsets[target.scene]
        n_starts[row] = len(reachable)
        distance[row, : scene.n_states] = to_target
    return TargetTables(
        state=np.asarray([offsets[target.scene] + target.state for target in targets], np.int32),
        scene=np.asarray([target.scene for target in targets], np.int32),
        start=start,
        n_starts=n_starts,
        distance=distance,
    )
