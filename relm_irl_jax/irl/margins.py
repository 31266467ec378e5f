"""Margins of the expert's actions as a sparse linear map of the reward (the paper's Eq. 6 and 8).

By Eq. 3, w·V(s) = Σ_t γᵗ r(s_t) along the expert's path from s. The advantage of the expert's action a* over an
action a is therefore a difference of two discounted path sums of the reward,

    w·(V(s'_a*) − V(s'_a)) = Σ_u (visits(s'_a*, u) − visits(s'_a, u)) (r(u) − r(g)),   visits(s, u) = Σ_t γᵗ [s_t = u],

one sparse row for each pair of state and action. The margin of a state is the minimum over its rows.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32, Int64
from scipy.sparse import csr_array

from relm_irl_jax.experts import Expert
from relm_irl_jax.irl.problem import MaxMarginProblem, reward

NEGLIGIBLE = np.finfo(np.float64).eps / 8
"""Discount γᵗ below which the rest of a path is neglected."""


@dataclass(frozen=True)
class MarginRows:
    """The rows of all margins of a problem.

    Attributes:
        coefficients: one row per state and action whose outcome differs from the expert's; its product with
            r(s) − r(g) is the advantage of the expert's action. The target's column is 0.
        margin_index: index into `states` of the state that each row belongs to, ascending.
        states: the states that have a margin, ascending.
    """

    coefficients: csr_array
    margin_index: Int64[np.ndarray, "rows"]
    states: Int32[np.ndarray, "margins"]


def margin_rows(problem: MaxMarginProblem, discount: float, *, include_better: bool = False) -> MarginRows:
    """Compute the rows of a problem's margins.

    Args:
        problem: the problem.
        discount: γ.
        include_better: whether actions better than the expert's also have rows.

    Returns:
        The rows; none if no state of S₀ has a suboptimal action.
    """
    expert = problem.expert
    visited = np.unique(problem.states)
    compared = expert.suboptimal | expert.better if include_better else expert.suboptimal
    position, action = np.nonzero(compared[visited])
    state = visited[position]
    after_expert = _discounted_visits(expert, expert.next_state[state], discount)
    after_other = _discounted_visits(expert, problem.successors[state, action], discount)
    states, margin_index = np.unique(state, return_inverse=True)
    return MarginRows(csr_array(after_expert - after_other), margin_index, states.astype(np.int32))


def margins_under(
    problem: MaxMarginProblem, w: Float64[np.ndarray, "d"], discount: float
) -> tuple[Int32[np.ndarray, "margins"], Float64[np.ndarray, "margins"]]:
    """Margins under given weights.

    Args:
        problem: the problem.
        w: weights.
        discount: γ.

    Returns:
        The states that have a margin, and their margins.
    """
    rows = margin_rows(problem, discount)
    advantages = rows.coefficients @ reward(problem.features, problem.expert.target, w)
    return rows.states, smallest_by_margin(advantages, rows.margin_index, len(rows.states))


def smallest_by_margin(
    advantages: Float64[np.ndarray, "rows"], margin_index: Int64[np.ndarray, "rows"], n_margins: int
) -> Float64[np.ndarray, "margins"]:
    """The smallest advantage among the rows of each margin.

    Args:
        advantages: value of each row.
        margin_index: the margin that each row belongs to.
        n_margins: number of margins.

    Returns:
        The margins.
    """
    margin = np.full(n_margins, np.inf)
    np.minimum.at(margin, margin_index, advantages)
    return margin


def _discounted_visits(expert: Expert, starts: Int32[np.ndarray, "paths"], discount: float) -> csr_array:
    """Discounted visits Σ_t γᵗ [s_t = u] of the expert's path from each start, without those of the target."""
    current, path, weight = starts, np.arange(len(starts)), 1.0
    rows, columns, values = [], [], []
    while len(current) and weight > NEGLIGIBLE:
        stays = expert.next_state[current] == current
        away = current != expert.target
        rows.append(path[away])
        columns.append(current[away])
        values.append(np.where(stays, weight / (1.0 - discount), weight)[away])
        current, path = expert.next_state[current[~stays]], path[~stays]
        weight *= discount
    shape = (len(starts), len(expert.next_state))
    if not rows:
        return csr_array(shape)
    return csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
