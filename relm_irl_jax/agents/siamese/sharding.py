"""Workers over devices: each device steps its share of them with its own copy of θ, and gradients are averaged.

What a worker does is independent of the device that steps it, so one and eight devices, of one process or of several,
compute the same numbers up to the order of sums. What every device repeats limits the gain: the tables of the shared
layer, or all pairs of a state and a target where those are evaluated. In each update devices exchange one gradient of
θ, or the smaller gradient with respect to logits and values of the pairs.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import jax
import numpy as np
from jax.sharding import AxisType, NamedSharding, PartitionSpec

from relm_irl_jax.agents.siamese.update import TrainState, UpdateInputs

Tree = TypeVar("Tree")


def usable_devices(workers: int, devices: Sequence[jax.Device] | None = None) -> list[jax.Device]:
    """As many devices as divide the workers evenly.

    Args:
        workers: workers of a head.
        devices: devices to choose from; those of all processes where None.

    Returns:
        The first of them.
    """
    chosen = list(jax.devices() if devices is None else devices)
    return chosen[: max(n for n in range(1, len(chosen) + 1) if max(workers, 1) % n == 0)]


def shard_workers(
    state: TrainState, inputs: UpdateInputs, devices: Sequence[jax.Device]
) -> tuple[TrainState, UpdateInputs]:
    """Distribute workers over devices, and copy everything else to each of them.

    Args:
        state: the state of training, the same in every process.
        inputs: what training looks up, the same in every process.
        devices: devices to use, see `usable_devices`.

    Returns:
        Both, placed; compiled functions of them run on all the devices.
    """
    mesh = jax.make_mesh((len(devices),), ("workers",), (AxisType.Auto,), devices=devices)
    sharded, copied = (NamedSharding(mesh, PartitionSpec(*axes)) for axes in ((None, "workers"), ()))
    workers, target_range = _placed(state.workers, sharded), _placed(inputs.task.target_range, sharded)
    inputs = _placed(inputs, copied)
    return (
        replace(_placed(state, copied), workers=workers),
        replace(inputs, task=replace(inputs.task, target_range=target_range)),
    )


def _placed(tree: Tree, sharding: NamedSharding) -> Tree:
    """Arrays that every process holds whole, as arrays of all processes' devices."""
    if jax.process_count() == 1:
        return jax.device_put(tree, sharding)

    def place(array: jax.Array) -> jax.Array:
        if jax.dtypes.issubdtype(array.dtype, jax.dtypes.prng_key):
            return jax.random.wrap_key_data(place(jax.random.key_data(array)))
        whole = np.asarray(array)
        return jax.make_array_from_callback(whole.shape, sharding, lambda index: whole[index])

    return jax.tree.map(place, tree)
