"""Pairs of a state and a target, computed once: against the plain network, and against frames computed one by one."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene
from relm_irl_jax.agent.settings import SiameseSettings
from relm_irl_jax.agent.siamese.pairs import outputs_of, pairs_of
from relm_irl_jax.agent.siamese.train import begin, cheaper_pairs, network_of, run_chunk, worker_lanes
from relm_irl_jax.agent.siamese.update import Setting
from relm_irl_jax.rewards.model import ManualReward

from relm_irl_jax.tasks import Target
from relm_irl_jax.world import build_targets, build_world

SETTINGS = SiameseSettings(width=16, workers=8, t_max=6)


@pytest.fixture(scope="module")
def room():
    """Three scenes of two types, 16, 24 and 16 states, with one, two and one targets; heads are not in order."""
    generator = np.random.default_rng(0)
    sizes, heads = ((2, 2), (3, 2), (2, 2)), [0, 1, 0]
    scenes = [
        grid_scene(*size, name=f"room-{n}", features=generator.normal(size=(4 * size[0] * size[1], 12)).astype("f4"))
        for n, size in enumerate(sizes)
    ]
    world = build_world(scenes, heads)
    return world, build_targets(scenes, [Target(0, 3), Target(1, 20), Target(1, 7), Target(2, 9)])


def test_pairs_are_numbered_head_by_head(room):
    world, targets = room
    pairs = pairs_of(world, targets, 2)
    assert [len(state) for state in pairs.state] == [32, 48]
    state, target = (np.concatenate(x) for x in (pairs.state, pairs.target))
    for number, (s, g) in enumerate(zip(state, target, strict=True)):
        assert world.scene[s] == targets.scene[g]
        assert pairs.number(world, jnp.int32(s), jnp.int32(g)) == number


def test_outputs_equal_the_plain_network(room):
    world, targets = room
    network = network_of(SETTINGS, 2)
    pairs = pairs_of(world, targets, 2)
    views, wanted = world.features[None, :1, None], world.features[None, :1]
    parameters = network.init(jax.random.key(0), views.repeat(2, 0), wanted.repeat(2, 0), jnp.arange(2))
    outputs = jax.jit(lambda theta: outputs_of(network, theta, world, targets, pairs))(parameters)
    for head, (state, target) in enumerate(zip(pairs.state, pairs.target, strict=True)):
        seen, sought = world.features[state][None, :, None], world.features[targets.state[target]][None]
        logits, value = network.apply(parameters, seen, sought, jnp.asarray([head]))
        number = pairs.number(world, state, target)
        np.testing.assert_allclose(outputs.logits[number], logits[0], rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(outputs.value[number], value[0], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("also", [False, True], ids=["plain", "products and rewards seen"])
def test_an_update_through_pairs_is_one_through_frames(room, also):
    """The same steps, and the same parameters up to rounding."""
    world, targets = room
    settings = replace(SETTINGS, optimizer="rmsprop", learning_rate=0.01, gradient="sum")
    if also:
        settings = replace(settings, fusion="comparison", sees_reward=True)
        targets = replace(targets, predicted=-jnp.abs(jnp.sin(jnp.arange(4 * 56.0))).reshape(4, 56))
    network = network_of(settings, 2)
    lane = worker_lanes(by_head(targets, world), world, 2, settings.workers)
    reward = ManualReward(jnp.float32(10.0), jnp.float32(-0.1), jnp.float32(-0.01))
    frames = Setting(world, by_head(targets, world), lane, reward, jnp.float32(1.0))
    learner = begin(jax.random.key(1), world, frames.targets, lane, network, settings)
    pairs = replace(frames, pairs=pairs_of(world, frames.targets, 2))
    options = {"network": network, "settings": settings, "cap": 9, "updates": 3}
    (one, sums), (other, others) = (run_chunk(learner, setting, **options) for setting in (frames, pairs))
    assert one.episode.state.tolist() == other.episode.state.tolist()
    np.testing.assert_allclose(sums.reward, others.reward, rtol=1e-6)
    moved = jax.tree.map(lambda a, b: np.abs(a - b).max(), one.parameters, learner.parameters)
    assert all(move > 1e-5 for move in jax.tree.leaves(moved))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=2e-6), one.parameters, other.parameters)


def by_head(targets, world):
    """The targets of each head next to each other, as lanes need them."""
    order = np.argsort(np.asarray(world.head)[np.asarray(targets.state)], kind="stable")
    return jax.tree.map(lambda x: x[order], targets)


def test_pairs_are_for_one_view_and_many_frames(room):
    world, targets = room
    assert cheaper_pairs(world, targets, network_of(SETTINGS, 2), 80) is not None
    assert cheaper_pairs(world, targets, network_of(SETTINGS, 2), 79) is None
    assert cheaper_pairs(world, targets, network_of(replace(SETTINGS, history=2), 2), 1000) is None
