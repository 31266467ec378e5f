"""The paper's maximum-margin problem in cvxpy, over w and written as in the paper: a reference for `solver.py`."""

import cvxpy as cp
import numpy as np

from relm_irl_jax.irl.expectations import feature_expectations
from relm_irl_jax.irl.problem import MaxMarginProblem, check_problem, relative_features
from relm_irl_jax.irl.settings import MaxMarginSettings
from relm_irl_jax.irl.solution import Solution, Status, unsolved

_STATUS = {
    cp.OPTIMAL: Status.OPTIMAL,
    cp.OPTIMAL_INACCURATE: Status.INACCURATE,
    cp.INFEASIBLE: Status.INFEASIBLE,
    cp.INFEASIBLE_INACCURATE: Status.INFEASIBLE,
    cp.UNBOUNDED: Status.UNBOUNDED,
    cp.UNBOUNDED_INACCURATE: Status.UNBOUNDED,
}


def reference_max_margin(problem: MaxMarginProblem, settings: MaxMarginSettings | None = None) -> Solution:
    """Solve one maximum-margin problem as the paper states it (Eq. 3, 7 and 8); slow, and meant to be read.

    Args:
        problem: the problem.
        settings: form, regulariser and constants; the defaults if None.

    Returns:
        The solution. Its w is any optimal w, not the one of minimum norm. The share of the linear program and the
        duality gap are not computed.

    Raises:
        InputError: the problem is ill posed.
    """
    settings = settings or MaxMarginSettings()
    check_problem(problem, settings)
    expert, successors = problem.expert, problem.successors
    features = np.asarray(problem.features, np.float64)
    relative = relative_features(features, expert.target)
    value = feature_expectations(relative, expert.next_state, settings.discount)
    compared = expert.suboptimal | (expert.better if settings.penalty > 1.0 else False)
    visited = np.unique(problem.states)

    w = cp.Variable(features.shape[1])
    margins, states = [], []
    for state in visited:
        advantage = value[expert.next_state[state]] - value[successors[state, compared[state]]]
        if len(advantage):
            margins.append(cp.min(advantage @ w))  # Eq. 8: the best suboptimal action.
            states.append(state)
    if not margins:
        return unsolved(problem, Status.NO_DECISION)
    margin = cp.hstack(margins)
    gain = cp.sum(cp.minimum(margin, settings.penalty * margin))
    weight = settings.regularisation * len(visited)
    if settings.form == "cost":
        bounded = relative @ w
        bounds = [bounded <= 0.0, bounded >= -settings.r_max]
    else:
        bounded = features @ w
        bounds = [bounded <= settings.r_max, bounded >= -settings.r_max]  # Eq. 7.
    if settings.variant == "lp-l2":
        gain -= 0.5 * weight * cp.sum_squares(w)
    elif settings.variant == "lp-l1":
        gain -= weight * cp.norm1(bounded)
    program = cp.Problem(cp.Maximize(gain), bounds)
    # A simplex method if possible: for d > |S| the set of optimal w is unbounded, and interior points diverge in it.
    program.solve(solver=cp.CLARABEL if settings.variant == "lp-l2" else cp.HIGHS)
    status = _STATUS.get(program.status, Status.NOT_CONVERGED)
    if w.value is None or margin.value is None:
        return unsolved(problem, status)
    outside = max(float(np.max(constraint.violation())) for constraint in bounds)
    return Solution(
        w=w.value,
        status=status,
        objective=float(np.asarray(program.value)),
        share_of_lp=np.nan,
        duality_gap=np.nan,
        primal_residual=outside / settings.r_max,
        states=np.asarray(states, np.int32),
        margin=margin.value,
        name=problem.name,
    )
