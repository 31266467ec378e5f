"""Costs to go on the experience graph, under each method's reward.

For a goal g and a cost c_g(s) > 0 of leaving any other state s, the minimum cost to reach g along edges of the graph is

    C(g, g) = 0,   C(s, g) = c_g(s) + min_a C(s'_a, g)

and −C is the optimal undiscounted value under the reward r(s) = −c_g(s). With the hand-made reward every step costs
the same and C counts steps; a collision costs more, and no shortest path has one. With a learned reward
c_g(s) = −r(s, g).

The number of steps of the path of minimum cost is

    N(g, g) = 0,   N(s, g) = 1 + N(s'_{a*}, g),   a* = argmin_a C(s'_a, g)

The learned distance can represent either. The reward selects the path in both cases. An embedding represents steps
better, since a cost that depends on the goal differs between the two directions of a path.

Where the reward alone says where a goal is (`relm_irl_jax.rewards.goals`), a path may stop in any state that pays, and

    C(s, g) = min( stop_g(s), 1 + min_a C(s'_a, g) )

counts steps already, so that N is C.
"""

from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.agents.metric.experience_graph import UNTRIED, ExperienceGraph, minimum_costs
from relm_irl_jax.agents.padding import divide_by_size
from relm_irl_jax.rewards.goals import Goals
from relm_irl_jax.world import World


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class SceneStates:
    """States of each scene.

    Attributes:
        state: world state of each local state; rows are padded with the scene's first state.
        count: number of states of each scene.
    """

    state: Int32[Array, "scenes locals"]
    count: Int32[Array, "scenes"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class CostsToGo:
    """Costs to go to all goals, computed from one snapshot of the graph.

    Attributes:
        successor: local state that each action leads to, or `UNTRIED`.
        cost: C, minimum cost from each local state to each goal; infinite where the graph has no path.
        length: regression target of the distance: N, the number of steps of that path, or C.
    """

    successor: Int32[Array, "scenes locals 4"]
    cost: Float32[Array, "scenes locals goals"]
    length: Float32[Array, "scenes locals goals"]


class ScenesOfSize(NamedTuple):
    """Scenes of similar size, whose costs are computed without the padding of larger ones.

    Attributes:
        scenes: numbers of the scenes.
        states: states of the largest of them.
        goals: most goals of one of them.
    """

    scenes: tuple[int, ...]
    states: int
    goals: int


SIZES = 4
"""Groups of scenes of similar size, at most. Costs of a scene take time like the square of its padded size."""


def scenes_by_size(scenes: SceneStates, goals: Goals) -> tuple[ScenesOfSize, ...]:
    """Group scenes of similar size.

    Args:
        scenes: states of each scene.
        goals: the goals.

    Returns:
        At most `SIZES` groups of about equally many scenes; see `relm_irl_jax.agents.padding.divide_by_size`.
    """
    states, n_goals = np.asarray(scenes.count), np.asarray(goals.count)
    groups = divide_by_size(states, np.zeros_like(states), SIZES)
    return tuple(ScenesOfSize(tuple(g.tolist()), int(states[g].max()), int(n_goals[g].max())) for g in groups)


def minimum_costs_to_goals(
    successor: Int32[Array, "locals 4"],
    goal: Int32[Array, "goals"],
    step_cost: Float32[Array, "goals locals"],
    stop: Float32[Array, "goals locals"] | None = None,
) -> Float32[Array, "locals goals"]:
    """Minimum cost from every state to every goal.

    Args:
        successor: local state that each action led to, or `UNTRIED`.
        goal: the goals.
        step_cost: cost of leaving each state for each goal, positive.
        stop: cost of stopping in each state; None for 0 at the goal and nowhere else.

    Returns:
        C(s, g); infinite where the graph has no path.
    """
    if stop is not None:
        return minimum_costs(successor, stop.T, step_cost.T)
    ends = jnp.arange(step_cost.shape[1])[:, None] == goal
    return minimum_costs(successor, jnp.where(ends, 0.0, jnp.inf), step_cost.T)


def steps_of_best_paths(
    successor: Int32[Array, "locals 4"], goal: Int32[Array, "goals"], cost: Float32[Array, "locals goals"]
) -> Float32[Array, "locals goals"]:
    """Number of steps of the path of minimum cost.

    Args:
        successor: local state that each action led to, or `UNTRIED`.
        goal: the goals.
        cost: C, from `minimum_costs_to_goals`.

    Returns:
        N(s, g); infinite where the graph has no path.
    """
    next_cost = jnp.where((successor == UNTRIED)[..., None], jnp.inf, cost[successor])
    next_state = jnp.take_along_axis(successor, next_cost.argmin(1), axis=1)
    ends = jnp.arange(len(cost))[:, None] == goal
    column = jnp.arange(len(goal))

    def improve(carry: tuple[Array, Array]) -> tuple[Array, Array]:
        steps, _ = carry
        better = jnp.where(ends, 0.0, jnp.where(jnp.isfinite(cost), 1 + steps[next_state, column], jnp.inf))
        return better, (better != steps).any()

    # Every step lowers the cost to go, so no path has a cycle. The type is that of `unknown_costs`, not a weak one: the
    # update would be compiled a second time.
    first = jnp.where(ends, jnp.float32(0.0), jnp.inf)
    return jax.lax.while_loop(lambda carry: carry[1], improve, (first, jnp.bool_(True)))[0]


def unknown_costs(scenes: SceneStates, goals: Goals) -> CostsToGo:
    """Costs to go before any transition was observed: all infinite.

    Args:
        scenes: states of each scene.
        goals: the goals.

    Returns:
        The costs.
    """
    successor = jnp.full((*scenes.state.shape, 4), UNTRIED, jnp.int32)
    infinite = jnp.full((*scenes.state.shape, goals.state.shape[1]), jnp.inf, jnp.float32)
    return CostsToGo(successor, infinite, infinite)


@partial(jax.jit, static_argnames=("counts", "by_size"))
def compute_costs_to_go(
    graph: ExperienceGraph,
    world: World,
    goals: Goals,
    scenes: SceneStates,
    counts: Literal["steps", "costs"],
    by_size: tuple[ScenesOfSize, ...],
) -> CostsToGo:
    """Costs to go on the current graph.

    Args:
        graph: transitions observed.
        world: the scenes.
        goals: the goals and their costs.
        scenes: states of each scene.
        counts: regression target of the distance. Static.
        by_size: all scenes, grouped by size. Static.

    Returns:
        The costs; infinite in the padding of states and goals.
    """
    valid = jnp.arange(scenes.state.shape[1]) < scenes.count[:, None]
    next_state = graph.successor[scenes.state]
    successor = jnp.where((next_state != UNTRIED) & valid[..., None], world.local[next_state], UNTRIED)
    cost = jnp.full((*scenes.state.shape, goals.state.shape[1]), jnp.inf, jnp.float32)
    length = cost
    in_steps = counts == "costs" or goals.stop is not None
    for group in by_size:
        numbers, states, ends = np.asarray(group.scenes), slice(group.states), slice(group.goals)
        goal = goals.state[numbers, ends]
        step_cost = goals.cost[numbers, ends, states]
        stop = None if goals.stop is None else goals.stop[numbers, ends, states]
        tried = successor[numbers, states]
        found = jax.lax.map(lambda row: minimum_costs_to_goals(*row), (tried, goal, step_cost, stop))
        cost = cost.at[numbers, states, ends].set(found)
        if not in_steps:
            steps = jax.lax.map(lambda row: steps_of_best_paths(*row), (tried, goal, found))
            length = length.at[numbers, states, ends].set(steps)
    return CostsToGo(successor, cost, cost if in_steps else length)
