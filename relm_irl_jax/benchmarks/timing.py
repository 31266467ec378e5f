"""Timing of benchmarks: the first call, the median and the worst of the others, and the computer's description."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from relm_irl_jax.hardware import processor_name

REPEATS = 10
"""Timed calls after the first."""


@dataclass(frozen=True)
class Timing:
    """Durations of repeated calls, in seconds.

    Attributes:
        first: duration of the first call, including compilation.
        median: median duration of the other calls.
        worst: longest duration of the other calls.
        repeats: number of the other calls.
    """

    first: float
    median: float
    worst: float
    repeats: int


def time_calls(call: Callable[[], Any], repeats: int = REPEATS) -> Timing:
    """Time calls of a function, including the computation of the returned arrays.

    Args:
        call: the function.
        repeats: number of timed calls after the first.

    Returns:
        The durations.
    """
    seconds = []
    for _ in range(1 + repeats):
        start = time.perf_counter()
        jax.block_until_ready(call())
        seconds.append(time.perf_counter() - start)
    first, *rest = seconds
    return Timing(first, float(np.median(rest)), max(rest), repeats)


def describe_computer() -> str:
    """Describe the computer in one line.

    Returns:
        Processor, available cores, current load, JAX version and device.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    device = jax.devices()[0]
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{processor_name()}, {cores} cores{load}; JAX {jax.__version__} on {device.device_kind}"
