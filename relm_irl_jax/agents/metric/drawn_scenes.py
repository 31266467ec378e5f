"""A few of many scenes, drawn for one update.

The cost of an update grows with the states of the scenes that it learns from. A training in many scenes therefore draws
some of them for each update, and embeds no view of the others, except where a worker is. Scenes keep the padding of the
largest one, since compiled programs have fixed shapes.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int32, PRNGKeyArray

from relm_irl_jax.agents.metric.costs_to_go import SceneStates
from relm_irl_jax.agents.metric.loss import LossInputs


def draw_scenes(key: PRNGKeyArray, inputs: LossInputs, number: int) -> tuple[Int32[Array, "drawn_states"], LossInputs]:
    """Draw different scenes, each with the same probability.

    Args:
        key: source of randomness.
        inputs: goals and costs to go of all scenes.
        number: how many to draw. Static.

    Returns:
        World state of every state of the drawn scenes, with padding, and the inputs of the loss for them, in which a
        state is its row among these.
    """
    scenes = inputs.scenes
    drawn = jax.random.choice(key, len(scenes.count), (number,), replace=False)
    states = scenes.state[drawn]
    rows = jnp.arange(states.size, dtype=jnp.int32).reshape(states.shape)
    goals, costs = jax.tree.map(lambda table: table[drawn], (inputs.goals, inputs.costs))
    return states.reshape(-1), replace(inputs, scenes=SceneStates(rows, scenes.count[drawn]), goals=goals, costs=costs)
