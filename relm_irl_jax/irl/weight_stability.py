"""Changes of w under small changes of the problem, for each form and regulariser of the maximum-margin problem.

Weights that jump between neighbouring starts cannot be predicted from the start by regression. Over single
trajectories, this measures ‖w − w′‖/‖w‖ when the start moves one step along the trajectory, and when every margin row
is scaled by its own factor 1 ± 1e-3.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Real
from scipy.sparse import csr_array, diags_array

from relm_irl_jax.experts import follow_expert, shortest_path_expert
from relm_irl_jax.irl.feature_factorisation import FactorisedFeatures, factorise
from relm_irl_jax.irl.margins import MarginRows, margin_rows
from relm_irl_jax.irl.problem import MaxMarginProblem
from relm_irl_jax.irl.settings import MaxMarginSettings
from relm_irl_jax.irl.solution import Status
from relm_irl_jax.irl.solver import solve_rows
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.scenes.scene import Scene, successors

PERTURBATION = 1e-3
"""Relative change of the margins."""


@dataclass(frozen=True)
class WeightStability:
    """Relative changes of w over trajectories, for one form and regulariser.

    Attributes:
        settings: form and regulariser.
        start_median: median change when the start moves one step.
        start_p90: its 90th percentile.
        margin_median: median change when the margins change by `PERTURBATION`.
        margin_p90: its 90th percentile.
        share_of_lp: median share of the linear program's objective that the solutions reach.
        solved: share of the trajectories for which all problems were solved to optimality.
    """

    settings: MaxMarginSettings
    start_median: float
    start_p90: float
    margin_median: float
    margin_p90: float
    share_of_lp: float
    solved: float


def measure_weight_stability(
    scene: Scene,
    features: Real[np.ndarray, "states d"],
    settings: Sequence[MaxMarginSettings],
    *,
    trajectories: int,
    seed: int,
) -> tuple[WeightStability, ...]:
    """Measure how much w changes, for several forms and regularisers.

    Args:
        scene: the scene.
        features: φ(s) of all its states.
        settings: the forms and regularisers.
        trajectories: number of random pairs of start and target, the same for all settings.
        seed: seed of the pairs and of the changes.

    Returns:
        One row for each of `settings`.
    """
    generator = np.random.default_rng(seed)
    pairs = []
    while len(pairs) < trajectories:
        start, target = generator.integers(scene.n_states, size=2).tolist()
        if scene.shortest_path_distance[start, target] >= 3:
            pairs.append((start, target))
    factors = generator.choice([1.0 - PERTURBATION, 1.0 + PERTURBATION], size=(trajectories, 4 * scene.n_states))
    table = []
    with progress_bar("stability", trajectories * len(settings), "trajectories") as advance:
        for each in settings:
            factorised = factorise(features, each.form)
            changes, shares = [], []
            for (start, target), factor in zip(pairs, factors, strict=True):
                expert = shortest_path_expert(scene, target)
                states = follow_expert(scene, expert, start).states[:-1]
                problem = MaxMarginProblem(features, successors(scene.graph), expert, states)
                shorter = replace(problem, states=states[1:])
                rows = margin_rows(problem, each.discount)
                scaled = csr_array(diags_array(factor[: len(rows.margin_index)]) @ rows.coefficients)
                w, share = _solve(rows, problem, factorised, each)
                from_next, _ = _solve(margin_rows(shorter, each.discount), shorter, factorised, each)
                perturbed, _ = _solve(replace(rows, coefficients=scaled), problem, factorised, each)
                advance(1)
                if w is not None and from_next is not None and perturbed is not None:
                    changes.append([np.linalg.norm(other - w) / np.linalg.norm(w) for other in (from_next, perturbed)])
                    shares.append(share)
            start_changes, margin_changes = np.asarray(changes).T
            table.append(
                WeightStability(
                    settings=each,
                    start_median=float(np.median(start_changes)),
                    start_p90=float(np.percentile(start_changes, 90)),
                    margin_median=float(np.median(margin_changes)),
                    margin_p90=float(np.percentile(margin_changes, 90)),
                    share_of_lp=float(np.median(shares)),
                    solved=len(changes) / trajectories,
                )
            )
    return tuple(table)


def _solve(
    rows: MarginRows, problem: MaxMarginProblem, features: FactorisedFeatures, settings: MaxMarginSettings
) -> tuple[Float64[np.ndarray, "d"] | None, float]:
    """The weights, None unless optimal, and the share of the linear program's objective that they reach."""
    solved = solve_rows(rows, problem, features, settings)
    if solved.solution.status is not Status.OPTIMAL:
        return None, np.nan
    return features.weights(solved.reward[None])[0], solved.solution.share_of_lp
