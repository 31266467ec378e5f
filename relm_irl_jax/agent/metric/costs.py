"""Costs to go on the experience graph: what the distance between two views is to say, by each method's own reward.

For a goal g and a cost c_g(s) > 0 of being anywhere else, the least cost to reach g along edges of the graph is

    C(g, g) = 0,   C(s, g) = c_g(s) + min_a C(s'_a, g)

and −C is the optimal undiscounted value under the reward r(s) = −c_g(s). With the hand-made reward a step costs as
much as any other and C counts the steps; a collision costs more, and a shortest way has none. With a learned reward
c_g(s) = −w·(φ(s) − φ(g)).

The way of least cost has a number of steps, too:

    N(g, g) = 0,   N(s, g) = 1 + N(s'_{a*}, g),   a* = argmin_a C(s'_a, g)

Either can be what the learned distance says. The reward decides on the way in both; steps fit a space of distances
better, since a cost that depends on the goal differs from the cost of the way back.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.agent.metric.experience import UNTRIED, least_costs


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


def steps_of_best_ways(
    successor: Int32[Array, "locals 4"], goal: Int32[Array, "goals"], reach: Float32[Array, "locals goals"]
) -> Float32[Array, "locals goals"]:
    """Number of steps of the way of least cost.

    Args:
        successor: local state that each action led to, or `UNTRIED`.
        goal: the goals.
        reach: C, from `costs_to_go`.

    Returns:
        N(s, g); infinite where the graph knows no way.
    """
    behind = jnp.where((successor == UNTRIED)[..., None], jnp.inf, reach[successor])
    following = jnp.take_along_axis(successor, behind.argmin(1), axis=1)
    ends = jnp.arange(len(reach))[:, None] == goal
    column = jnp.arange(len(goal))

    def improve(carry: tuple[Array, Array]) -> tuple[Array, Array]:
        steps, _ = carry
        better = jnp.where(ends, 0.0, jnp.where(jnp.isfinite(reach), 1 + steps[following, column], jnp.inf))
        return better, (better != steps).any()

    # Every step lowers the cost to go, so that no way runs in a circle.
    first = jnp.where(ends, 0.0, jnp.inf)
    return jax.lax.while_loop(lambda carry: carry[1], improve, (first, jnp.bool_(True)))[0]
