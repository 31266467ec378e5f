"""Solve many maximum-margin problems in parallel, on the cores of one computer or on a cluster.

Problems are sent in small chunks to joblib's workers, by default processes on this computer. joblib's configuration can
select other workers, for example a Dask cluster:

    client = distributed.Client("scheduler:8786")
    with joblib.parallel_config(backend="dask"):
        solutions = solve_many(problems)

Workers compute rewards, and import neither JAX nor cvxpy. The calling process computes the weights.
"""

import os
import warnings
from collections.abc import Generator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace

import joblib
import numpy as np
from joblib.parallel import LokyBackend, get_active_backend

from relm_irl_jax.errors import InputError
from relm_irl_jax.irl.feature_factorisation import FactorisedFeatures, factorise
from relm_irl_jax.irl.problem import MaxMarginProblem, check_problem
from relm_irl_jax.irl.settings import MaxMarginSettings
from relm_irl_jax.irl.solution import Solution, Status, unsolved
from relm_irl_jax.irl.solver import RewardSolution, add_weights, without_reward
from relm_irl_jax.irl.worker import end_with_parent, solve_each, solve_in_worker
from relm_irl_jax.progress import progress_bar

CHUNK = 8
"""Problems sent to a worker at a time."""


@dataclass(frozen=True)
class _Chunk:
    """Problems of one scene that one worker solves one after another.

    Attributes:
        numbers: the problems' positions among all problems.
        problems: the problems.
        features: the scene's factorised features.
    """

    numbers: Sequence[int]
    problems: Sequence[MaxMarginProblem]
    features: FactorisedFeatures


def solve_many(
    problems: Sequence[MaxMarginProblem],
    settings: MaxMarginSettings | None = None,
    processes: int | None = None,
    description: str = "inverse RL",
) -> tuple[Solution, ...]:
    """Solve many maximum-margin problems in parallel, with a progress bar.

    A problem that is ill posed or cannot be solved gets a solution with a status and a message. It does not affect
    the others, not even if it crashes its worker.

    Args:
        problems: the problems. Those of one scene should share their `features` and `successors` arrays.
        settings: form, regulariser and constants; the defaults if None.
        processes: number of workers; 1 solves in this process. None uses the `n_jobs` of `joblib.parallel_config`, and
            if that is not set, all cores or the whole cluster.
        description: the progress bar's text.

    Returns:
        One solution for each problem, in the same order.
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
    chunks = []
    for numbers in scenes.values():
        try:
            features = factorise(problems[numbers[0]].features, settings.form)
        except InputError as error:
            solutions.update((number, unsolved(problems[number], Status.INVALID, str(error))) for number in numbers)
            continue
        for first in range(0, len(numbers), CHUNK):
            chunk_numbers = numbers[first : first + CHUNK]
            chunks.append(_Chunk(chunk_numbers, [problems[number] for number in chunk_numbers], features))
    workers = _count_workers(processes, len(chunks))
    solve = _solve_here(chunks, settings) if workers == 1 else _solve_in_workers(chunks, settings, workers)
    with progress_bar(description, len(problems), "problems") as advance, closing(solve) as results:
        advance(len(solutions))
        for chunk, solved in results:
            complete = add_weights(solved, chunk.problems, chunk.features, settings)
            solutions.update(zip(chunk.numbers, complete, strict=True))
            advance(len(chunk.numbers))
    return tuple(solutions[number] for number in range(len(problems)))


def _count_workers(processes: int | None, n_chunks: int) -> int:
    """Number of useful workers; raises the exception of joblib's backend if that has no workers."""
    if processes == 1:
        return 1
    backend, configured = get_active_backend()
    return min(backend.effective_n_jobs(processes or configured or -1), max(n_chunks, 1))


def _solve_here(
    chunks: Sequence[_Chunk], settings: MaxMarginSettings
) -> Generator[tuple[_Chunk, list[RewardSolution]]]:
    """Solve chunks in this process."""
    for chunk in chunks:
        yield chunk, solve_each(chunk.problems, chunk.features, settings)


def _solve_in_workers(
    chunks: Sequence[_Chunk], settings: MaxMarginSettings, workers: int
) -> Generator[tuple[_Chunk, list[RewardSolution]]]:
    """Solve chunks in joblib's workers, and yield each when it is done.

    If a worker crashes, all work in progress is lost, and the cause is unknown. The chunks without a result are
    therefore divided and sent again, until a chunk of a single problem crashes, which is then reported as failed.
    """
    options = {}
    if isinstance(get_active_backend()[0], LokyBackend):
        options = {"initializer": end_with_parent, "initargs": (os.getpid(),)}
    groups = [list(chunks)]
    while groups:
        waiting = dict(enumerate(groups.pop()))
        tasks = (_task(number, chunk, settings) for number, chunk in list(waiting.items()))
        parallel = joblib.Parallel(workers, return_as="generator_unordered", batch_size=1, **options)
        try:
            with _closing_quietly(parallel(tasks)) as results:
                for number, solved in results:
                    yield waiting.pop(number), solved
        except Exception as error:
            rest = list(waiting.values())
            if len(rest) == 1 and len(rest[0].numbers) == 1:
                message = f"the solver process crashed: {type(error).__name__}: {error}"
                yield rest[0], [without_reward(rest[0].problems[0], Status.FAILED, message)]
            else:
                groups += _halves(rest)


def _halves(chunks: list[_Chunk]) -> list[list[_Chunk]]:
    """Divide chunks into two groups, or a single chunk into two chunks."""
    if len(chunks) == 1:
        (chunk,) = chunks
        middle = len(chunk.numbers) // 2
        return [
            [replace(chunk, numbers=chunk.numbers[part], problems=chunk.problems[part])]
            for part in (slice(middle), slice(middle, None))
        ]
    middle = len(chunks) // 2
    return [chunks[:middle], chunks[middle:]]


def _task(number: int, chunk: _Chunk, settings: MaxMarginSettings):
    """A chunk as a joblib task, with only the data that a worker needs.

    Arrays that chunks share are separate arguments, so that a cluster recognises them and sends them once.
    """
    return joblib.delayed(solve_in_worker)(
        [replace(problem, features=np.zeros((len(problem.features), 0))) for problem in chunk.problems],
        settings,
        left_vectors=chunk.features.left_vectors,
        singular_values=chunk.features.singular_values,
        full_rank=chunk.features.full_rank,
        number=number,
        parent=os.getpid(),
    )


@contextmanager
def _closing_quietly(results: Generator) -> Generator[Generator]:
    """Close joblib's generator on exit, without its warning about tasks that an interruption cancelled."""
    try:
        yield results
    finally:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            results.close()
