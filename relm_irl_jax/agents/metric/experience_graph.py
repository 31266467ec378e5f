"""The experience graph: the transitions that the workers have observed.

Its nodes are visited views, its edges observed transitions. The agent recognises a view when it sees it again, so a
node is identified by the number of its state; the graph uses nothing else of the simulator. Workers explore as long as
they can reach an untried action: they take an untried action of the current state, or else the shortest known path to
the nearest state that has one. Otherwise they follow the policy to their targets.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agents.rollout import Experience
from relm_irl_jax.scenes.scene import ACTIONS

UNTRIED = -1
"""Entry of the graph for an action that was never taken."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ExperienceGraph:
    """Transitions observed so far. If a world is not deterministic, the last outcome counts.

    Attributes:
        successor: state that each action led to, or `UNTRIED`.
        visited: states in which a worker has been.
    """

    successor: Int32[Array, "states 4"]
    visited: Bool[Array, "states"]


def empty_graph(n_states: int) -> ExperienceGraph:
    """The graph before the first step.

    Args:
        n_states: states of the world.

    Returns:
        A graph without edges.
    """
    return ExperienceGraph(jnp.full((n_states, len(ACTIONS)), UNTRIED, jnp.int32), jnp.zeros(n_states, bool))


def add_transitions(graph: ExperienceGraph, experience: Experience) -> ExperienceGraph:
    """Add transitions.

    Args:
        graph: transitions observed before.
        experience: new ones.

    Returns:
        The larger graph.
    """
    visited = graph.visited.at[experience.state].set(True).at[experience.next_state].set(True)
    successor = graph.successor.at[experience.state, experience.action].set(experience.next_state)
    return ExperienceGraph(successor, visited)


def coverage(graph: ExperienceGraph, reachable: Bool[Array, "states"]) -> tuple[Float32[Array, ""], Float32[Array, ""]]:
    """How much of the world has been explored.

    Args:
        graph: transitions observed.
        reachable: states that an episode can visit.

    Returns:
        Share of those states visited, and share of their actions tried.
    """
    count = reachable.sum(dtype=jnp.float32)
    tried = ((graph.successor != UNTRIED) & reachable[:, None]).sum(dtype=jnp.float32) / (count * len(ACTIONS))
    return (graph.visited & reachable).sum(dtype=jnp.float32) / count, tried


def steps_to_frontier(graph: ExperienceGraph) -> Float32[Array, "states"]:
    """Smallest number of actions, along edges of the graph, to a state with an untried action.

        f(s) = 0 where an action is untried, else 1 + min_a f(s'_a)

    Args:
        graph: transitions observed.

    Returns:
        The number for each state; infinite where no such state can be reached.
    """
    untried = (graph.successor == UNTRIED).any(1, keepdims=True)
    return minimum_costs(graph.successor, jnp.where(untried, 0.0, jnp.inf), jnp.ones((1, 1)))[:, 0]


def minimum_costs(
    successor: Int32[Array, "states 4"],
    end_cost: Float32[Array, "states ends"],
    step_cost: Float32[Array, "#states #ends"],
) -> Float32[Array, "states ends"]:
    """Minimum cost of a path along tried actions, by value iteration until convergence.

    Args:
        successor: state that each action led to, or `UNTRIED`.
        end_cost: cost of ending the path in each state; infinite where it cannot end.
        step_cost: cost of a step from each state, positive.

    Returns:
        The cost from each state; infinite where no end can be reached.
    """
    known = successor != UNTRIED

    def improve(carry: tuple[Array, Array]) -> tuple[Array, Array]:
        cost, _ = carry
        best = jnp.full_like(cost, jnp.inf)
        for action in range(successor.shape[1]):
            best = jnp.minimum(best, jnp.where(known[:, action, None], cost[successor[:, action]], jnp.inf))
        better = jnp.minimum(cost, step_cost + best)
        return better, (better < cost).any()

    return jax.lax.while_loop(lambda carry: carry[1], improve, (end_cost, jnp.bool_(True)))[0]


def one_way_transitions(graph: ExperienceGraph) -> Bool[Array, "states 4"]:
    """Transitions that no single action reverses; a transition counts once all actions of its next state were tried.

    Args:
        graph: transitions observed.

    Returns:
        Whether each transition is one-way.
    """
    after_next = graph.successor[jnp.maximum(graph.successor, 0)]
    returns = (after_next == jnp.arange(len(graph.successor))[:, None, None]).any(-1)
    return (graph.successor != UNTRIED) & (after_next != UNTRIED).all(-1) & ~returns


def exploring_action(
    key: PRNGKeyArray,
    graph: ExperienceGraph,
    to_frontier: Float32[Array, "states"],
    state: Int32[Array, "*workers"],
) -> tuple[Int32[Array, "*workers"], Bool[Array, "*workers"]]:
    """The action that leads to an untried action by the shortest known path; ties are broken at random.

    Args:
        key: source of randomness.
        graph: transitions observed.
        to_frontier: `steps_to_frontier` of the graph.
        state: states of the workers.

    Returns:
        One action for each worker, and whether an untried action can be reached from its state.
    """
    next_state = graph.successor[state]
    cost = jnp.where(next_state == UNTRIED, -1.0, to_frontier[next_state])
    noise = jax.random.uniform(key, cost.shape, maxval=0.5)
    return jnp.argmin(cost + noise, -1).astype(jnp.int32), jnp.isfinite(to_frontier[state])
