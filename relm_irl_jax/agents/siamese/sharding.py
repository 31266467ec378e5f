"""Data parallelism: each device steps a share of the workers with its own copy of θ, and gradients are averaged.

A worker's steps do not depend on its device, so any number of devices, in one process or several, gives the same
results up to the order of sums. The speed-up is limited by computations that every device repeats: the tables of the
shared layer, or the evaluation of all pairs of a state and a target. In each update, devices exchange one gradient of
θ, or the smaller gradient with respect to logits and values of the pairs.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import jax
import numpy as np
from jax.sharding import AxisType, NamedSharding, PartitionSpec

from relm_irl_jax.agents.siamese.update import UpdateInputs
from relm_irl_jax.agents.training import TrainState

Tree = TypeVar("Tree")


def usable_devices(workers: int, devices: Sequence[jax.Device] | None = None) -> list[jax.Device]:
    """The largest number of devices that divides the workers evenly.

    Args:
        workers: workers of a head.
        devices: devices to choose from; those of all processes if None.

    Returns:
        The first devices of the list.
    """
    chosen = list(jax.devices() if devices is None else devices)
    return chosen[: max(n for n in range(1, len(chosen) + 1) if max(workers, 1) % n == 0)]


def shard_workers(
    state: TrainState, inputs: UpdateInputs, devices: Sequence[jax.Device]
) -> tuple[TrainState, UpdateInputs]:
    """Distribute workers over devices, and replicate everything else.

    Args:
        state: the state of training, the same in every process.
        inputs: inputs of the updates, the same in every process.
        devices: devices to use; see `usable_devices`.

    Returns:
        State and inputs as arrays on these devices, on which compiled functions of them run.
    """
    mesh = jax.make_mesh((len(devices),), ("workers",), (AxisType.Auto,), devices=devices)
    sharded, replicated = (NamedSharding(mesh, PartitionSpec(*axes)) for axes in ((None, "workers"), ()))
    workers, target_range = _put_on_devices(state.workers, sharded), _put_on_devices(inputs.task.target_range, sharded)
    inputs = _put_on_devices(inputs, replicated)
    return (
        replace(_put_on_devices(state, replicated), workers=workers),
        replace(inputs, task=replace(inputs.task, target_range=target_range)),
    )


def _put_on_devices(tree: Tree, sharding: NamedSharding) -> Tree:
    """Convert arrays that every process has in full to arrays on the devices of all processes."""
    if jax.process_count() == 1:
        return jax.device_put(tree, sharding)

    def place(array: jax.Array) -> jax.Array:
        if jax.dtypes.issubdtype(array.dtype, jax.dtypes.prng_key):
            return jax.random.wrap_key_data(place(jax.random.key_data(array)))
        whole = np.asarray(array)
        return jax.make_array_from_callback(whole.shape, sharding, lambda index: whole[index])

    return jax.tree.map(place, tree)
