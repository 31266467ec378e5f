"""Maximum-margin planning (Ratliff, Bagnell and Zinkevich, 2006): a quadratic program with loss augmentation.

The expert is to beat every policy by as much as that policy differs from it. With μ the feature expectations
averaged over the starts S₀ and L(π) the discounted number of decisions in which π departs from the expert,

    minimise ½λ‖w‖² + ξ   subject to   w·μ_E ≥ w·μ(π) + L(π) − ξ  for every policy π.

The policies are exponentially many, but max over π of w·μ(π) + L(π) is itself a linear program, the one of
the optimal value under the reward w·ψ(s) plus 1 for each departure. Its dual, least values v that no action
improves, makes one compact program of both:

    minimise ½λ‖w‖² + E[v(s₀)] − w·μ_E   subject to   v(s) ≥ r(s) + l(s, a) + γ v(s'),  r = Ψw,  v(g) = 0.
"""

import numpy as np
from pydantic import PositiveFloat
from pydantic.dataclasses import dataclass as settings_dataclass
from scipy.sparse import block_array, coo_array, csc_array, csr_array, diags_array, eye_array

from relm_irl_jax.irl.conic import minimise
from relm_irl_jax.irl.control import bounded_solution, deviations
from relm_irl_jax.irl.expectations import feature_expectations
from relm_irl_jax.irl.problem import MaxMarginProblem, Solution, Status, check_problem, relative_features, unsolved


@settings_dataclass(frozen=True)
class PlanningSettings:
    """How maximum-margin planning weighs its regulariser."""

    regularisation: PositiveFloat = 1e-4
    """λ."""


def maximum_margin_planning(
    problem: MaxMarginProblem,
    settings: PlanningSettings | None = None,
    discount: float = 0.99,
    r_max: float = 1.0,
) -> Solution:
    """Learn weights by maximum-margin planning.

    Args:
        problem: the expert and the starts.
        settings: the regulariser; the defaults where None.
        discount: γ.
        r_max: size of the largest reward.

    Returns:
        The solution. Its gap is the quadratic program's, relative.
    """
    settings = settings or PlanningSettings()
    check_problem(problem)
    target, starts = problem.expert.target, np.unique(problem.states)
    relative = relative_features(problem.features, target)
    n, d = relative.shape
    away = np.delete(np.arange(n), target)
    expert = feature_expectations(relative, problem.expert.next_state, discount)[starts].mean(axis=0)
    # Unknowns w, r and v. Rows: Ψw − r = 0, v(g) = 0, and one for each state away from the target and action.
    state, action = np.repeat(away, 4), np.tile(np.arange(4), len(away))
    row = np.arange(len(state))
    own = csr_array((np.ones(len(row)), (row, state)), shape=(len(row), n))
    next_own = csr_array((np.ones(len(row)), (row, problem.successors[state, action])), shape=(len(row), n))
    at_target = coo_array(([1.0], ([0], [target])), shape=(1, n))
    rows = block_array(
        [
            [csr_array(relative), -eye_array(n), None],
            [None, None, at_target],
            [None, own, discount * next_own - own],
        ]
    )
    loss = deviations(problem)[state, action].astype(np.float64)
    quadratic = diags_array(np.concatenate([np.full(d, settings.regularisation), np.zeros(2 * n)]))
    weight = np.zeros(n)
    weight[starts] = 1.0 / len(starts)
    linear = np.concatenate([-expert, np.zeros(n), weight])
    right = np.concatenate([np.zeros(n + 1), -loss])
    status, point, _, gap = minimise(csc_array(quadratic), linear, csc_array(rows), right, equalities=n + 1)
    if status not in (Status.OPTIMAL, Status.INACCURATE):
        return unsolved(problem, status, f"the solver ended with: {status}")
    return bounded_solution(problem, point[:d], status, discount, r_max, gap)
