"""All methods of inverse reinforcement learning: one function, `learn_weights`, and one settings class."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Real

from relm_irl_jax.errors import InputError
from relm_irl_jax.irl.apprenticeship import apprenticeship
from relm_irl_jax.irl.max_entropy import max_entropy
from relm_irl_jax.irl.max_margin_planning import max_margin_planning
from relm_irl_jax.irl.parallel import solve_many
from relm_irl_jax.irl.problem import MaxMarginProblem
from relm_irl_jax.irl.settings import IrlMethodSettings
from relm_irl_jax.irl.solution import Solution, Status, normalised_solution, unsolved
from relm_irl_jax.progress import progress_bar

WeightsOf = Callable[[MaxMarginProblem], Real[np.ndarray, "d"]]
"""A user's own source of weights: w for the expert and the features of a problem."""


def learn_weights(
    problems: Sequence[MaxMarginProblem],
    settings: IrlMethodSettings | None = None,
    processes: int | None = None,
    description: str = "inverse RL",
) -> tuple[Solution, ...]:
    """Learn reward weights for many problems by a method of choice.

    Args:
        problems: the problems; those of one scene should share their arrays.
        settings: the method; the maximum-margin method if None.
        processes: workers of the maximum-margin method, see `solve_many`; the other methods run in this process.
        description: the progress bar's text.

    Returns:
        One solution for each problem. If a problem is ill posed or cannot be solved, its status and message say so.
    """
    settings = settings or IrlMethodSettings()
    if settings.method == "max-margin":
        return solve_many(problems, settings.max_margin, processes, description)
    solutions = []
    with progress_bar(description, len(problems), "problems") as advance:
        for problem in problems:
            solutions.append(_learn_one(problem, settings))
            advance(1)
    return tuple(solutions)


def learn_weights_by(
    weights_of: WeightsOf, problems: Sequence[MaxMarginProblem], settings: IrlMethodSettings
) -> tuple[Solution, ...]:
    """Weights from a user's own method of inverse reinforcement learning, or from any other source.

    Args:
        weights_of: returns w for a problem; it is scaled to a largest |reward| of r_max.
        problems: the problems.
        settings: discount and r_max.

    Returns:
        One solution for each problem; its objective is the sum of the margins.

    Raises:
        InputError: the function returns something other than one finite number for each feature.
    """
    solutions = []
    with progress_bar("inverse RL", len(problems), "problems") as advance:
        for problem in problems:
            w, needed = np.asarray(weights_of(problem)), problem.features.shape[1]
            if w.shape != (needed,) or not np.issubdtype(w.dtype, np.number) or not np.isfinite(w).all():
                raise InputError(
                    f"irl: your function must return {needed} finite weights for {problem.name}, one for each feature; "
                    f"it returned an array of shape {w.shape} and type {w.dtype}."
                )
            shared = {"discount": settings.max_margin.discount, "r_max": settings.max_margin.r_max}
            solutions.append(normalised_solution(problem, w.astype(np.float64), Status.OPTIMAL, gap=np.nan, **shared))
            advance(1)
    return tuple(solutions)


def _learn_one(problem: MaxMarginProblem, settings: IrlMethodSettings) -> Solution:
    shared = {"discount": settings.max_margin.discount, "r_max": settings.max_margin.r_max}
    try:
        if settings.method == "apprenticeship":
            return apprenticeship(problem, settings.apprenticeship, **shared)
        if settings.method == "max-margin-planning":
            return max_margin_planning(problem, settings.max_margin_planning, **shared)
        return max_entropy(problem, settings.max_entropy, **shared)
    except InputError as error:
        return unsolved(problem, Status.INVALID, str(error))
