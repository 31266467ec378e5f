"""The experience graph: which action led from which view to which, as far as the workers have tried.

Views are its nodes, transitions met its edges. A view is recognised when it is met again, so a node is as good as the
number of its state; nothing else of the simulator enters. Workers explore while there is something to explore: an
action never tried is tried, else the way is taken, on the graph, to the nearest view where one is left. Only where no
such view can be reached do they follow the policy to their targets.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agent.rollout import Experience
from relm_irl_jax.scenes.scene import ACTIONS

UNTRIED = -1
"""Entry of the graph for an action that was never taken."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ExperienceGraph:
    """Transitions met so far. Where a world is not deterministic, the last outcome stands.

    Attributes:
        successor: state that each action led to, or `UNTRIED`.
        met: states in which a worker has been.
    """

    successor: Int32[Array, "states 4"]
    met: Bool[Array, "states"]


def no_experience(n_states: int) -> ExperienceGraph:
    """The graph before the first step.

    Args:
        n_states: states of the world.

    Returns:
        A graph without edges.
    """
    return ExperienceGraph(jnp.full((n_states, len(ACTIONS)), UNTRIED, jnp.int32), jnp.zeros(n_states, bool))


def record(graph: ExperienceGraph, experience: Experience) -> ExperienceGraph:
    """Add transitions.

    Args:
        graph: transitions met before.
        experience: new ones.

    Returns:
        The larger graph.
    """
    met = graph.met.at[experience.state].set(True).at[experience.next_state].set(True)
    return ExperienceGraph(graph.successor.at[experience.state, experience.action].set(experience.next_state), met)


def coverage(graph: ExperienceGraph, reachable: Bool[Array, "states"]) -> tuple[Float32[Array, ""], Float32[Array, ""]]:
    """How much of the world has been seen.

    Args:
        graph: transitions met.
        reachable: states that can be met at all.

    Returns:
        Share of those states met, and share of their actions tried.
    """
    count = reachable.sum()
    tried = ((graph.successor != UNTRIED) & reachable[:, None]).sum() / (count * len(ACTIONS))
    return (graph.met & reachable).sum() / count, tried


def steps_to_frontier(graph: ExperienceGraph) -> Float32[Array, "states"]:
    """Least number of actions, along edges of the graph, to a state with an untried action.

        f(s) = 0 where an action is untried, else 1 + min_a f(s'_a)

    Args:
        graph: transitions met.

    Returns:
        The number for each state; infinite where no such state can be reached.
    """
    untried = (graph.successor == UNTRIED).any(1, keepdims=True)
    return least_costs(graph.successor, jnp.where(untried, 0.0, jnp.inf), jnp.ones((1, 1)))[:, 0]


def least_costs(
    successor: Int32[Array, "states 4"],
    first: Float32[Array, "states ends"],
    cost: Float32[Array, "#states #ends"],
) -> Float32[Array, "states ends"]:
    """Least cost of a way along tried actions, by value iteration until nothing changes.

    Args:
        successor: state that each action led to, or `UNTRIED`.
        first: cost of ending in each state at once; infinite where that is no end.
        cost: cost of a step from each state, positive.

    Returns:
        The cost from each state; infinite where no end can be reached.
    """
    known = successor != UNTRIED

    def improve(carry: tuple[Array, Array]) -> tuple[Array, Array]:
        reach, _ = carry
        best = jnp.full_like(reach, jnp.inf)
        for action in range(successor.shape[1]):
            behind = jnp.where(known[:, action, None], reach[successor[:, action]], jnp.inf)
            best = jnp.minimum(best, behind)
        better = jnp.minimum(reach, cost + best)
        return better, (better < reach).any()

    return jax.lax.while_loop(lambda carry: carry[1], improve, (first, jnp.bool_(True)))[0]


def exploring_action(
    key: PRNGKeyArray,
    graph: ExperienceGraph,
    to_frontier: Float32[Array, "states"],
    state: Int32[Array, "*workers"],
) -> tuple[Int32[Array, "*workers"], Bool[Array, "*workers"]]:
    """The action that leads to something untried by the shortest known way; ties are broken at random.

    Args:
        key: source of randomness.
        graph: transitions met.
        to_frontier: `steps_to_frontier` of the graph.
        state: states of the workers.

    Returns:
        One action a worker, and whether there is anything left to explore from its state.
    """
    following = graph.successor[state]
    cost = jnp.where(following == UNTRIED, -1.0, to_frontier[following])
    noise = jax.random.uniform(key, cost.shape, maxval=0.5)
    return jnp.argmin(cost + noise, -1).astype(jnp.int32), jnp.isfinite(to_frontier[state])
