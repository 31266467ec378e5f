"""Problems small enough to solve by hand, which isolate one part of the learner each.

One decision: does the policy find the better action, and the value its reward? A corridor: does the value of the next
state come back discounted? A room of nine places: values and shortest ways at every state.
"""

import jax
import jax.numpy as jnp
import numpy as np
from builders import grid_scene
from relm_irl_jax.agent.settings import SiameseSettings
from relm_irl_jax.agent.siamese.frames import forward, tabulate
from relm_irl_jax.agent.siamese.train import network_of, train
from relm_irl_jax.rewards.model import ManualReward

from relm_irl_jax.tasks import Target
from relm_irl_jax.world import Targets, World, build_targets, build_world


def line(n: int) -> tuple[World, Targets]:
    """States 0 … n in a row, the last one being the target; action 0 goes on, action 3 back, the others stay."""
    states = np.arange(n + 1)
    stay = states[:, None]
    successor = np.concatenate([np.minimum(stay + 1, n), stay, stay, np.maximum(stay - 1, 0)], axis=1)
    zeros = jnp.zeros(n + 1, jnp.int32)
    world = World(jnp.asarray(successor, jnp.int32), zeros, jnp.asarray(states), zeros, jnp.eye(n + 1))
    return world, Targets(
        state=jnp.asarray([n]),
        scene=jnp.asarray([0]),
        start=jnp.arange(n)[None],
        n_starts=jnp.asarray([n]),
        distance=jnp.asarray(n - states)[None],
    )


def learned(world, targets, reward, settings, frames):
    """Policy and value at every state, for the first target."""
    parameters, _ = train(jax.random.key(0), world, targets, reward, 1.0, 1, settings, 40, frames)
    network = network_of(settings, 1)
    tables = tabulate(network, parameters, world.features, targets.state)
    views = jnp.arange(len(world.scene))[None, :, None]
    out = forward(network, parameters, tables, views, jnp.zeros(views.shape[:2], jnp.int32), jnp.zeros(1, jnp.int32))
    return np.asarray(jax.nn.softmax(out.logits))[0], np.asarray(out.value)[0]


SETTINGS = SiameseSettings(
    width=32, workers=32, t_max=8, discount=0.5, entropy_weight=1e-3, value_weight=1.0, learning_rate=3e-3
)


def test_one_decision():
    """A bandit: the first action ends the episode with 1, each other one costs 0.5."""
    world, targets = line(1)
    reward = ManualReward(jnp.float32(1.0), jnp.float32(-0.5), jnp.float32(-0.5))
    policy, value = learned(world, targets, reward, SETTINGS, 60_000)
    assert policy[0, 0] > 0.97
    np.testing.assert_allclose(value[0], 1.0, atol=0.08)


def test_two_steps():
    """V(1) = 1 and V(0) = −0.1 + 0.5 · 1."""
    world, targets = line(2)
    reward = ManualReward(jnp.float32(1.0), jnp.float32(-0.5), jnp.float32(-0.1))
    policy, value = learned(world, targets, reward, SETTINGS, 100_000)
    assert (policy[:2, 0] > 0.97).all()
    np.testing.assert_allclose(value[:2], [0.4, 1.0], atol=0.08)


def test_nine_places():
    """Every step costs 0.2 but the last, which pays 0.2; d steps away V = 0.2 (γ^(d−1) − (1 − γ^(d−1)) / (1 − γ))."""
    scene = grid_scene(3, 3)
    world, targets = build_world([scene], [0]), build_targets([scene], [Target(0, 18)])
    reward = ManualReward(jnp.float32(0.2), jnp.float32(-0.2), jnp.float32(-0.2))
    settings = SiameseSettings(width=64, workers=128, t_max=8, discount=0.8, entropy_weight=0.05, value_weight=1.0)
    policy, value = learned(world, targets, reward, settings, 600_000)
    distance = scene.shortest_path_distance[:, 18].astype(float)
    away = distance > 0
    behind = scene.shortest_path_distance[np.asarray(world.successor), 18]
    assert (behind[away, policy[away].argmax(1)] == distance[away] - 1).all()
    power = 0.8 ** (distance - 1)
    by_hand = 0.2 * (power - (1 - power) / (1 - 0.8))
    np.testing.assert_allclose(value[away], by_hand[away], atol=0.06)
