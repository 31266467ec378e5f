"""Many problems side by side: the same solutions everywhere, and nothing lost or left behind when a worker breaks."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace
from pathlib import Path

import joblib
import numpy as np
import pytest
from threadpoolctl import threadpool_info

from relm_irl_jax.irl import Status, max_margin, parallel, solve_many
from relm_irl_jax.irl.worker import one_blas_thread_outside

from .problems import pooled_problem, ring, smooth_features

SCENE = ring()
FEATURES = smooth_features(SCENE, 6, seed=0)
PROBLEMS = [pooled_problem(SCENE, FEATURES, target, [0, 17]) for target in (3, 7, 12, 19, 30)]


@pytest.fixture(scope="module")
def alone():
    return [max_margin(problem) for problem in PROBLEMS]


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    monkeypatch.setattr(parallel, "CHUNK", 2)


def assert_same(solutions, alone):
    for solution, expected in zip(solutions, alone, strict=True):
        assert solution.status is Status.OPTIMAL
        assert solution.name == expected.name
        np.testing.assert_allclose(solution.w, expected.w, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("processes", [1, 2])
def test_many_problems_equal_each_alone_and_failures_are_kept_apart(alone, processes):
    broken = replace(PROBLEMS[0], features=np.full_like(FEATURES, np.nan), name="broken")
    nothing = replace(PROBLEMS[0], states=np.asarray([PROBLEMS[0].expert.target], np.int32), name="nothing")
    solutions = solve_many([PROBLEMS[0], broken, *PROBLEMS[1:3], nothing, *PROBLEMS[3:]], processes=processes)
    assert_same([*solutions[:1], *solutions[2:4], *solutions[5:]], alone)
    assert [solutions[1].status, solutions[4].status] == [Status.INVALID, Status.NO_DECISION]
    assert np.isnan(solutions[1].w).all()
    assert solutions[1].w.shape == solutions[4].w.shape == (6,)
    assert "finite" in solutions[1].message


def in_workers(expression):
    """Evaluate an expression in the workers that `solve_many` has started and joblib keeps."""
    same = {"initializer": parallel.end_with_parent, "initargs": (os.getpid(),)}
    return joblib.Parallel(2, batch_size=1, **same)([joblib.delayed(eval)(expression)] * 4)


def test_workers_import_neither_jax_nor_cvxpy_nor_this_module():
    solve_many(PROBLEMS, processes=2)
    loaded = f"[m for m in ('relm_irl_jax.irl.solver', 'jax', 'cvxpy', {__name__!r}) if m in __import__('sys').modules]"
    assert in_workers(loaded) == [["relm_irl_jax.irl.solver"]] * 4
    assert os.getpid() not in in_workers("__import__('os').getpid()")


def test_one_process_starts_no_other(monkeypatch):
    monkeypatch.setattr(joblib, "Parallel", None)
    solve_many(PROBLEMS[:1], processes=2)
    solve_many(PROBLEMS, processes=1)
    with joblib.parallel_config(n_jobs=1):
        solve_many(PROBLEMS)


def test_blas_has_one_thread_outside_the_sending_process():
    def threads():
        return {library["num_threads"] for library in threadpool_info()}

    here = threads()
    with one_blas_thread_outside(os.getpid() + 1):
        assert threads() == {1}
    with one_blas_thread_outside(os.getpid()):
        assert threads() == here


class Bomb(str):
    """Ends the process that receives it."""

    def __reduce__(self):
        return os._exit, (1,)


def test_a_problem_that_breaks_its_worker_fails_alone(alone):
    bomb = replace(PROBLEMS[0], name=Bomb("bomb"))
    solutions = solve_many([*PROBLEMS[:2], bomb, *PROBLEMS[2:]], processes=2)
    assert_same([*solutions[:2], *solutions[3:]], alone)
    assert solutions[2].status is Status.FAILED
    assert "the solver process crashed" in solutions[2].message


def test_dask_s_workers_find_the_same_solutions(alone):
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "processes": True, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        with joblib.parallel_config(backend="dask"):
            solutions = solve_many(PROBLEMS)
        loaded = client.run(lambda: ["relm_irl_jax.irl.solver" in sys.modules, "jax" in sys.modules])
    assert_same(solutions, alone)
    assert [True, False] in loaded.values()
    assert not any(jax for _, jax in loaded.values())


SCRIPT = textwrap.dedent("""
    import signal
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's background jobs ignore
    from tests.irl.problems import pooled_problem, ring, smooth_features
    from relm_irl_jax.irl import solve_many
    scene = ring()
    problem = pooled_problem(scene, smooth_features(scene, 6, 0), 7, [0, 17])
    solve_many([problem] * 20, processes=2)
    print("workers have started", flush=True)
    solve_many([problem] * 100_000, processes=2)
""")


@pytest.mark.skipif(not os.path.exists("/proc/self/stat"), reason="reads /proc")
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGKILL])
def test_no_process_outlives_its_parent(ending):
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "start_new_session": True}
    with subprocess.Popen([sys.executable, "-c", SCRIPT], **pipes) as parent:
        try:
            assert parent.stdout.readline()
            children = children_of(parent.pid)
            assert len(children) >= 2
            # As in a terminal, an interruption reaches the workers, too. A kill reaches the parent alone.
            (os.killpg if ending is signal.SIGINT else os.kill)(parent.pid, ending)
            assert parent.wait(60) == -ending
            wait_until(lambda: not any(map(alive, children)))
        finally:
            parent.kill()


def wait_until(done):
    deadline = time.monotonic() + 60
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def children_of(number):
    lists = [path.read_text() for path in Path(f"/proc/{number}/task").glob("*/children")]
    return [int(child) for children in lists for child in children.split()]


def alive(number):
    """Whether a process runs; one that has ended and is not yet collected does not."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
