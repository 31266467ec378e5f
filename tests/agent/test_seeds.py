"""Seeds trained at once: each one's agent is the one that it would be alone."""

import jax
import jax.numpy as jnp
import numpy as np
from interruption import assert_same, cut_off, take_up
from relm_irl_jax.agent.learning import TrainingRecord
from relm_irl_jax.agent.settings import SiameseSettings
from relm_irl_jax.agent.siamese.seeds import stacked, train_seeds
from relm_irl_jax.agent.siamese.train import train
from relm_irl_jax.rewards.model import LinearReward
from test_update import room


def learned_reward(seed, rows):
    """Weights drawn at random, as many as the seed's targets happen to need."""
    generator = np.random.default_rng(seed)
    return LinearReward(
        weights=jnp.asarray(generator.normal(size=(rows, 5)), jnp.float32),
        row=jnp.asarray(generator.integers(0, rows, (3, 24)), jnp.int32),
        features=jnp.asarray(generator.normal(size=(40, 5)), jnp.float32),
        r_max=jnp.float32(1.0),
        least_cost=jnp.float32(0.3),
    )


def test_a_seed_at_once_equals_the_same_seed_alone():
    settings = SiameseSettings(workers=8, t_max=4, width=8, history=2)
    world, targets = room()
    keys, rewards = [jax.random.key(5), jax.random.key(6)], [learned_reward(0, 7), learned_reward(1, 4)]
    together = train_seeds(keys, world, [targets] * 2, rewards, 6.0, 2, settings, 20, 500)
    assert not np.allclose(*(jax.tree.leaves(parameters)[0] for parameters, _ in together))
    for key, reward, (parameters, curve) in zip(keys, rewards, together, strict=True):
        alone, own = train(key, world, targets, reward, 6.0, 2, settings, 20, 500)
        for a, b in zip(jax.tree.leaves(alone), jax.tree.leaves(parameters), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-5)
        np.testing.assert_array_equal(curve.episodes, own.episodes)
        np.testing.assert_allclose(curve.reward, own.reward, rtol=1e-5)


def test_seeds_at_once_that_were_cut_off_end_the_same(tmp_path):
    settings = SiameseSettings(workers=8, t_max=4, width=8)
    world, targets = room()
    keys, rewards = [jax.random.key(5), jax.random.key(6)], [learned_reward(0, 7), learned_reward(1, 4)]

    def trained(record):
        return train_seeds(keys, world, [targets] * 2, rewards, 6.0, 2, settings, 20, 1024, record)

    cut_off(tmp_path, trained)
    taken_up, moved = take_up(tmp_path, trained)
    assert moved[0] == 2 * moved[1]
    for one, other in zip(trained(TrainingRecord()), taken_up, strict=True):
        assert_same(one, other)


def test_shorter_arrays_are_padded_at_the_end():
    assert stacked([jnp.ones((1, 2)), jnp.ones((2, 1))]).tolist() == [[[1, 1], [0, 0]], [[1, 0], [1, 0]]]
