"""Reward functions by hand, and demonstrations that keep clear of evaluation targets."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene, labelled
from threadpoolctl import threadpool_limits

from relm_irl_jax import env
from relm_irl_jax.env import Episode
from relm_irl_jax.errors import InputError
from relm_irl_jax.rewards import demonstrated
from relm_irl_jax.rewards.basis import fit_basis
from relm_irl_jax.rewards.demonstrated import learn_demonstrated_rewards
from relm_irl_jax.rewards.equation import LinearRewardForm, linear_reward
from relm_irl_jax.rewards.functions import LinearReward, manual_reward
from relm_irl_jax.rewards.goals import IMAGINED_STARTS, RewardAlone, manual_goals, predicted_goals
from relm_irl_jax.rewards.learned import (
    demonstrated_reward,
    learn_demonstrated,
    predicted_observations,
    predicted_reward,
)
from relm_irl_jax.rewards.predicted import RewardPredictor, fit_regressor, pair_data, pair_inputs
from relm_irl_jax.rewards.quality import reward_quality
from relm_irl_jax.rewards.settings import ElmSettings, IrlSettings, ManualSettings
from relm_irl_jax.task_settings import TaskSettings
from relm_irl_jax.tasks import Target, draw_split
from relm_irl_jax.world import build_targets, build_world


def test_reward_features_do_not_depend_on_the_number_of_threads():
    """Nor on what else limits them: jobs of a study have one thread each. These sizes differ in the last bits."""
    generator = np.random.default_rng(0)
    scene = replace(grid_scene(15, 15), features=generator.normal(size=(900, 300)).astype(np.float32))
    one, two = (fit_in_threads(scene, threads) for threads in (1, 2))
    np.testing.assert_array_equal(one.components, two.components)


def fit_in_threads(scene, threads):
    with threadpool_limits(threads):
        return fit_basis([scene], 64)


def corridor_rewards(model, actions=(0, 1, 0)):
    """Rewards from state 0 to the target, state 5: a collision, a turn, a move onto the target."""
    scene = grid_scene(2, 1)
    world, targets = build_world([scene]), build_targets([scene], [Target(0, 5)])
    episode = Episode(jnp.int32(0), jnp.int32(0), jnp.int32(0), jnp.int32(0))
    rewards = []
    for action in actions:
        episode, transition = env.step(episode, jnp.int32(action), world, targets, jnp.int32(9))
        rewards.append(float(model(transition, world, targets)))
    return rewards


def test_manual_reward_by_hand():
    assert corridor_rewards(manual_reward(ManualSettings())) == pytest.approx([-0.1, -0.01, 10.0])


def linear(weights, row, minimum_cost=0.0, relative=True, from_current_view=False):
    form = LinearRewardForm(jnp.float32(1.0), jnp.float32(minimum_cost), relative)
    return LinearReward(jnp.asarray(weights), jnp.asarray(row), jnp.eye(8)[:, :6], form, from_current_view)


def test_linear_reward_by_hand():
    w = np.zeros((2, 6), np.float32)
    w[0] = [-0.25, -0.5, 0.0, 0.0, 0.0, 0.25]
    w[1] = [7.0, -7.0, 0.0, 0.0, 0.0, 0.0]
    from_start = np.zeros((1, 8), np.int32)
    assert corridor_rewards(linear(w, from_start)) == pytest.approx([-0.5, -0.75, 0.0])  # w·(φ(s') − φ(g))
    assert corridor_rewards(linear(w, from_start, relative=False)) == pytest.approx([-0.25, -0.5, 0.25])
    assert corridor_rewards(linear(w, from_start, minimum_cost=0.6)) == pytest.approx([-0.6, -0.75, 0.0])
    by_state = np.asarray([[1, 0, 0, 0, 0, 0, 0, 0]], np.int32)
    assert corridor_rewards(linear(w, by_state)) == pytest.approx([0.0, -1.0, 0.0])  # clipped to [−1, 0]
    current = {"from_current_view": True}
    assert corridor_rewards(linear(w, by_state, **current)) == pytest.approx([0.0, -1.0, 0.0])
    assert corridor_rewards(linear(w, by_state, **current), (1, 0)) == pytest.approx([-1.0, 0.0])
    assert corridor_rewards(linear(w, 1 - by_state, **current), (1, 0)) == pytest.approx([-0.75, 0.0])


@pytest.mark.parametrize("relative", [True, False])
def test_numpy_and_jax_compute_one_reward(relative):
    """The equation as figures and goals use it, for all states at once, is what agents are paid one by one."""
    w = np.asarray([-0.25, -0.5, 0.3, 0.0, 1.2, 0.25], np.float32)
    phi = np.eye(8, dtype=np.float32)[:, :6]
    form = LinearRewardForm(1.0, 0.3, relative)
    shown = linear_reward(w, phi, phi[5], np.arange(8) == 5, form)
    paid = linear(w[None], np.zeros((1, 8), np.int32), 0.3, relative)
    for actions, states in (((1, 0), (1, 5)), ((0, 1, 1), (0, 1, 2))):
        assert corridor_rewards(paid, actions) == pytest.approx(shown[list(states)], abs=1e-6)


@pytest.fixture(scope="module")
def rooms():
    generator = np.random.default_rng(0)
    made = []
    for number in range(2):
        scene = grid_scene(3, 4, name=f"bathroom-{number}", features=generator.normal(size=(48, 30)).astype(np.float32))
        made.append(labelled(scene, 6, generator))
    return made


@pytest.fixture(scope="module")
def split(rooms):
    return draw_split(rooms, (), TaskSettings(training_targets=4, new_targets_per_scene=4), 0)


IRL = IrlSettings(trajectories=3, dimension=12, processes=1)


@pytest.fixture(scope="module")
def learned(rooms, split):
    return learn_demonstrated(rooms, split, IRL, 0)


@pytest.fixture(scope="module")
def data(rooms, learned):
    return pair_data(rooms, learned.demonstrated, 80, np.random.default_rng(0))


@pytest.fixture(scope="module")
def regressors(data):
    return tuple(fit_regressor(data, ElmSettings(hidden=60), 0, regularised=r) for r in (False, True))


@pytest.fixture(scope="module")
def predictor(rooms, learned, regressors):
    return RewardPredictor(rooms, learned.phi, regressors[1], learned.form)


def test_basis_is_the_principal_components(rooms):
    basis = fit_basis(rooms, 5)
    features = np.concatenate([room.encoded for room in rooms]).astype(np.float64)
    phi = np.concatenate([basis.phi(room) for room in rooms])
    assert np.square(phi).sum(1).mean() == pytest.approx(5)
    singular = np.linalg.svd(features - features.mean(0), compute_uv=False)[:5]
    np.testing.assert_allclose(
        np.linalg.norm(phi, axis=0) / np.linalg.norm(phi[:, 0]), singular / singular[0], rtol=1e-5
    )
    with pytest.raises(InputError, match=r"irl\.dimension: 99 exceeds 30"):
        fit_basis(rooms, 99)


def test_demonstrations_keep_clear_of_evaluation_targets(rooms, split, learned):
    records = learned.demonstrated
    trained = {(t.scene, t.state) for t in split.training}
    evaluated = {(t.scene, t.state) for t in (*split.new, *split.uniform)}
    asked = {(r.target.scene, r.target.state) for r in records}
    assert not asked & evaluated
    assert {(r.target.scene, r.target.state) for r in records if r.trained} == trained
    assert len(records) > len(trained)
    for record in records:
        distance = rooms[record.target.scene].shortest_path_distance
        assert (distance[record.starts, record.target.state] > 0).all()


@pytest.mark.parametrize("method", ["apprenticeship", "max-margin-planning", "max-entropy"])
def test_weights_may_come_from_another_method(rooms, split, method):
    found = learn_demonstrated(rooms, split, replace(IRL, method=method, sub_trajectories=False), 0)
    assert [record.target for record in found.demonstrated] == list(split.training)
    for record in found.demonstrated:
        phi = found.phi[record.target.scene]
        assert np.abs((phi - phi[record.target.state]) @ record.weights).max() <= 1 + 1e-6


def test_rewards_obey_their_bounds_and_are_best_at_the_target(rooms, learned):
    for record in learned.demonstrated:
        scene, target = rooms[record.target.scene], record.target.state
        phi = learned.phi[record.target.scene]
        values = (phi - phi[target]) @ record.weights
        assert values.max() < 1e-6
        assert values.min() > -1 - 1e-6
        assert reward_quality(scene, target, phi, record.weights, learned.form).rank <= 1 + int((values > -1e-9).sum())


def test_episodes_are_paid_by_the_weights_of_their_target(rooms, split, learned):
    model = demonstrated_reward(rooms, split.training, learned)
    for row, target in enumerate(split.training):
        record = next(r for r in learned.demonstrated if r.target == target)
        used = np.asarray(model.weights)[np.asarray(model.row)[row, : rooms[target.scene].n_states]]
        np.testing.assert_allclose(used, np.broadcast_to(record.weights, used.shape), rtol=1e-6)


def test_single_trajectories_have_weights_of_their_own(rooms, split, learned):
    settings = replace(IRL, pooling="trajectory", sub_trajectories=False)
    records = learn_demonstrated_rewards(rooms, split, learned.phi, settings, 0)
    assert len(records) == 3 * len(split.training)
    model = demonstrated_reward(rooms, split.training, replace(learned, demonstrated=records))
    for row, target in enumerate(split.training):
        for number, record in enumerate(records):
            if record.target == target:
                passing = np.asarray(model.row)[row, record.starts]
                others = [i for i, r in enumerate(records) if r.target == target]
                assert set(passing.tolist()) <= set(others)
                nearest = [i for i in others if record.starts[0] in records[i].starts]
                assert passing[0] in nearest
                assert number in others


def test_problems_of_large_scenes_are_solved_in_parts(rooms, split, learned, monkeypatch):
    monkeypatch.setattr(demonstrated, "EXPERTS_IN_MEMORY", 7 * max(scene.n_states for scene in rooms))
    parts, solve = [], demonstrated.learn_weights

    def counted(problems, *arguments):
        parts.append((len(problems), arguments[-1]))
        return solve(problems, *arguments)

    monkeypatch.setattr(demonstrated, "learn_weights", counted)
    records = learn_demonstrated_rewards(rooms, split, learned.phi, IRL, 0)
    assert max(size for size, _ in parts) == 7
    assert [said for _, said in parts] == [f"inverse RL, part {i + 1}/{len(parts)}" for i in range(len(parts))]
    assert [record.target for record in records] == [record.target for record in learned.demonstrated]
    for one, other in zip(records, learned.demonstrated, strict=True):
        np.testing.assert_array_equal(one.weights, other.weights)


def test_predictions_follow_the_pairs_they_were_fitted_on(rooms, split, learned, data, regressors, predictor):
    assert data.inputs.shape == (80, 60)
    plain, regularised = regressors
    assert plain.n_selected_ == 60
    assert regularised.n_selected_ < 60
    model = predicted_reward(rooms, split.training, predictor, from_current_view=False)
    row, target = 1, split.training[1]
    start = 7
    pair = np.concatenate([rooms[target.scene].encoded[start], rooms[target.scene].encoded[target.state]])
    expected = regularised.predict(pair[None])[0]
    np.testing.assert_allclose(np.asarray(model.weights)[int(model.row[row, start])], expected, rtol=1e-4, atol=1e-6)
    shown = demonstrated_reward(rooms, split.training, learned)
    # One compiled training serves both.
    assert [x.shape for x in jax.tree.leaves(shown)] == [x.shape for x in jax.tree.leaves(model)]
    assert jax.tree.structure(shown) == jax.tree.structure(model)


@pytest.mark.parametrize("from_current_view", [False, True])
def test_goals_cost_what_the_regressor_predicts(rooms, split, regressors, predictor, from_current_view):
    """Against predictions one by one; each goal's mean cost is 1."""
    machine, phi = regressors[1], predictor.phi[0]
    generator = np.random.default_rng(5)
    goals = predicted_goals(rooms, split, "strict", predictor, generator, from_current_view=from_current_view)
    assert not set(np.asarray(goals.state)[0][: int(goals.count[0])]) & split.evaluation_only(0)
    views = rooms[0].encoded
    starts = np.random.default_rng(5).choice(rooms[0].reachable, (IMAGINED_STARTS, int(goals.count[0])))
    for column in (0, 7):
        goal = int(goals.state[0, column])
        drawn = machine.predict(pair_inputs(views[starts[:, column]], np.repeat(views[[goal]], IMAGINED_STARTS, 0)))
        each = machine.predict(pair_inputs(views, np.repeat(views[[goal]], len(views), 0)))
        weights = each if from_current_view else np.repeat(drawn.mean(0)[None], len(views), 0)
        expected = np.clip(-(weights * (phi - phi[goal])).sum(1), IRL.minimum_cost, 1.0)
        np.testing.assert_allclose(np.asarray(goals.cost)[0, column, :48], expected / expected.mean(), rtol=1e-5)


def test_the_reward_alone_says_where_goals_are(rooms, split, predictor):
    """A view is paid the less, the more its predicted reward is below the goal's."""
    alone = RewardAlone(limit=0.5, discount=0.95)
    goals = predicted_goals(
        rooms, split, "strict", predictor, np.random.default_rng(5), from_current_view=False, alone=alone
    )
    assert goals.stop is not None
    assert not set(np.asarray(goals.state)[1][: int(goals.count[1])]) & split.evaluation_only(1)
    generator, phi = np.random.default_rng(5), predictor.phi[0]
    starts = generator.choice(rooms[0].reachable, (IMAGINED_STARTS, int(goals.count[0])))
    for column in (0, 5):
        goal = int(goals.state[0, column])
        weights = np.mean([predictor.weights(0, s[[column]], np.asarray([goal]))[0] for s in starts], axis=0)
        share = np.clip(1 + 2 * (phi - phi[goal]) @ weights, 0, 1)
        stop = np.asarray(goals.stop)[0, column, :48]
        assert stop[goal] == 0.0
        np.testing.assert_array_equal(np.isinf(stop), share == 0)
        np.testing.assert_allclose(0.95 ** stop[share > 0], share[share > 0], rtol=1e-4)
    assert set(np.unique(goals.cost).tolist()) == {1.0}


def test_goals_of_all_methods_share_one_compiled_training(rooms, split, predictor):
    """Few goals or many: equal shapes, with as many columns as the largest scene has states."""
    predicted = predicted_goals(rooms, split, "open", predictor, np.random.default_rng(0), from_current_view=False)
    few = manual_goals(rooms, split, "none", ManualSettings())
    assert int(few.count.max()) < int(predicted.count.max())
    assert [x.shape for x in jax.tree.leaves(few)] == [x.shape for x in jax.tree.leaves(predicted)]
    assert few.state.shape == (len(rooms), max(room.n_states for room in rooms))


def test_the_agent_observes_what_it_would_be_paid(rooms, split, regressors, predictor):
    """Observed rewards are those of an episode that begins in each state, for being there."""
    observed = predicted_observations(rooms, split.new, predictor)
    assert observed.shape == (len(split.new), 96)
    for row, target in enumerate(split.new):
        own = slice(48 * target.scene, 48 * (target.scene + 1))
        assert observed[row, own].min() < 0
        assert not np.delete(observed[row], np.arange(own.start, own.stop)).any()
        assert observed[row, own.start + target.state] == 0
    target = split.new[0]
    phi, views = predictor.phi[target.scene], rooms[target.scene].encoded
    w = regressors[1].predict(pair_inputs(views[[9]], views[[target.state]]))[0]
    expected = np.clip(w @ (phi[9] - phi[target.state]), -1, -IRL.minimum_cost)
    assert observed[0, 48 * target.scene + 9] == pytest.approx(expected, abs=1e-6)


def test_quality_by_hand():
    scene, form = grid_scene(2, 1), LinearRewardForm(1.0, 0.6, relative=True)
    distance = scene.shortest_path_distance[:, 5].astype(float)
    best = reward_quality(scene, 5, np.eye(8), -0.1 * distance, form)
    assert (best.rank, best.states) == (1, 8)
    assert best.order == pytest.approx(1.0)
    worst = reward_quality(scene, 5, np.eye(8), 0.1 * distance, form)
    assert worst.rank == 8
    assert worst.order == pytest.approx(-1.0)
    flat = reward_quality(scene, 5, np.eye(8), np.zeros(8), form)
    assert flat.rank == 8
    assert np.isnan(flat.order)
