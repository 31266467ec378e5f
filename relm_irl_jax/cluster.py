"""Several processes that train one agent together, on one host or on many.

Every process runs the same command and computes the same up to the training, which their devices share: each steps
its part of the workers, and gradients are averaged over all. Files are the same in every process, so the run folder
may be shared or not.
"""

from typing import Annotated

import jax
from jax.experimental import multihost_utils
from pydantic import Field, NonNegativeInt
from pydantic.dataclasses import dataclass

from relm_irl_jax.errors import InputError


@dataclass(frozen=True)
class ClusterSettings:
    """Where the other processes are."""

    coordinator: str = ""
    """Address and port of process 0, such as 10.0.0.1:1234; empty for a single process."""
    processes: Annotated[int, Field(ge=1)] = 1
    """Number of processes."""
    process: NonNegativeInt = 0
    """Number of this process."""


def join(settings: ClusterSettings) -> None:
    """Meet the other processes; does nothing for a single one. To be called before anything is computed.

    Args:
        settings: where they are.

    Raises:
        InputError: the settings contradict each other, or the others cannot be met.
    """
    if settings.processes == 1 and not settings.coordinator:
        return
    if not settings.coordinator:
        raise InputError("cluster.coordinator: several processes need the address of process 0; give HOST:PORT.")
    if settings.process >= settings.processes:
        raise InputError(f"cluster.process: {settings.process} of {settings.processes} processes does not exist.")
    try:
        jax.distributed.initialize(settings.coordinator, settings.processes, settings.process)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"cluster.coordinator: {settings.coordinator} cannot be met ({error}).") from error
    # Processes connect at their first exchange, and wait half a minute for each other: now, before any one compiles.
    multihost_utils.sync_global_devices("joined")
