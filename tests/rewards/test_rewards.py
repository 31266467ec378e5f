"""Reward models by hand, and demonstrations that keep clear of evaluation targets."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene, labelled

from relm_irl_jax import env
from relm_irl_jax.env import Episode
from relm_irl_jax.errors import InputError
from relm_irl_jax.rewards.assemble import (
    ManualSettings,
    demonstrated_reward,
    manual_reward,
    predicted_inputs,
    predicted_reward,
)
from relm_irl_jax.rewards.demonstrations import IrlSettings, RewardBasis, fit_basis, learn_rewards
from relm_irl_jax.rewards.goals import IMAGINED_STARTS, predicted_goals
from relm_irl_jax.rewards.model import LinearReward
from relm_irl_jax.rewards.prediction import ElmSettings, fit_machine, pair_data, pair_inputs
from relm_irl_jax.rewards.quality import judge
from relm_irl_jax.tasks import Target, TaskSettings, draw_split
from relm_irl_jax.world import build_targets, build_world


def corridor_rewards(model, actions=(0, 1, 0)):
    """Rewards on the way from state 0 to the target, state 5: a collision, a turn, a move onto the target."""
    scene = grid_scene(2, 1)
    world, targets = build_world([scene], [0]), build_targets([scene], [Target(0, 5)])
    episode = Episode(jnp.int32(0), jnp.int32(0), jnp.int32(0), jnp.int32(0))
    rewards = []
    for action in actions:
        episode, transition = env.step(episode, jnp.int32(action), world, targets, jnp.int32(9))
        rewards.append(float(model(transition, world, targets)))
    return rewards


def test_manual_reward_by_hand():
    assert corridor_rewards(manual_reward(ManualSettings())) == pytest.approx([-0.1, -0.01, 10.0])


def linear(weights, row, least_cost=0.0, **form):
    features = jnp.eye(8)[:, :6]
    return LinearReward(
        jnp.asarray(weights), jnp.asarray(row), features, jnp.float32(1.0), jnp.float32(least_cost), **form
    )


def test_linear_reward_by_hand():
    w = np.zeros((2, 6), np.float32)
    w[0] = [-0.25, -0.5, 0.0, 0.0, 0.0, 0.25]
    w[1] = [7.0, -7.0, 0.0, 0.0, 0.0, 0.0]
    from_start = np.zeros((1, 8), np.int32)
    assert corridor_rewards(linear(w, from_start)) == pytest.approx([-0.5, -0.75, 0.0])  # w·(φ(s') − φ(g))
    assert corridor_rewards(linear(w, from_start, cost_form=False)) == pytest.approx([-0.25, -0.5, 0.25])
    assert corridor_rewards(linear(w, from_start, least_cost=0.6)) == pytest.approx([-0.6, -0.75, 0.0])
    by_state = np.asarray([[1, 0, 0, 0, 0, 0, 0, 0]], np.int32)
    assert corridor_rewards(linear(w, by_state)) == pytest.approx([0.0, -1.0, 0.0])  # clipped to [−1, 0]
    assert corridor_rewards(linear(w, by_state, follow=True)) == pytest.approx([0.0, -1.0, 0.0])
    assert corridor_rewards(linear(w, by_state, follow=True), (1, 0)) == pytest.approx([-1.0, 0.0])
    assert corridor_rewards(linear(w, 1 - by_state, follow=True), (1, 0)) == pytest.approx([-0.75, 0.0])


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
    basis = fit_basis(rooms, IRL.dimension)
    return basis, learn_rewards(rooms, split, basis, IRL, 0)


def test_basis_is_the_principal_components(rooms):
    basis = fit_basis(rooms, 5)
    features = np.concatenate([room.encoded for room in rooms]).astype(np.float64)
    phi = basis(features)
    assert np.square(phi).sum(1).mean() == pytest.approx(5)
    singular = np.linalg.svd(features - features.mean(0), compute_uv=False)[:5]
    np.testing.assert_allclose(
        np.linalg.norm(phi, axis=0) / np.linalg.norm(phi[:, 0]), singular / singular[0], rtol=1e-5
    )
    with pytest.raises(InputError, match=r"irl\.dimension: 99 asked for, the training views span 30"):
        fit_basis(rooms, 99)


def test_demonstrations_keep_clear_of_evaluation_targets(rooms, split, learned):
    _, records = learned
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
    settings = replace(IRL, method=method, sub_walks=False)
    basis = fit_basis(rooms, settings.dimension)
    records = learn_rewards(rooms, split, basis, settings, 0)
    assert [record.target for record in records] == list(split.training)
    for record in records:
        phi = basis(rooms[record.target.scene].encoded)
        assert np.abs((phi - phi[record.target.state]) @ record.solution.w).max() <= 1 + 1e-6


def test_rewards_obey_their_bounds_and_are_best_at_the_target(rooms, learned):
    basis, records = learned
    for record in records:
        scene, target = rooms[record.target.scene], record.target.state
        phi = basis(scene.encoded)
        values = (phi - phi[target]) @ record.solution.w
        assert values.max() < 1e-6
        assert values.min() > -1 - 1e-6
        assert judge(scene, target, basis, record.solution.w).rank <= 1 + int((values > -1e-9).sum())


def test_episodes_are_paid_by_the_weights_of_their_target(rooms, split, learned):
    basis, records = learned
    model = demonstrated_reward(rooms, split.training, records, basis, IRL)
    for row, target in enumerate(split.training):
        record = next(r for r in records if r.target == target)
        used = np.asarray(model.weights)[np.asarray(model.row)[row, : rooms[target.scene].n_states]]
        np.testing.assert_allclose(used, np.broadcast_to(record.solution.w, used.shape), rtol=1e-6)


def test_single_trajectories_have_weights_of_their_own(rooms, split, learned):
    basis, _ = learned
    settings = replace(IRL, pooling="trajectory", sub_walks=False)
    records = learn_rewards(rooms, split, basis, settings, 0)
    assert len(records) == 3 * len(split.training)
    model = demonstrated_reward(rooms, split.training, records, basis, settings)
    for row, target in enumerate(split.training):
        for number, record in enumerate(records):
            if record.target == target:
                passing = np.asarray(model.row)[row, record.starts]
                others = [i for i, r in enumerate(records) if r.target == target]
                assert set(passing.tolist()) <= set(others)
                nearest = [i for i in others if record.starts[0] in records[i].starts]
                assert passing[0] in nearest
                assert number in others


def test_predictions_follow_the_pairs_they_were_fitted_on(rooms, split, learned):
    basis, records = learned
    elm = ElmSettings(hidden=60, pairs=80)
    data = pair_data(rooms, records, elm.pairs, np.random.default_rng(0))
    assert data.inputs.shape == (80, 60)
    plain, regularised = (fit_machine(data, elm, 0, regularised=r) for r in (False, True))
    assert plain.n_selected_ == 60
    assert regularised.n_selected_ < 60
    model = predicted_reward(rooms, split.training, regularised, basis, IRL, elm)
    row, target = 1, split.training[1]
    start = 7
    pair = np.concatenate([rooms[target.scene].encoded[start], rooms[target.scene].encoded[target.state]])
    expected = regularised.predict(pair[None])[0]
    np.testing.assert_allclose(np.asarray(model.weights)[int(model.row[row, start])], expected, rtol=1e-4, atol=1e-6)
    shown = demonstrated_reward(rooms, split.training, records, basis, IRL)
    assert jax.tree.map(jnp.shape, shown) == jax.tree.map(jnp.shape, model)  # one compiled training serves both


@pytest.mark.parametrize("follow", [False, True])
def test_goals_cost_what_the_machine_predicts(rooms, split, learned, follow):
    """Against predictions one by one; each goal's mean cost is 1."""
    basis, records = learned
    data = pair_data(rooms, records, 80, np.random.default_rng(0))
    machine = fit_machine(data, ElmSettings(hidden=60), 0, regularised=True)
    generator = np.random.default_rng(5)
    goals = predicted_goals(rooms, split, "strict", machine, basis, IRL, generator, follow=follow)
    assert not set(np.asarray(goals.state)[0][: int(goals.count[0])]) & split.evaluation_only(0)
    views, phi = rooms[0].encoded, basis(rooms[0].encoded)
    starts = np.random.default_rng(5).choice(rooms[0].reachable, (IMAGINED_STARTS, int(goals.count[0])))
    for column in (0, 7):
        goal = int(goals.state[0, column])
        drawn = machine.predict(pair_inputs(views[starts[:, column]], np.repeat(views[[goal]], IMAGINED_STARTS, 0)))
        expected = np.empty(len(views))
        for state in range(len(views)):
            pair = pair_inputs(views[[state]], views[[goal]])
            w = machine.predict(pair)[0] if follow else drawn.mean(0)
            expected[state] = np.clip(-w @ (phi[state] - phi[goal]), IRL.least_cost, 1.0)
        np.testing.assert_allclose(np.asarray(goals.cost)[0, column, :48], expected / expected.mean(), rtol=1e-5)


def test_the_agent_sees_what_the_machine_predicts(rooms, split, learned):
    """Seen rewards are those that an episode beginning in each state would be paid for standing there."""
    basis, records = learned
    machine = fit_machine(
        pair_data(rooms, records, 80, np.random.default_rng(0)), ElmSettings(hidden=60), 0, regularised=True
    )
    seen = predicted_inputs(rooms, split.new, machine, basis, IRL)
    assert seen.shape == (len(split.new), 96)
    for row, target in enumerate(split.new):
        own = slice(48 * target.scene, 48 * (target.scene + 1))
        assert seen[row, own].min() < 0
        assert not np.delete(seen[row], np.arange(own.start, own.stop)).any()
        assert seen[row, own.start + target.state] == 0
    target = split.new[0]
    phi, views = basis(rooms[target.scene].encoded), rooms[target.scene].encoded
    w = machine.predict(pair_inputs(views[[9]], views[[target.state]]))[0]
    expected = np.clip(w @ (phi[9] - phi[target.state]), -1, 0)
    assert seen[0, 48 * target.scene + 9] == pytest.approx(expected, abs=1e-6)


def test_judgement_by_hand():
    scene = grid_scene(2, 1)
    identity = RewardBasis(np.zeros(8), np.eye(8))
    distance = scene.shortest_path_distance[:, 5]
    best = judge(scene, 5, identity, -0.1 * distance)
    assert (best.rank, best.states) == (1, 8)
    assert best.order == pytest.approx(1.0)
    worst = judge(scene, 5, identity, 0.1 * distance)
    assert worst.rank == 8
    assert worst.order == pytest.approx(-1.0)
    flat = judge(scene, 5, identity, np.zeros(8))
    assert flat.rank == 8
    assert np.isnan(flat.order)
