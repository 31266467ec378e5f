"""The fast path: thousands of maximum-margin problems over a process pool, each solution with its
certificate."""

import multiprocessing
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np
from jaxtyping import Float64
from threadpoolctl import threadpool_limits

from relm_irl_jax.errors import InputError
from relm_irl_jax.irl.conic import conic
from relm_irl_jax.irl.coordinates import Coordinates, factorise
from relm_irl_jax.irl.interior_point import interior_point
from relm_irl_jax.irl.problem import (
    MaxMarginProblem,
    MaxMarginSettings,
    Solution,
    Status,
    check_problem,
    margin_rows,
    unsolved,
)
from relm_irl_jax.irl.program import Multipliers, Program, state_program
from relm_irl_jax.progress import progress_bar

EXACT, LOOSE = 1e-6, 1e-3
"""Relative gap and residual up to which a solution counts as optimal, and as inaccurate."""

CHUNK = 8
"""Problems handed to a process at a time."""


def max_margin(problem: MaxMarginProblem, settings: MaxMarginSettings | None = None) -> Solution:
    """Solve one maximum-margin problem.

    Args:
        problem: the problem.
        settings: how it is stated; the defaults where None.

    Returns:
        The solution and its certificate; anything but an optimum is a named status.

    Raises:
        InputError: the problem cannot be stated.
    """
    settings = settings or MaxMarginSettings()
    check_problem(problem, settings)
    coordinates = factorise(problem.features, settings.form)
    return _lift([_solve_reward(problem, coordinates, settings)], [problem], coordinates, settings)[0]


def solve_many(
    problems: Sequence[MaxMarginProblem],
    settings: MaxMarginSettings | None = None,
    processes: int | None = None,
    description: str = "inverse RL",
) -> tuple[Solution, ...]:
    """Solve many maximum-margin problems, in parallel, with a progress bar.

    A problem that cannot be stated or solved gets a solution with a named status and a message; the others
    are kept.

    Args:
        problems: the problems. Those of one scene should share their `features` and `successors` arrays.
        settings: how they are stated; the defaults where None.
        processes: solver processes; 1 solves in this process, None takes one per processor.
        description: the progress bar's text.

    Returns:
        One solution per problem, in their order.
    """
    settings = settings or MaxMarginSettings()
    solutions: dict[int, Solution] = {}
    scenes: dict[int, list[int]] = {}
    for number, problem in enumerate(problems):
        try:
            check_problem(problem, settings)
            scenes.setdefault(id(problem.features), []).append(number)
        except InputError as error:
            solutions[number] = unsolved(problem, Status.INVALID, str(error))
    factorised: dict[int, Coordinates] = {}
    for key, numbers in scenes.items():
        try:
            factorised[key] = factorise(problems[numbers[0]].features, settings.form)
        except InputError as error:
            solutions.update((i, unsolved(problems[i], Status.INVALID, str(error))) for i in numbers)
    chunks = [
        _Chunk(key, tuple(scenes[key][first : first + CHUNK]))
        for key in factorised
        for first in range(0, len(scenes[key]), CHUNK)
    ]
    wanted = min(processes or os.cpu_count() or 1, len(chunks))
    with progress_bar(description, len(problems), "problems") as advance:
        advance(len(solutions))
        for chunk, solved in _solve_chunks(chunks, problems, factorised, settings, wanted):
            own = [problems[number] for number in chunk.numbers]
            lifted = _lift(solved, own, factorised[chunk.scene], settings)
            solutions.update(zip(chunk.numbers, lifted, strict=True))
            advance(len(chunk.numbers))
    return tuple(solutions[number] for number in range(len(problems)))


@dataclass(frozen=True)
class Optimum:
    """A program's solution, judged by its own certificate and not by the solver's word.

    Attributes:
        status: optimal or inaccurate by gap and residual; otherwise what the solver said.
        point: c.
        objective: the objective at c.
        gap: how far the certified bound is above the objective, relative to max(1, |objective|).
        excess: how far the reward is out of bounds, relative to r_max.
    """

    status: Status
    point: Float64[np.ndarray, "rank"]
    objective: float
    gap: float
    excess: float


def optimise(program: Program) -> Optimum:
    """Solve a program by the method that suits it, and by Clarabel where that does not give an optimum.

    Sparse programs are Clarabel's, and those whose |r| has a kink inside the bounds; dense ones are solved by
    `interior_point`, 5 to 20 times as fast there.

    Args:
        program: the program.

    Returns:
        The optimum, or the better of what the two methods found.
    """
    sparse = program.basis is None and program.quadratic is None
    if not sparse and not (program.absolute > 0.0 and program.upper.max() > 0.0):
        found = interior_point(program)
        optimum = _judge(program, *found, Status.NOT_CONVERGED)
        if optimum.status is Status.OPTIMAL:
            return optimum
    else:
        optimum = None
    status, point, multipliers = conic(program)
    second = _judge(program, point, multipliers, status)
    return optimum if optimum and max(optimum.gap, optimum.excess) < max(second.gap, second.excess) else second


def _judge(program: Program, point: Float64[np.ndarray, "rank"], multipliers: Multipliers, claim: Status) -> Optimum:
    """Certify what a solver proposes; its claim stands where there is no certificate."""
    objective, excess = program.objective(point), program.excess(point)
    gap = (program.bound(point, multipliers) - objective) / max(1.0, abs(objective))
    worst, status = max(abs(gap), excess), claim
    if worst <= LOOSE and claim not in (Status.INFEASIBLE, Status.UNBOUNDED):
        status = Status.OPTIMAL if worst <= EXACT else Status.INACCURATE
    elif claim in (Status.OPTIMAL, Status.INACCURATE):
        status = Status.NOT_CONVERGED
    return Optimum(status, point, objective, gap, excess)


@dataclass(frozen=True)
class _Chunk:
    """Problems of one scene, by number, that one process solves in a row."""

    scene: int
    numbers: tuple[int, ...]


_Solved = list[tuple[Float64[np.ndarray, "states"], Solution]]


def _solve_chunks(
    chunks: Sequence[_Chunk],
    problems: Sequence[MaxMarginProblem],
    factorised: dict[int, Coordinates],
    settings: MaxMarginSettings,
    processes: int,
) -> Iterator[tuple[_Chunk, _Solved]]:
    """Solve chunks in any order, in this process or in others."""
    if processes <= 1:
        for chunk in chunks:
            yield chunk, _work([problems[i] for i in chunk.numbers], factorised[chunk.scene], settings)
        return
    with SolverPool(processes) as pool:
        running: dict[Future[_Solved], _Chunk] = {}
        for chunk in chunks:
            own = [_light(problems[number]) for number in chunk.numbers]
            rewards_only = replace(factorised[chunk.scene], right=None)
            running[pool.submit(_work, own, rewards_only, settings)] = chunk
        for future in as_completed(running):
            chunk = running[future]
            try:
                yield chunk, future.result()
            except Exception as error:  # A process that died takes its chunk with it, never the others.
                message = f"the solver process broke: {error}"
                yield chunk, [_none(problems[number], Status.FAILED, message) for number in chunk.numbers]


def _work(problems: Sequence[MaxMarginProblem], coordinates: Coordinates, settings: MaxMarginSettings) -> _Solved:
    """Solve problems of one scene in this process."""
    solved = []
    for problem in problems:
        try:
            solved.append(_solve_reward(problem, coordinates, settings))
        except Exception as error:  # Whatever one problem does, the others are kept.
            solved.append(_none(problem, Status.FAILED, f"{type(error).__name__}: {error}"))
    return solved


def _solve_reward(
    problem: MaxMarginProblem, coordinates: Coordinates, settings: MaxMarginSettings
) -> tuple[Float64[np.ndarray, "states"], Solution]:
    """The reward of one problem, and its solution without w."""
    rows = margin_rows(problem, settings)
    if not len(rows.states):
        return _none(problem, Status.NO_DECISION, "no state asked for has an action worse than the expert's")
    target = problem.expert.target
    weight = settings.regularisation * len(np.unique(problem.states))
    program = state_program(rows, coordinates, target, settings, weight)
    optimum = optimise(program)
    if optimum.status not in (Status.OPTIMAL, Status.INACCURATE):
        return _none(problem, optimum.status, f"the solver ended with: {optimum.status}")
    margin = program.margin(optimum.point)
    share = 1.0 if settings.variant == "lp" else np.nan
    if settings.pure_share and settings.variant != "lp":
        pure = optimise(state_program(rows, coordinates, target, replace(settings, variant="lp"), 0.0))
        if pure.status is Status.OPTIMAL and pure.objective > 0.0:
            share = program.margin_sum(margin) / pure.objective
    solution = Solution(
        w=np.full(0, np.nan),
        status=optimum.status,
        objective=optimum.objective,
        share_of_lp=share,
        duality_gap=optimum.gap,
        primal_residual=np.nan,
        states=rows.states,
        margin=margin,
        name=problem.name,
    )
    reward = program.reward(optimum.point)
    return (np.insert(reward, target, 0.0) if settings.form == "cost" else reward), solution


def _lift(
    solved: _Solved,
    problems: Sequence[MaxMarginProblem],
    coordinates: Coordinates,
    settings: MaxMarginSettings,
) -> list[Solution]:
    """Give solutions their w, and measure how far its reward is out of bounds."""
    weights = coordinates.lift(np.stack([reward for reward, _ in solved]))
    rewards = coordinates.rewards(weights)
    upper = settings.r_max
    if settings.form == "cost":
        rewards -= rewards[np.arange(len(problems)), [problem.expert.target for problem in problems]][:, None]
        upper = 0.0
    outside = np.maximum(np.max(rewards - upper, axis=1), np.max(-settings.r_max - rewards, axis=1))
    return [
        replace(solution, w=w, primal_residual=max(residual, 0.0)) if solution.solved else solution
        for w, residual, (_, solution) in zip(weights, (outside / settings.r_max).tolist(), solved, strict=True)
    ]


def _none(problem: MaxMarginProblem, status: Status, message: str) -> tuple[Float64[np.ndarray, "states"], Solution]:
    """No solution, with a reward for its place in the stack."""
    return np.zeros(len(problem.successors)), unsolved(problem, status, message)


def _light(problem: MaxMarginProblem) -> MaxMarginProblem:
    """The problem without its features' entries, for the way to another process."""
    return replace(problem, features=np.zeros((len(problem.features), 0)))


def _begin_process() -> None:
    """Hold BLAS to one thread, and end with the parent, however that ends.

    This module, and BLAS with it, is loaded by now; libraries loaded later would not be held.
    """
    threadpool_limits(1)
    parent = multiprocessing.parent_process()
    assert parent is not None
    threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()


class SolverPool(ProcessPoolExecutor):
    """Processes with one BLAS thread each that do not import the main module, and JAX with it, again."""

    def __init__(self, processes: int):
        super().__init__(processes, multiprocessing.get_context("spawn"), initializer=_begin_process)

    def submit(self, fn, /, *args, **kwargs):
        """As of any executor. Processes start here, and look at the main module to import it."""
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            sys.modules["__main__"] = main
