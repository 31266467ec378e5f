"""Maximum-margin planning (Ratliff, Bagnell and Zinkevich, 2006): a quadratic program with a loss-augmented margin.

The expert should beat every policy by a margin that grows with how much the policy differs from it. Let μ(π) be the
feature expectations of a policy, averaged over the states S₀, μ_E the expert's, and L(π) the discounted number of
decisions in which π departs from the expert:

    minimise ½λ‖w‖² + ξ   subject to   w·μ_E ≥ w·μ(π) + L(π) − ξ  for every policy π.

There are exponentially many policies, but the maximum over π of w·μ(π) + L(π) is itself a linear program: it is the
optimal value under the reward w·ψ(s) plus 1 for each departure. Its dual minimises values v that no action improves.
Inserting the dual gives one compact program:

    minimise ½λ‖w‖² + E[v(s₀)] − w·μ_E   subject to   v(s) ≥ r(s) + l(s, a) + γ v(s'),  r = Ψw,  v(g) = 0.
"""

import numpy as np
from scipy.sparse import block_array, coo_array, csc_array, csr_array, diags_array, eye_array

from relm_irl_jax.irl.clarabel_solver import minimise_quadratic
from relm_irl_jax.irl.expectations import mean_feature_expectations
from relm_irl_jax.irl.problem import MaxMarginProblem, check_problem, relative_features, start_distribution
from relm_irl_jax.irl.settings import MaxMarginPlanningSettings
from relm_irl_jax.irl.solution import Solution, Status, normalised_solution, unsolved


def max_margin_planning(
    problem: MaxMarginProblem,
    settings: MaxMarginPlanningSettings | None = None,
    *,
    discount: float = 0.99,
    r_max: float = 1.0,
) -> Solution:
    """Learn weights by maximum-margin planning.

    Args:
        problem: the expert and the states S₀.
        settings: the regulariser; the default if None.
        discount: γ.
        r_max: size of the largest reward.

    Returns:
        The solution. Its gap is the quadratic program's relative duality gap.

    Raises:
        InputError: the problem is ill posed.
    """
    settings = settings or MaxMarginPlanningSettings()
    check_problem(problem)
    target, states = problem.expert.target, np.unique(problem.states)
    relative = relative_features(problem.features, target)
    n, d = relative.shape
    away = np.delete(np.arange(n), target)
    expert = mean_feature_expectations(relative, problem.expert.next_state, discount, states)
    # Unknowns: w, r and v. Rows: Ψw − r = 0, v(g) = 0, and one for each action in each state but the target.
    state, action = np.repeat(away, 4), np.tile(np.arange(4), len(away))
    row = np.arange(len(state))
    at_state = csr_array((np.ones(len(row)), (row, state)), shape=(len(row), n))
    at_next = csr_array((np.ones(len(row)), (row, problem.successors[state, action])), shape=(len(row), n))
    at_target = coo_array(([1.0], ([0], [target])), shape=(1, n))
    rows = block_array(
        [
            [csr_array(relative), -eye_array(n), None],
            [None, None, at_target],
            [None, at_state, discount * at_next - at_state],
        ]
    )
    # Actions as good as the expert's do not count as departures.
    loss = (problem.expert.suboptimal | problem.expert.better)[state, action].astype(np.float64)
    quadratic = diags_array(np.concatenate([np.full(d, settings.regularisation), np.zeros(2 * n)]))
    linear = np.concatenate([-expert, np.zeros(n), start_distribution(problem)])
    right_side = np.concatenate([np.zeros(n + 1), -loss])
    status, point, _, gap = minimise_quadratic(
        csc_array(quadratic), linear, csc_array(rows), right_side, equalities=n + 1
    )
    if status not in (Status.OPTIMAL, Status.INACCURATE):
        return unsolved(problem, status, f"the solver ended with: {status}")
    return normalised_solution(problem, point[:d], status, discount=discount, r_max=r_max, gap=gap)
