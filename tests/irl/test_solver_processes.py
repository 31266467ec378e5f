"""Solver processes: one BLAS thread each, and none of them outlives its parent."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import pytest
from threadpoolctl import threadpool_info

from relm_irl_jax.irl.solver import SolverPool

LINUX = os.path.exists("/proc/self/stat")

PROGRAM = textwrap.dedent("""
    import os, time
    from relm_irl_jax.irl.solver import SolverPool
    pool = SolverPool(2)
    first = [pool.submit(os.getpid) for _ in range(8)]
    print(*{future.result() for future in first}, flush=True)
    time.sleep(600)
""")


def test_blas_has_one_thread():
    with SolverPool(1) as pool:
        threads = [library["num_threads"] for library in pool.submit(threadpool_info).result()]
    assert threads
    assert set(threads) == {1}


@pytest.mark.skipif(not LINUX, reason="reads /proc")
def test_processes_end_with_a_parent_that_is_killed():
    parent = subprocess.Popen([sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    children = [int(number) for number in parent.stdout.readline().split()]
    assert children
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    waited_until = time.monotonic() + 30
    while any(map(alive, children)):
        assert time.monotonic() < waited_until
        time.sleep(0.1)


def alive(number: int) -> bool:
    """Whether a process runs; one that has ended and is not yet collected does not."""
    try:
        with open(f"/proc/{number}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
