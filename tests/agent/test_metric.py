"""The metric agent: exploration, costs to go, the loss and the wall, against hand computation and brute force."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene
from hypothesis import given, settings
from hypothesis import strategies as st
from interruption import assert_same, cut_off, take_up
from relm_irl_jax.agent.learning import TrainingRecord
from relm_irl_jax.agent.metric.costs import Goals, costs_to_go, steps_of_best_ways
from relm_irl_jax.agent.metric.experience import (
    UNTRIED,
    ExperienceGraph,
    coverage,
    exploring_action,
    no_experience,
    steps_to_frontier,
)
from relm_irl_jax.agent.metric.loss import Hindsight, MetricSetting, hindsight_loss
from relm_irl_jax.agent.metric.network import Places, distance, distances, metric_network, union_length
from relm_irl_jax.agent.metric.train import one_way, train_metric
from relm_irl_jax.agent.settings import MetricSettings
from relm_irl_jax.rewards.assemble import ManualSettings, manual_reward
from scipy.sparse.csgraph import dijkstra

from relm_irl_jax.config import Config
from relm_irl_jax.env import Lane
from relm_irl_jax.errors import InputError
from relm_irl_jax.evaluation import evaluate, metric_policy, metrics
from relm_irl_jax.rewards.goals import goal_states, manual_goals
from relm_irl_jax.scenes.scene import shortest_path_distances, successors
from relm_irl_jax.tasks import Target, TaskSplit
from relm_irl_jax.world import build_targets, build_world

SMALL = MetricSettings(
    width=64, dimension=16, groups=4, workers=16, t_max=8, states=24, goals=24, learning_rate=3e-3, acting_sharpness=8.0
)


def split_of(*training, new=(), uniform=()):
    return TaskSplit(tuple(training), tuple(new), tuple(uniform), ())


def corridor():
    """Three states in a row: 0 ⇄ 1 ⇄ 2 by actions 0 and 3; the others lead nowhere."""
    return jnp.asarray([[1, 0, 0, 0], [2, 1, 1, 0], [2, 2, 2, 1]], jnp.int32)


def test_costs_in_a_corridor_by_hand():
    cost = jnp.asarray([[1.0, 2.0, 4.0], [8.0, 16.0, 32.0]])
    reach = costs_to_go(corridor(), jnp.asarray([2, 0]), cost)
    np.testing.assert_array_equal(reach, [[1 + 2, 0], [2, 16], [0, 32 + 16]])


def test_unit_costs_are_shortest_paths():
    graph = grid_scene(3, 3).graph
    goal = jnp.arange(len(graph))
    reach = costs_to_go(jnp.asarray(successors(graph)), goal, jnp.ones((len(graph), len(graph))))
    np.testing.assert_array_equal(reach, shortest_path_distances(graph))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_costs_equal_dijkstra_on_a_partly_known_graph(seed):
    """States are left at their cost; an untried action is no edge."""
    generator = np.random.default_rng(seed)
    successor = generator.integers(0, 12, (12, 4))
    successor[generator.random((12, 4)) < 0.4] = UNTRIED
    cost = generator.uniform(0.3, 1.0, (2, 12))
    reach = np.asarray(costs_to_go(jnp.asarray(successor), jnp.asarray([3, 7]), jnp.asarray(cost, jnp.float32)))
    for column, goal in enumerate((3, 7)):
        weights = np.zeros((12, 12))
        for state, action in zip(*np.nonzero(successor != UNTRIED), strict=True):
            if successor[state, action] != state:
                weights[state, successor[state, action]] = cost[column, state]
        np.testing.assert_allclose(reach[:, column], dijkstra(weights.T, indices=goal), rtol=1e-5)
    steps = np.asarray(steps_of_best_ways(jnp.asarray(successor), jnp.asarray([3, 7]), jnp.asarray(reach)))
    for column, goal in enumerate((3, 7)):
        for state in range(12):
            at, count = state, 0.0
            while at != goal and np.isfinite(reach[at, column]):
                at = min(
                    (successor[at, action] for action in range(4) if successor[at, action] != UNTRIED),
                    key=lambda behind: reach[behind, column],
                )
                count += 1
            assert steps[state, column] == (count if at == goal else np.inf)


def test_frontier_by_hand():
    """Everything is known but one action at the far end of the corridor."""
    graph = ExperienceGraph(corridor().at[2, 0].set(UNTRIED), jnp.ones(3, bool))
    steps = steps_to_frontier(graph)
    np.testing.assert_array_equal(steps, [2, 1, 0])
    action, anything = exploring_action(jax.random.key(0), graph, steps, jnp.arange(3))
    assert action.tolist() == [0, 0, 0]
    assert anything.all()
    known = ExperienceGraph(corridor(), jnp.ones(3, bool))
    assert not exploring_action(jax.random.key(0), known, steps_to_frontier(known), jnp.arange(3))[1].any()


def test_coverage_counts_reachable_states_alone():
    graph = no_experience(4)
    graph = dataclasses.replace(graph, met=graph.met.at[0].set(True), successor=graph.successor.at[0, :2].set(0))
    met, tried = coverage(graph, jnp.asarray([True, True, False, False]))
    assert float(met) == 0.5
    assert float(tried) == pytest.approx(2 / 8)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(["symmetric", "not symmetric", "interval"]))
def test_distances_are_a_quasimetric(seed, kind):
    symmetric = kind == "symmetric"
    form = MetricSettings(
        dimension=6, groups=2, symmetric=symmetric, distance="interval" if kind == "interval" else "euclidean"
    )
    a, b, c = jax.random.normal(jax.random.key(seed), (3, 6))
    d = lambda x, y: float(distance(x, y, form))  # noqa: E731
    assert d(a, c) <= d(a, b) + d(b, c) + 1e-5
    assert d(a, a) < 2e-3
    if symmetric:
        assert d(a, b) == pytest.approx(d(b, a), rel=1e-5)
    pairs = distances(jnp.stack([a, b]), jnp.stack([b, c]), form)
    np.testing.assert_allclose(pairs, [[d(a, b), d(a, c)], [d(b, b), d(b, c)]], rtol=1e-3, atol=2e-3)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=1, max_size=6))
def test_interval_distance_is_the_length_of_a_union(ends):
    """Counted: which unit steps of the line some interval covers."""
    covered = {step for begin, end in ends for step in range(begin, end)}
    form = MetricSettings(dimension=len(ends), groups=1, distance="interval")
    begin, end = (jnp.asarray(z, jnp.float32) for z in zip(*ends, strict=True))
    assert float(distance(begin, end, form)) == len(covered)
    assert float(distances(begin[None], end[None], form)[0, 0]) == len(covered)


def test_a_union_grows_with_the_ends_that_nothing_covers():
    begin, end = jnp.asarray([0.0, 2.0, 7.0, 9.0]), jnp.asarray([3.0, 5.0, 8.0, 1.0])  # the last one is empty
    by_begin, by_end = jax.grad(union_length, argnums=(0, 1))(begin, end)
    np.testing.assert_array_equal(by_begin, [-1, 0, -1, 0])
    np.testing.assert_array_equal(by_end, [0, 1, 1, 0])


@pytest.mark.parametrize("bootstrap", [False, True])
def test_the_loss_vanishes_where_places_are_right(bootstrap):
    """States on a line, the embedding their coordinate: distances, successors and choices are exact."""
    form = dataclasses.replace(SMALL, dimension=1, groups=1, states=3, goals=3, sharpness=50.0, bootstrap=bootstrap)
    place = jnp.asarray([[0.0], [1.0], [2.0]])
    successor = corridor()
    reach = costs_to_go(successor, jnp.arange(3), jnp.ones((3, 3)))
    goals = Goals(jnp.arange(3)[None], jnp.asarray([3]), jnp.asarray([1]), jnp.ones((1, 3, 3)))
    scene = grid_scene(1, 1)
    world, targets = build_world([scene], [0]), build_targets([scene], [Target(0, 1)])
    lane = Lane(jnp.zeros((1, 1), jnp.int32), jnp.ones((1, 1), jnp.int32))
    setting = MetricSetting(
        world,
        targets,
        lane,
        manual_reward(ManualSettings()),
        goals,
        jnp.arange(3)[None],
        jnp.asarray([3]),
        Hindsight(successor[None], reach[None], reach[None]),
    )
    total, parts = hindsight_loss(jax.random.key(0), Places(place, place[successor]), setting, form)
    assert float(total) < 1e-5
    wrong, _ = hindsight_loss(jax.random.key(0), Places(2 * place, place[successor]), setting, form)
    assert float(wrong) > 0.1
    assert float(parts.successor) == 0.0


def room_task():
    """A furnished bathroom is too much for a test: an open room of 3 × 3 places, random features."""
    features = np.random.default_rng(0).normal(size=(36, 24)).astype(np.float32)
    scene = grid_scene(3, 3, features=features)
    new = (Target(0, 22), Target(0, 35))
    split = split_of(Target(0, 5), Target(0, 13), new=new, uniform=(Target(0, 30),))
    return scene, split


def trained(record, form=SMALL):
    scene, split = room_task()
    world, targets = build_world([scene], [0]), build_targets([scene], split.training)
    goals = manual_goals([scene], split, "strict", ManualSettings())
    reward = manual_reward(ManualSettings())
    return train_metric(jax.random.key(0), world, targets, reward, goals, form, 50, 50_000, record)


def on_new_targets(parameters, form=SMALL):
    scene, split = room_task()
    world, new = build_world([scene], [0]), build_targets([scene], split.new)
    policy = metric_policy(metric_network(form), parameters, world, new, form)
    return metrics(evaluate(jax.random.key(1), policy, world, new, 50, 400), 0)


@pytest.fixture(scope="module")
def uninterrupted():
    return trained(TrainingRecord())


def test_a_training_that_was_cut_off_ends_the_same(uninterrupted, tmp_path):
    """Everything is explored when it is cut off, so that costs to go must be found again: they are not renewed."""
    cut_off(tmp_path, trained)
    result, moved = take_up(tmp_path, trained, Config())
    assert moved[0] == 2 * moved[1]
    assert uninterrupted[1].actions_tried[1] == 1.0
    assert_same(uninterrupted, result)


def test_finds_targets_that_were_never_goals(uninterrupted):
    """Strict: the new targets are met as states alone, and found nearly always, by nearly shortest ways."""
    parameters, curve = uninterrupted
    assert curve.actions_tried[-1] == 1.0
    measured = on_new_targets(parameters)
    assert measured.success_rate > 0.9
    assert measured.spl > 0.7


@pytest.mark.parametrize("change", [{"distance": "interval"}, {"bootstrap": True}], ids=["intervals", "bootstrap"])
def test_other_ways_to_learn_distances_find_them_too(change):
    form = dataclasses.replace(SMALL, **change)
    assert on_new_targets(trained(TrainingRecord(), form)[0], form).success_rate > 0.8


def test_strict_goals_leave_out_every_evaluation_target():
    scene, split = room_task()
    kept = {22, 35, 30}
    (strict,), (open_,), (none,) = (goal_states([scene], split, name) for name in ("strict", "open", "none"))
    assert not kept & set(strict.tolist())
    assert set(open_.tolist()) - set(strict.tolist()) == kept
    assert none.tolist() == [5, 13]


def test_one_way_steps_are_seen():
    both = ExperienceGraph(jnp.asarray(successors(grid_scene(2, 2).graph)), jnp.ones(16, bool))
    assert not one_way(both).any()
    back = int(both.successor[0, 0])
    drop = dataclasses.replace(both, successor=both.successor.at[back].set(back))
    assert bool(one_way(drop)[0, 0])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"groups": 3}, r"metric\.groups: 3 equal parts of 16 dimensions"),
        ({"workers": 1}, r"metric\.workers: 1 workers cannot serve 2 scenes"),
    ],
)
def test_settings_that_cannot_be_used_are_refused(change, sentence):
    scenes = [grid_scene(2, 1, name="bathroom-0"), grid_scene(2, 1, name="bathroom-1")]
    split = split_of(Target(0, 1), Target(1, 2))
    world, targets = build_world(scenes, [0, 0]), build_targets(scenes, split.training)
    goals = manual_goals(scenes, split, "strict", ManualSettings())
    form = dataclasses.replace(SMALL, **change)
    with pytest.raises(InputError, match=sentence):
        train_metric(jax.random.key(0), world, targets, manual_reward(ManualSettings()), goals, form, 20, 100)


def test_a_step_that_costs_nothing_is_refused():
    scene, split = room_task()
    with pytest.raises(InputError, match=r"manual\.step: 0\.0 costs nothing"):
        manual_goals([scene], split, "strict", ManualSettings(step=0.0))
