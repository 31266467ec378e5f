"""Costs to go on the experience graph: what the distance between two views is to say, by each method's own reward.

For a goal g and a cost c_g(s) > 0 of being anywhere else, the least cost to reach g along edges of the graph is

    C(g, g) = 0,   C(s, g) = c_g(s) + min_a C(s'_a, g)

and −C is the optimal undiscounted value under the reward r(s) = −c_g(s). With the hand-made reward a step costs as
much as any other and C counts the steps; a collision costs more, and a shortest way has none. With a learned reward
c_g(s) = −w·(φ(s) − φ(g)).
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.agent.metric.experience import least_costs


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Goals:
    """Views that the agent sets itself as targets, scene by scene, and what each costs; rows are padded at the end.

    Attributes:
        state: goals, as local states of their scene; the training targets come first.
        count: number of goals in each scene.
        trained: number of training targets among them.
        cost: cost of each local state on the way to the goal, in units of the mean one.
    """

    state: Int32[Array, "scenes goals"]
    count: Int32[Array, "scenes"]
    trained: Int32[Array, "scenes"]
    cost: Float32[Array, "scenes goals locals"]


def costs_to_go(
    successor: Int32[Array, "locals 4"], goal: Int32[Array, "goals"], cost: Float32[Array, "goals locals"]
) -> Float32[Array, "locals goals"]:
    """Least cost from every state to every goal.

    Args:
        successor: local state that each action led to, or `UNTRIED`.
        goal: the goals.
        cost: cost of being in each state on the way to each goal, positive.

    Returns:
        C(s, g); infinite where the graph knows no way.
    """
    ends = jnp.arange(cost.shape[1])[:, None] == goal
    return least_costs(successor, jnp.where(ends, 0.0, jnp.inf), cost.T)
