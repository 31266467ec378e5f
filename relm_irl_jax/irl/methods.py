"""The sources of w behind one interface, `learn`."""

from collections.abc import Sequence
from typing import Literal

from pydantic.dataclasses import dataclass as settings_dataclass

from relm_irl_jax.errors import InputError
from relm_irl_jax.irl.apprenticeship import ApprenticeshipSettings, apprenticeship
from relm_irl_jax.irl.maxent import MaxEntSettings, maximum_entropy
from relm_irl_jax.irl.planning import PlanningSettings, maximum_margin_planning
from relm_irl_jax.irl.problem import MaxMarginProblem, MaxMarginSettings, Solution, Status, unsolved
from relm_irl_jax.irl.solver import solve_many
from relm_irl_jax.progress import progress_bar

Method = Literal["max-margin", "apprenticeship", "planning", "maxent"]


@settings_dataclass(frozen=True)
class MethodSettings:
    """Which method of inverse reinforcement learning gives w, and its settings."""

    method: Method = "max-margin"
    """`max-margin` (the paper's), `apprenticeship` (Abbeel and Ng), `planning` (Ratliff) or `maxent`
    (Ziebart)."""
    program: MaxMarginSettings = MaxMarginSettings()
    """The maximum-margin program; its discount and r_max hold for all methods."""
    apprenticeship: ApprenticeshipSettings = ApprenticeshipSettings()
    """Apprenticeship learning."""
    planning: PlanningSettings = PlanningSettings()
    """Maximum-margin planning."""
    maxent: MaxEntSettings = MaxEntSettings()
    """Maximum-entropy IRL."""


def learn(
    problems: Sequence[MaxMarginProblem],
    settings: MethodSettings | None = None,
    processes: int | None = None,
    description: str = "inverse RL",
) -> tuple[Solution, ...]:
    """Learn weights for many problems by the method of one's choice.

    Args:
        problems: the problems; those of one scene should share their arrays.
        settings: the method; the maximum-margin program where None.
        processes: solver processes of the maximum-margin program, the other methods use this one.
        description: the progress bar's text.

    Returns:
        One solution per problem. One that cannot be stated or solved has a named status and a message.
    """
    settings = settings or MethodSettings()
    if settings.method == "max-margin":
        return solve_many(problems, settings.program, processes, description)
    solutions = []
    with progress_bar(description, len(problems), "problems") as advance:
        for problem in problems:
            solutions.append(_learn_one(problem, settings))
            advance(1)
    return tuple(solutions)


def _learn_one(problem: MaxMarginProblem, settings: MethodSettings) -> Solution:
    discount, r_max = settings.program.discount, settings.program.r_max
    try:
        if settings.method == "apprenticeship":
            return apprenticeship(problem, settings.apprenticeship, discount, r_max)
        if settings.method == "planning":
            return maximum_margin_planning(problem, settings.planning, discount, r_max)
        return maximum_entropy(problem, settings.maxent, discount, r_max)
    except InputError as error:
        return unsolved(problem, Status.INVALID, str(error))
