"""How far w moves when hardly anything does: the study that decides which variant is the default.

A w that jumps between neighbouring starts cannot be regressed on them. For each variant and form this
measures, over single trajectories, ‖w − w′‖/‖w‖ when the start moves one step along the walk, and when every
margin row is scaled by its own factor 1 ± 1e-3.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Real
from scipy.sparse import csr_array, diags_array

from relm_irl_jax.experts import shortest_path_expert, walk
from relm_irl_jax.irl.coordinates import Coordinates, factorise
from relm_irl_jax.irl.problem import MarginRows, MaxMarginProblem, MaxMarginSettings, Status, margin_rows
from relm_irl_jax.irl.program import state_program
from relm_irl_jax.irl.solver import optimise
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.scenes.scene import Scene, successors

NUDGE = 1e-3
"""Relative change of the margins."""


@dataclass(frozen=True)
class Stability:
    """One row of the study's table, over trajectories.

    Attributes:
        settings: form and variant.
        start_median: median relative movement of w when the start moves one step.
        start_worst: its 90th percentile.
        margin_median: median relative movement of w when the margins move by `NUDGE`.
        margin_worst: its 90th percentile.
        share: median share of the pure program's objective that the variant keeps.
        solved: share of the trajectories that were solved to optimality.
    """

    settings: MaxMarginSettings
    start_median: float
    start_worst: float
    margin_median: float
    margin_worst: float
    share: float
    solved: float


def stability_study(
    scene: Scene,
    features: Real[np.ndarray, "states d"],
    settings: Sequence[MaxMarginSettings],
    trajectories: int,
    seed: int,
) -> tuple[Stability, ...]:
    """Measure how far w moves, for each way to state the problem.

    Args:
        scene: the scene.
        features: φ(s) for all its states.
        settings: the ways.
        trajectories: number of random start and target pairs, the same for every way.
        seed: of the pairs and of the changes.

    Returns:
        One row for each of `settings`.
    """
    generator = np.random.default_rng(seed)
    pairs = []
    while len(pairs) < trajectories:
        start, target = generator.integers(scene.n_states, size=2).tolist()
        if scene.shortest_path_distance[start, target] >= 3:
            pairs.append((start, target))
    nudges = generator.choice([1.0 - NUDGE, 1.0 + NUDGE], size=(trajectories, 4 * scene.n_states))
    table = []
    with progress_bar("stability", trajectories * len(settings), "trajectories") as advance:
        for way in settings:
            coordinates = factorise(features, way.form)
            moves, solved = [], 0
            for (start, target), nudge in zip(pairs, nudges, strict=True):
                expert = shortest_path_expert(scene, target)
                states = walk(scene, expert, start).states[:-1]
                problem = MaxMarginProblem(features, successors(scene.graph), expert, states)
                rows = margin_rows(problem, way)
                shorter = margin_rows(replace(problem, states=states[1:]), way)
                scaled = csr_array(diags_array(nudge[: len(rows.owner)]) @ rows.weights)
                w, share = _weights(rows, coordinates, target, way, len(states))
                from_next, _ = _weights(shorter, coordinates, target, way, len(states) - 1)
                nudged, _ = _weights(replace(rows, weights=scaled), coordinates, target, way, len(states))
                advance(1)
                if w is not None and from_next is not None and nudged is not None:
                    solved += 1
                    length = np.linalg.norm(w)
                    moves.append((np.linalg.norm(from_next - w) / length, np.linalg.norm(nudged - w) / length, share))
            start_moves, margin_moves, shares = np.asarray(moves).T
            table.append(
                Stability(
                    settings=way,
                    start_median=float(np.median(start_moves)),
                    start_worst=float(np.percentile(start_moves, 90)),
                    margin_median=float(np.median(margin_moves)),
                    margin_worst=float(np.percentile(margin_moves, 90)),
                    share=float(np.median(shares)),
                    solved=solved / trajectories,
                )
            )
    return tuple(table)


def _weights(
    rows: MarginRows, coordinates: Coordinates, target: int, settings: MaxMarginSettings, asked: int
) -> tuple[Float64[np.ndarray, "d"] | None, float]:
    """The weights, None unless optimal, and the share of the pure program's objective that they keep."""
    program = state_program(rows, coordinates, target, settings, settings.regularisation * asked)
    pure = optimise(state_program(rows, coordinates, target, replace(settings, variant="lp"), 0.0))
    found = optimise(program)
    if found.status is not Status.OPTIMAL:
        return None, np.nan
    reward = program.reward(found.point)
    full = np.insert(reward, target, 0.0) if settings.form == "cost" else reward
    return coordinates.lift(full[None])[0], program.margin_sum(program.margin(found.point)) / pure.objective
