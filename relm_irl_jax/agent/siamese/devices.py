"""Workers over devices: each steps its share of them with its own copy of θ, and gradients are averaged over all.

What a worker sees does not depend on the device that steps it, so one and eight devices, of one process or of several,
compute the same numbers, up to the order of sums. What every device repeats limits the gain from more of them: the
tables of the shared layer, or all pairs of a state and a target where those are computed. What they exchange in an
update is one gradient of θ, or the gradient in logits and values of the pairs, which is smaller.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import jax
import numpy as np
from jax.sharding import AxisType, NamedSharding, PartitionSpec

from relm_irl_jax.agent.siamese.update import Learner, Setting

Tree = TypeVar("Tree")


def usable(workers: int, devices: Sequence[jax.Device] | None = None) -> list[jax.Device]:
    """As many devices as divide the workers evenly.

    Args:
        workers: workers of a head.
        devices: devices to choose from; those of all processes where None.

    Returns:
        The first of them.
    """
    chosen = list(jax.devices() if devices is None else devices)
    return chosen[: max(n for n in range(1, len(chosen) + 1) if workers % n == 0)]


def over_devices(
    learner: Learner, setting: Setting, devices: Sequence[jax.Device] | None = None
) -> tuple[Learner, Setting]:
    """Place workers on devices, and everything else on each of them.

    Args:
        learner: the state of training, the same in every process.
        setting: what training looks up, the same in every process.
        devices: devices to use, as far as they are `usable`; those of all processes where None.

    Returns:
        Both, placed; compiled functions of them run on all the devices.
    """
    chosen = usable(setting.lane.first.shape[1], devices)
    mesh = jax.make_mesh((len(chosen),), ("workers",), (AxisType.Auto,), devices=chosen)
    shared, everywhere = (NamedSharding(mesh, PartitionSpec(*axes)) for axes in ((None, "workers"), ()))
    episode, lane = _placed(learner.episode, shared), _placed(setting.lane, shared)
    return (
        replace(_placed(learner, everywhere), episode=episode),
        replace(_placed(setting, everywhere), lane=lane),
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
