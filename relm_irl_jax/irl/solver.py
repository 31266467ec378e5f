"""Solve one maximum-margin problem with a fast solver and a certificate of optimality.

The features are factorised (`feature_factorisation.py`), the margins become sparse rows (`margins.py`), a convex
program over the reward is solved (`convex_program.py`), and w is the vector of minimum norm that gives this reward.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from relm_irl_jax.irl.clarabel_solver import solve_with_clarabel
from relm_irl_jax.irl.convex_program import ConvexProgram, DualVariables, convex_program
from relm_irl_jax.irl.feature_factorisation import FactorisedFeatures, factorise
from relm_irl_jax.irl.interior_point import solve_by_interior_point
from relm_irl_jax.irl.margins import MarginRows, margin_rows
from relm_irl_jax.irl.problem import MaxMarginProblem, check_problem
from relm_irl_jax.irl.row_generation import solve_by_row_generation, suits
from relm_irl_jax.irl.settings import MaxMarginSettings
from relm_irl_jax.irl.solution import Solution, Status, unsolved

OPTIMAL_TOLERANCE, INACCURATE_TOLERANCE = 1e-6, 1e-3
"""Relative gap and bound violation up to which a solution counts as optimal, and as inaccurate."""


def max_margin(problem: MaxMarginProblem, settings: MaxMarginSettings | None = None) -> Solution:
    """Solve one maximum-margin problem.

    Args:
        problem: the problem.
        settings: form, regulariser and constants; the defaults if None.

    Returns:
        The solution with its certificate. Its status is not optimal if there is no optimum.

    Raises:
        InputError: the problem is ill posed.
    """
    settings = settings or MaxMarginSettings()
    check_problem(problem, settings)
    features = factorise(problem.features, settings.form)
    return add_weights([solve_for_reward(problem, features, settings)], [problem], features, settings)[0]


@dataclass(frozen=True)
class ProgramSolution:
    """A point of a convex program, with a status derived from the certificate, not from the solver's report.

    Attributes:
        status: optimal or inaccurate if gap and violation are within the tolerances; otherwise the solver's status.
        point: c.
        objective: the objective at c.
        duality_gap: (certified bound − objective) / max(1, |objective|).
        bound_violation: largest violation of the reward's bounds, relative to the largest bound.
    """

    status: Status
    point: Float64[np.ndarray, "rank"]
    objective: float
    duality_gap: float
    bound_violation: float


@dataclass(frozen=True)
class RewardSolution:
    """The solution of a problem before the weights of its reward are known.

    Attributes:
        reward: the reward of every state; 0 if the problem was not solved.
        solution: the solution; if it is solved, its w and primal residual are still missing.
    """

    reward: Float64[np.ndarray, "states"]
    solution: Solution


def solve_program(program: ConvexProgram) -> ProgramSolution:
    """Solve a program by the faster method, and by Clarabel if that does not give an optimum.

    Sparse programs, and those whose penalty |r| has its kink inside the bounds, go to Clarabel. All others go to
    `solve_by_interior_point`, which is 5 to 20 times as fast on dense programs, those of many states by row generation.

    Args:
        program: the program.

    Returns:
        The solution; if neither method reaches an optimum, the better one of the two.
    """
    sparse = program.basis is None and program.quadratic is None
    first = None
    if not sparse and not (program.l1_weight > 0.0 and program.upper.max() > 0.0):
        solve = solve_by_row_generation if suits(program) else solve_by_interior_point
        first = _certify(program, *solve(program), Status.NOT_CONVERGED)
        if first.status is Status.OPTIMAL:
            return first
    status, point, duals = solve_with_clarabel(program)
    second = _certify(program, point, duals, status)
    return first if first and _worst_error(first) < _worst_error(second) else second


def solve_for_reward(
    problem: MaxMarginProblem, features: FactorisedFeatures, settings: MaxMarginSettings
) -> RewardSolution:
    """Solve one well-posed problem for its reward.

    Args:
        problem: the problem; of its features only the shape is read.
        features: the scene's factorised features; `right_vectors` may be None.
        settings: form, regulariser and constants.

    Returns:
        The reward, and the solution without w.
    """
    rows = margin_rows(problem, settings.discount, include_better=settings.penalty > 1.0)
    if not len(rows.states):
        return without_reward(problem, Status.NO_DECISION, "no state of `states` has an action worse than the expert's")
    return solve_rows(rows, problem, features, settings)


def solve_rows(
    rows: MarginRows, problem: MaxMarginProblem, features: FactorisedFeatures, settings: MaxMarginSettings
) -> RewardSolution:
    """Solve a problem whose margin rows are known, for its reward.

    Args:
        rows: at least one margin row.
        problem: the problem; of its features only the shape is read.
        features: the scene's factorised features; `right_vectors` may be None.
        settings: form, regulariser and constants.

    Returns:
        The reward, and the solution without w.
    """
    target = problem.expert.target
    weight = settings.regularisation * len(np.unique(problem.states))
    program = convex_program(rows, features, target, settings, weight)
    optimum = solve_program(program)
    if optimum.status not in (Status.OPTIMAL, Status.INACCURATE):
        return without_reward(problem, optimum.status, f"the solver ended with: {optimum.status}")
    margin = program.margin(optimum.point)
    share = 1.0 if settings.variant == "lp" else np.nan
    if settings.compare_with_lp and settings.variant != "lp":
        lp = solve_program(convex_program(rows, features, target, replace(settings, variant="lp"), 0.0))
        if lp.status is Status.OPTIMAL and lp.objective > 0.0:
            share = program.margin_sum(margin) / lp.objective
    reward = program.reward(optimum.point)
    solution = Solution(
        w=np.full(0, np.nan),
        status=optimum.status,
        objective=optimum.objective,
        share_of_lp=share,
        duality_gap=optimum.duality_gap,
        primal_residual=np.nan,
        states=rows.states,
        margin=margin,
        name=problem.name,
    )
    return RewardSolution(np.insert(reward, target, 0.0) if settings.form == "cost" else reward, solution)


def add_weights(
    solved: Sequence[RewardSolution],
    problems: Sequence[MaxMarginProblem],
    features: FactorisedFeatures,
    settings: MaxMarginSettings,
) -> list[Solution]:
    """Compute the weights of solved rewards of one scene, and how far the rewards are out of bounds.

    Args:
        solved: the rewards.
        problems: their problems.
        features: the scene's factorised features.
        settings: form and r_max.

    Returns:
        The complete solutions.
    """
    weights = features.weights(np.stack([each.reward for each in solved]))
    rewards = features.rewards(weights)
    upper = settings.r_max
    if settings.form == "cost":
        rewards -= rewards[np.arange(len(problems)), [problem.expert.target for problem in problems]][:, None]
        upper = 0.0
    outside = np.maximum(np.max(rewards - upper, axis=1), np.max(-settings.r_max - rewards, axis=1))
    residuals = (outside / settings.r_max).tolist()
    return [
        replace(each.solution, w=w, primal_residual=max(residual, 0.0))
        if each.solution.solved
        else replace(each.solution, w=np.full_like(w, np.nan))
        for w, residual, each in zip(weights, residuals, solved, strict=True)
    ]


def without_reward(problem: MaxMarginProblem, status: Status, message: str) -> RewardSolution:
    """The result for a problem that was not solved.

    Args:
        problem: the problem.
        status: the reason, as a status.
        message: the reason, in words.

    Returns:
        A reward of 0, and a solution with NaN in all numbers.
    """
    return RewardSolution(np.zeros(len(problem.successors)), unsolved(problem, status, message))


def _certify(
    program: ConvexProgram, point: Float64[np.ndarray, "rank"], duals: DualVariables, reported: Status
) -> ProgramSolution:
    """Assess a solver's result by its certificate; if that fails, keep the solver's status unless it is a success."""
    objective, violation = program.objective(point), program.bound_violation(point)
    gap = (program.dual_bound(point, duals) - objective) / max(1.0, abs(objective))
    worst, status = max(abs(gap), violation), reported
    if worst <= INACCURATE_TOLERANCE and reported not in (Status.INFEASIBLE, Status.UNBOUNDED):
        status = Status.OPTIMAL if worst <= OPTIMAL_TOLERANCE else Status.INACCURATE
    elif reported in (Status.OPTIMAL, Status.INACCURATE):
        status = Status.NOT_CONVERGED
    return ProgramSolution(status, point, objective, gap, violation)


def _worst_error(solution: ProgramSolution) -> float:
    return max(solution.duality_gap, solution.bound_violation)
