"""Exploration and costs to go on the experience graph, against hand computation and brute force."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import dijkstra

from relm_irl_jax.agents.metric.costs_to_go import minimum_costs_to_goals, steps_of_best_paths
from relm_irl_jax.agents.metric.experience_graph import (
    UNTRIED,
    ExperienceGraph,
    coverage,
    empty_graph,
    exploring_action,
    one_way_transitions,
    steps_to_frontier,
)
from relm_irl_jax.rewards.goals import RewardAlone
from relm_irl_jax.scenes.scene import shortest_path_distances, successors

CORRIDOR = jnp.asarray([[1, 0, 0, 0], [2, 1, 1, 0], [2, 2, 2, 1]], jnp.int32)
"""Three states in a row: 0 ⇄ 1 ⇄ 2 by actions 0 and 3; the others lead nowhere."""


def int32(values):
    return jnp.asarray(values, jnp.int32)


def test_costs_in_a_corridor_by_hand():
    cost = jnp.asarray([[1.0, 2.0, 4.0], [8.0, 16.0, 32.0]])
    reach = minimum_costs_to_goals(CORRIDOR, int32([2, 0]), cost)
    np.testing.assert_array_equal(reach, [[1 + 2, 0], [2, 16], [0, 32 + 16]])


def test_stopping_before_the_goal_by_hand():
    """The goal is state 2; stopping in state 0 costs less than walking there."""
    stop = jnp.asarray([[1.5, jnp.inf, 0.0]])
    reach = minimum_costs_to_goals(CORRIDOR, int32([2]), jnp.ones((1, 3)), stop)
    np.testing.assert_array_equal(reach[:, 0], [1.5, 1.0, 0.0])


def test_costs_of_stopping_are_discounted_values():
    """Of a reward p(s) for ever in the view where the agent stays, by value iteration."""
    generator, discount = np.random.default_rng(0), 0.9
    graph = successors(grid_scene(3, 3).graph)
    share = np.where(generator.random((1, len(graph))) < 0.2, generator.uniform(0.1, 1.0, (1, len(graph))), 0.0)
    stop = jnp.asarray(RewardAlone(0.05, discount).stop(share), jnp.float32)
    reach = minimum_costs_to_goals(int32(graph), int32([0]), jnp.ones((1, len(graph))), stop)[:, 0]
    value = share[0]
    for _ in range(len(graph)):
        value = np.maximum(share[0], discount * value[graph].max(1))
    np.testing.assert_allclose(discount**reach, value, rtol=1e-5)


def test_unit_costs_are_shortest_paths():
    graph = grid_scene(3, 3).graph
    reach = minimum_costs_to_goals(int32(successors(graph)), jnp.arange(len(graph)), jnp.ones((len(graph), len(graph))))
    np.testing.assert_array_equal(reach, shortest_path_distances(graph))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_costs_equal_dijkstra_on_a_partly_known_graph(seed):
    """A step's cost is that of the state left; an untried action is no edge."""
    generator = np.random.default_rng(seed)
    successor = generator.integers(0, 12, (12, 4))
    successor[generator.random((12, 4)) < 0.4] = UNTRIED
    cost = generator.uniform(0.3, 1.0, (2, 12))
    goals = (3, 7)
    reach = np.asarray(minimum_costs_to_goals(int32(successor), int32(goals), jnp.asarray(cost, jnp.float32)))
    for column, goal in enumerate(goals):
        weights = np.zeros((12, 12))
        for state, action in zip(*np.nonzero(successor != UNTRIED), strict=True):
            if successor[state, action] != state:
                weights[state, successor[state, action]] = cost[column, state]
        np.testing.assert_allclose(reach[:, column], dijkstra(weights.T, indices=goal), rtol=1e-5)
    steps = np.asarray(steps_of_best_paths(int32(successor), int32(goals), jnp.asarray(reach)))
    for column, goal in enumerate(goals):
        for state in range(12):
            at, count = state, 0.0
            while at != goal and np.isfinite(reach[at, column]):
                known = [next_state for next_state in successor[at] if next_state != UNTRIED]
                at = min(known, key=lambda next_state: reach[next_state, column])
                count += 1
            assert steps[state, column] == (count if at == goal else np.inf)


def test_frontier_by_hand():
    """Everything is known but one action at the far end of the corridor."""
    graph = ExperienceGraph(CORRIDOR.at[2, 0].set(UNTRIED), jnp.ones(3, bool))
    steps = steps_to_frontier(graph)
    np.testing.assert_array_equal(steps, [2, 1, 0])
    action, unexplored = exploring_action(jax.random.key(0), graph, steps, jnp.arange(3))
    assert action.tolist() == [0, 0, 0]
    assert unexplored.all()
    known = ExperienceGraph(CORRIDOR, jnp.ones(3, bool))
    assert not exploring_action(jax.random.key(0), known, steps_to_frontier(known), jnp.arange(3))[1].any()


def test_coverage_counts_reachable_states_alone():
    graph = empty_graph(4)
    graph = ExperienceGraph(graph.successor.at[0, :2].set(0), graph.visited.at[0].set(True))
    visited, tried = coverage(graph, jnp.asarray([True, True, False, False]))
    assert float(visited) == 0.5
    assert float(tried) == pytest.approx(2 / 8)


def test_one_way_transitions_are_found():
    both = ExperienceGraph(int32(successors(grid_scene(2, 2).graph)), jnp.ones(16, bool))
    assert not one_way_transitions(both).any()
    back = int(both.successor[0, 0])
    drop = dataclasses.replace(both, successor=both.successor.at[back].set(back))
    assert bool(one_way_transitions(drop)[0, 0])
