"""The metric agent: distances, the loss, the wall, and an open room in which it finds targets that were never goals."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene
from hypothesis import given, settings
from hypothesis import strategies as st
from interruption import assert_same, interrupt, resume

from relm_irl_jax.agents.metric.agent import MetricAgent, scene_states
from relm_irl_jax.agents.metric.costs_to_go import (
    CostsToGo,
    ScenesOfSize,
    SceneStates,
    compute_costs_to_go,
    minimum_costs_to_goals,
    scenes_by_size,
    unknown_costs,
)
from relm_irl_jax.agents.metric.drawn_scenes import draw_scenes
from relm_irl_jax.agents.metric.experience_graph import ExperienceGraph, empty_graph
from relm_irl_jax.agents.metric.loss import LossForm, LossInputs, LossWeights, metric_loss
from relm_irl_jax.agents.metric.network import DistanceForm, Embeddings, distance, pairwise_distances
from relm_irl_jax.agents.settings import MetricSettings
from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.evaluation import compute_metrics, evaluate
from relm_irl_jax.rewards.functions import manual_reward
from relm_irl_jax.rewards.goals import Goals, goal_states, manual_goals
from relm_irl_jax.rewards.settings import ManualSettings
from relm_irl_jax.tasks import Target, TaskSplit
from relm_irl_jax.types import TrainingLog, TrainingProblem
from relm_irl_jax.world import build_targets, build_world

AGENT = MetricAgent(
    MetricSettings(
        width=64,
        dimension=16,
        workers=16,
        t_max=8,
        states=24,
        goals=24,
        learning_rate=3e-3,
        evaluation_inverse_temperature=8.0,
    )
)


one_distance = jax.jit(distance, static_argnums=2)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_distances_are_a_quasimetric(seed, symmetric):
    form = DistanceForm(2, symmetric)
    a, b, c = jnp.asarray(np.random.default_rng(seed).normal(size=(3, 6)), jnp.float32)
    d = lambda x, y: float(one_distance(x, y, form))  # noqa: E731
    assert d(a, c) <= d(a, b) + d(b, c) + 1e-5
    assert d(a, a) < 2e-3
    if symmetric:
        assert d(a, b) == pytest.approx(d(b, a), rel=1e-5)
    pairs = pairwise_distances(jnp.stack([a, b]), jnp.stack([b, c]), form)
    np.testing.assert_allclose(pairs, [[d(a, b), d(a, c)], [d(b, b), d(b, c)]], rtol=1e-3, atol=2e-3)


def test_the_loss_vanishes_where_embeddings_are_right():
    """States on a line, the embedding their coordinate: distances, successors and policy are exact."""
    successor = jnp.asarray([[1, 0, 0, 0], [2, 1, 1, 0], [2, 2, 2, 1]], jnp.int32)
    cost = minimum_costs_to_goals(successor, jnp.arange(3), jnp.ones((3, 3)))
    one = lambda *values: jnp.asarray(values, jnp.int32)  # noqa: E731
    goals = Goals(jnp.arange(3)[None], one(3), one(1), jnp.ones((1, 3, 3)))
    number = jnp.float32
    inputs = LossInputs(
        SceneStates(jnp.arange(3)[None], one(3)),
        goals,
        CostsToGo(successor[None], cost[None], cost[None]),
        LossWeights(number(0.25), number(5.0), number(0.1), number(0.5), number(50.0)),
    )
    form = LossForm(states=3, goals=3, distance=DistanceForm(1, symmetric=True))
    coordinate = jnp.asarray([[0.0], [1.0], [2.0]])
    loss = jax.jit(metric_loss, static_argnums=3)
    total, parts = loss(jax.random.key(0), Embeddings(coordinate, coordinate[successor]), inputs, form)
    assert float(total) < 1e-5
    assert float(parts.successor) == 0.0
    wrong, _ = loss(jax.random.key(0), Embeddings(2 * coordinate, coordinate[successor]), inputs, form)
    assert float(wrong) > 0.1


def rooms_of_different_sizes():
    """Three rooms with random costs to go, and the loss's inputs for them."""
    scenes = [
        grid_scene(2, width, name=f"bathroom-{width}", features=np.zeros((8 * width, 4), np.float32))
        for width in (1, 2, 3)
    ]
    split = TaskSplit(tuple(Target(number, 2) for number in range(3)), (), (), ())
    world, goals = build_world(scenes), manual_goals(scenes, split, "strict", ManualSettings())
    states, generator = scene_states(world), np.random.default_rng(0)
    costs = unknown_costs(states, goals)
    successor = np.asarray(costs.successor)
    known = np.where(generator.random(successor.shape) < 0.5, 0, successor).astype(np.int32)
    length = jnp.asarray(generator.integers(1, 9, costs.cost.shape), jnp.float32)
    number = jnp.float32
    weights = LossWeights(number(0.25), number(5.0), number(0.1), number(0.5), number(2.0))
    return world, LossInputs(states, goals, CostsToGo(jnp.asarray(known), length, length), weights)


def test_drawn_scenes_keep_their_states_goals_and_costs():
    world, inputs = rooms_of_different_sizes()
    starts = np.unique(np.asarray(world.scene), return_index=True)[1]
    found = set()
    for seed in range(12):
        states, drawn = draw_scenes(jax.random.key(seed), inputs, 2)
        scenes = np.asarray(world.scene)[np.asarray(states).reshape(drawn.scenes.state.shape)]
        assert (scenes == scenes[:, :1]).all()
        assert len(set(scenes[:, 0])) == 2
        found |= set(scenes[:, 0].tolist())
        for row, scene in enumerate(scenes[:, 0]):
            count = int(drawn.scenes.count[row])
            assert count == int(inputs.scenes.count[scene])
            of_row = np.asarray(states)[np.asarray(drawn.scenes.state[row])]
            np.testing.assert_array_equal(of_row[:count], starts[scene] + np.arange(count))
            np.testing.assert_array_equal(drawn.goals.state[row], inputs.goals.state[scene])
            np.testing.assert_array_equal(drawn.costs.length[row], inputs.costs.length[scene])
    assert found == {0, 1, 2}


def test_the_loss_of_drawn_scenes_is_that_of_a_world_of_them():
    """Its part that draws nothing, over embeddings of the drawn states alone."""
    world, inputs = rooms_of_different_sizes()
    form = LossForm(states=4, goals=4, distance=DistanceForm(2, symmetric=True))
    generator = np.random.default_rng(1)
    state = jnp.asarray(generator.normal(size=(len(world.scene), 6)), jnp.float32)
    successor = jnp.asarray(generator.normal(size=(len(world.scene), 4, 6)), jnp.float32)
    whole = Embeddings(state, successor)
    states, drawn = draw_scenes(jax.random.key(0), inputs, 3)
    error = metric_loss(jax.random.key(1), jax.tree.map(lambda x: x[states], whole), drawn, form)[1].successor
    np.testing.assert_allclose(error, metric_loss(jax.random.key(1), whole, inputs, form)[1].successor, rtol=1e-6)


def open_room():
    """A furnished bathroom is too much for a test: an open room of 3 × 3 places, random features."""
    features = np.random.default_rng(0).normal(size=(36, 24)).astype(np.float32)
    scene = grid_scene(3, 3, features=features)
    new, uniform = (Target(0, 22), Target(0, 35)), (Target(0, 30),)
    return scene, TaskSplit((Target(0, 5), Target(0, 13)), new, uniform, ())


def trained(log):
    scene, split = open_room()
    goals = manual_goals([scene], split, "strict", ManualSettings())
    world, targets = build_world([scene]), build_targets([scene], split.training)
    reward = manual_reward(ManualSettings())
    return AGENT.train(jax.random.key(0), TrainingProblem(world, targets, reward, 50, 50_000, goals=goals), log)


@pytest.mark.parametrize("counts", ["steps", "costs"])
def test_computed_costs_have_the_types_of_unknown_ones(counts):
    """Weak types included: the update is compiled once for both."""
    scene, split = open_room()
    world, goals = build_world([scene]), manual_goals([scene], split, "strict", ManualSettings())
    scenes, graph = scene_states(world), empty_graph(scene.n_states)
    by_size = scenes_by_size(scenes, goals)
    computed = jax.eval_shape(lambda: vars(compute_costs_to_go(graph, world, goals, scenes, counts, by_size)))
    assert computed == jax.eval_shape(lambda: vars(unknown_costs(scenes, goals)))


def test_costs_of_scenes_of_different_sizes_do_not_depend_on_their_group():
    """Each scene's are those of a world of its own; only padding differs."""
    world, inputs = rooms_of_different_sizes()
    scenes, goals = inputs.scenes, inputs.goals
    graph = ExperienceGraph(world.successor, jnp.ones(len(world.scene), bool))
    by_size = scenes_by_size(scenes, goals)
    assert sorted(number for group in by_size for number in group.scenes) == [0, 1, 2]
    one = (ScenesOfSize((0, 1, 2), scenes.state.shape[1], goals.state.shape[1]),)
    apart, together = (compute_costs_to_go(graph, world, goals, scenes, "steps", groups) for groups in (by_size, one))
    for number, (states, ends) in enumerate(zip(scenes.count.tolist(), goals.count.tolist(), strict=True)):
        for name in ("cost", "length"):
            found = getattr(apart, name)[number, :states, :ends]
            assert np.isfinite(found).all()
            np.testing.assert_array_equal(found, getattr(together, name)[number, :states, :ends])


@pytest.fixture(scope="module")
def uninterrupted():
    return trained(TrainingLog())


def test_an_interrupted_training_ends_the_same(uninterrupted, tmp_path):
    """Everything is explored when it is interrupted, so that costs to go must be restored: they are not renewed."""
    interrupt(tmp_path, trained)
    result, moved = resume(tmp_path, trained, Config())
    assert moved[0] == 2 * moved[1]
    assert uninterrupted[1].actions_tried[1] == 1.0
    assert_same(uninterrupted, result)


def test_finds_targets_that_were_never_goals(uninterrupted):
    """Strict: the new targets are visited as states alone, and found nearly always, by nearly shortest paths."""
    scene, split = open_room()
    parameters, curve = uninterrupted
    assert curve.actions_tried[-1] == 1.0
    world, new = build_world([scene]), build_targets([scene], split.new)
    metrics = compute_metrics(evaluate(jax.random.key(1), AGENT.policy(parameters, world, new), world, new, 50, 400), 0)
    assert metrics.success_rate > 0.9
    assert metrics.spl > 0.7


def test_finds_trained_targets_of_rooms_that_take_turns():
    """One of two rooms is learned from in an update."""
    features = np.random.default_rng(0).normal(size=(2, 36, 24)).astype(np.float32)
    scenes = [grid_scene(3, 3, name=f"bathroom-{number}", features=features[number]) for number in range(2)]
    split = TaskSplit((Target(0, 5), Target(1, 13)), (), (), ())
    goals = manual_goals(scenes, split, "strict", ManualSettings())
    world, targets = build_world(scenes), build_targets(scenes, split.training)
    problem = TrainingProblem(world, targets, manual_reward(ManualSettings()), 50, 50_000, goals=goals)
    agent = MetricAgent(dataclasses.replace(AGENT.settings, scenes_at_once=1))
    parameters, curve = agent.train(jax.random.key(0), problem, TrainingLog())
    assert curve.actions_tried[-1] > 0.9
    policy = agent.policy(parameters, world, targets)
    assert compute_metrics(evaluate(jax.random.key(1), policy, world, targets, 50, 200), 0).spl > 0.7


def test_learned_distances_can_be_shown(uninterrupted):
    scene, split = open_room()
    world, targets = build_world([scene]), build_targets([scene], split.training)
    learned = np.asarray(AGENT.policy(uninterrupted[0], world, targets).distance_to(jnp.int32(1)))
    assert np.corrcoef(learned, scene.shortest_path_distance[:, 13])[0, 1] > 0.9


def test_strict_goals_leave_out_every_evaluation_target():
    scene, split = open_room()
    kept = {22, 35, 30}
    (strict,), (open_,), (none,) = (goal_states([scene], split, name) for name in ("strict", "open", "none"))
    assert not kept & set(strict.tolist())
    assert set(open_.tolist()) - set(strict.tolist()) == kept
    assert none.tolist() == [5, 13]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"groups": 3}, r"metric\.groups: 16 dimensions cannot be divided into 3"),
        ({"workers": 1}, r"metric\.workers: 1 workers are too few for 2 scenes"),
    ],
)
def test_settings_that_cannot_be_used_are_refused(change, sentence):
    scenes = [grid_scene(2, 1, name="bathroom-0"), grid_scene(2, 1, name="bathroom-1")]
    split = TaskSplit((Target(0, 1), Target(1, 2)), (), (), ())
    goals = manual_goals(scenes, split, "strict", ManualSettings())
    reward = manual_reward(ManualSettings())
    problem = TrainingProblem(build_world(scenes), build_targets(scenes, split.training), reward, 20, 100, goals=goals)
    agent = MetricAgent(dataclasses.replace(AGENT.settings, **change))
    with pytest.raises(InputError, match=sentence):
        agent.train(jax.random.key(0), problem, TrainingLog())


def test_a_step_that_costs_nothing_is_refused():
    scene, split = open_room()
    with pytest.raises(InputError, match=r"manual\.step: 0\.0 is not a cost"):
        manual_goals([scene], split, "strict", ManualSettings(step=0.0))
