"""Workers over devices: each steps its share of them with its own copy of θ, and gradients are averaged over all.

What a worker sees does not depend on the device that steps it, so one and eight devices compute the same numbers, up
to the order of sums. What every device repeats, the tables of the shared layer, limits the gain from more of them.
"""

from collections.abc import Sequence
from dataclasses import replace

import jax
from jax.sharding import AxisType, NamedSharding, PartitionSpec

from relm_irl_jax.agent.siamese.update import Learner, Setting


def over_devices(
    learner: Learner, setting: Setting, devices: Sequence[jax.Device] | None = None
) -> tuple[Learner, Setting]:
    """Place workers on devices, and everything else on each of them.

    Args:
        learner: the state of training.
        setting: what training looks up.
        devices: devices to use; all where None. As many of them as divide the workers of a head are used.

    Returns:
        Both, placed; compiled functions of them run on all the devices.
    """
    chosen = list(jax.devices() if devices is None else devices)
    batch = setting.lane.first.shape[1]
    count = max(n for n in range(1, len(chosen) + 1) if batch % n == 0)
    mesh = jax.make_mesh((count,), ("workers",), (AxisType.Auto,), devices=chosen[:count])
    shared, everywhere = (NamedSharding(mesh, PartitionSpec(*axes)) for axes in ((None, "workers"), ()))
    return (
        replace(jax.device_put(learner, everywhere), episode=jax.device_put(learner.episode, shared)),
        replace(jax.device_put(setting, everywhere), lane=jax.device_put(setting.lane, shared)),
    )
