"""Values of the states after each step, from which the returns of a rollout are computed."""

from collections.abc import Callable

import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.agents.rollout import Experience


def next_values(
    value: Callable[
        [Int32[Array, "groups batch history"], Int32[Array, "groups batch"]], Float32[Array, "groups batch"]
    ],
    experience: Experience,
) -> Float32[Array, "time groups batch"]:
    """Value of the state after each step, before any reset.

    Within an episode it is the value at the next step. It is computed here for the rollout's last step and for
    truncated steps. Since the cap is at least t_max, each worker is truncated at most once in a rollout.

    Args:
        value: maps last states and targets to values.
        experience: the steps; their `output` is an `Evaluation`.

    Returns:
        The values; arbitrary for steps that reached the target.
    """
    views, values = experience.output.views, experience.output.outputs.value
    next_views = jnp.concatenate([experience.next_state[..., None], views[..., :-1]], -1)
    step = jnp.argmax(experience.truncated, axis=0)[None]
    after_truncation = value(
        jnp.take_along_axis(next_views, step[..., None], 0)[0], jnp.take_along_axis(experience.target, step, 0)[0]
    )
    after_last = value(next_views[-1], experience.target[-1])
    after_others = jnp.where(experience.truncated[:-1], after_truncation, values[1:])
    return jnp.concatenate([after_others, after_last[None]])
