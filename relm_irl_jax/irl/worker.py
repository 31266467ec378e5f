"""Code that the workers of `parallel.py` run. It imports neither JAX nor cvxpy, so that workers start fast."""

import os
import threading
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager

import numpy as np
from jaxtyping import Float64
from threadpoolctl import threadpool_limits

from relm_irl_jax.irl.feature_factorisation import FactorisedFeatures
from relm_irl_jax.irl.problem import MaxMarginProblem
from relm_irl_jax.irl.settings import MaxMarginSettings
from relm_irl_jax.irl.solution import Status
from relm_irl_jax.irl.solver import RewardSolution, solve_for_reward, without_reward


def solve_in_worker(
    problems: Sequence[MaxMarginProblem],
    settings: MaxMarginSettings,
    *,
    left_vectors: Float64[np.ndarray, "states rank"],
    singular_values: Float64[np.ndarray, "rank"],
    full_rank: bool,
    number: int,
    parent: int,
) -> tuple[int, list[RewardSolution]]:
    """Solve problems of one scene in a worker process.

    Args:
        problems: the problems; of their features only the shape is read.
        settings: form, regulariser and constants.
        left_vectors: see `FactorisedFeatures`.
        singular_values: see `FactorisedFeatures`.
        full_rank: see `FactorisedFeatures`.
        number: number of the chunk, which is returned unchanged.
        parent: process id of the calling process.

    Returns:
        The number, and the reward of each problem.
    """
    with one_blas_thread_outside(parent):
        features = FactorisedFeatures(left_vectors, singular_values, None, full_rank)
        return number, solve_each(problems, features, settings)


def solve_each(
    problems: Sequence[MaxMarginProblem], features: FactorisedFeatures, settings: MaxMarginSettings
) -> list[RewardSolution]:
    """Solve well-posed problems of one scene one after another.

    Args:
        problems: the problems.
        features: the scene's factorised features.
        settings: form, regulariser and constants.

    Returns:
        The reward of each problem; an error in one of them becomes a status.
    """
    solved = []
    for problem in problems:
        try:
            solved.append(solve_for_reward(problem, features, settings))
        except Exception as error:  # One problem's error must not lose the others.
            solved.append(without_reward(problem, Status.FAILED, f"{type(error).__name__}: {error}"))
    return solved


@contextmanager
def one_blas_thread_outside(process: int) -> Generator[None]:
    """Limit BLAS to one thread, except in one process and its threads.

    Args:
        process: id of the process without the limit.
    """
    with threadpool_limits(None if os.getpid() == process else 1):
        yield


def end_with_parent(parent: int) -> None:
    """End this process when its parent has ended for any reason; joblib's workers would wait for more work.

    Args:
        parent: id of the parent process.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
