"""How every benchmark measures time: the first call apart, then the median and the worst of ten, on a named machine."""

import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np

REPEATS = 10
"""Timed calls after the first."""


@dataclass(frozen=True)
class Timing:
    """Times of repeated calls, in seconds.

    Attributes:
        first: of the first call, compilation included.
        median: of the calls after it.
        worst: of the calls after it.
        repeats: number of the calls after it.
    """

    first: float
    median: float
    worst: float
    repeats: int


def time_calls(call: Callable[[], Any], repeats: int = REPEATS) -> Timing:
    """Time calls of a function, until the arrays that it returns are computed.

    Args:
        call: the function.
        repeats: number of timed calls after the first.

    Returns:
        The times.
    """
    seconds = []
    for _ in range(1 + repeats):
        start = time.perf_counter()
        jax.block_until_ready(call())
        seconds.append(time.perf_counter() - start)
    first, *rest = seconds
    return Timing(first, float(np.median(rest)), max(rest), repeats)


def describe_machine() -> str:
    """What a time depends on, as one line.

    Returns:
        Processor, cores available, their current load, and JAX's version and device.
    """
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if "model name" in line]
        cpu = names[0] if names else cpu
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    device = jax.devices()[0]
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{cpu}, {cores} cores{load}; JAX {jax.__version__} on {device.device_kind}"
