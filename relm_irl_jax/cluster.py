"""Several processes that train one agent together, on one host or on many.

All processes run the same command and perform the same computations, except for the training, in which each device
steps a part of the workers and gradients are averaged over all devices. All processes write the same files, so they may
share the run folder or not.
"""

from pydantic.dataclasses import dataclass

from relm_irl_jax.bounds import NonNegativeInt, PositiveInt
from relm_irl_jax.errors import InputError


@dataclass(frozen=True)
class ClusterSettings:
    """The processes of a distributed training."""

    coordinator: str = ""
    """Address and port of process 0, such as 10.0.0.1:1234; empty for a single process."""
    processes: PositiveInt = 1
    """Number of processes."""
    process: NonNegativeInt = 0
    """Number of this process."""


def join(settings: ClusterSettings) -> None:
    """Connect to the other processes, if there are any. Must be called before any JAX computation.

    Args:
        settings: the processes.

    Raises:
        InputError: the settings contradict each other, or the connection fails.
    """
    if settings.processes == 1 and not settings.coordinator:
        return
    if not settings.coordinator:
        raise InputError("cluster.coordinator: several processes need the address of process 0; give HOST:PORT.")
    if settings.process >= settings.processes:
        raise InputError(
            f"cluster.process: {settings.process} is out of range; give a number from 0 to {settings.processes - 1}."
        )
    import jax  # here, so that the settings load quickly
    from jax.experimental import multihost_utils

    try:
        jax.distributed.initialize(settings.coordinator, settings.processes, settings.process)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"cluster.coordinator: cannot connect to {settings.coordinator} ({error}).") from error
    # Devices connect at their first exchange, with a timeout of half a minute: do it now, before compilation.
    multihost_utils.sync_global_devices("joined")
