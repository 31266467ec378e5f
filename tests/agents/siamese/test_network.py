"""The network in all its forms against a plain one in NumPy: outputs, and gradients by finite differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny import problem

from relm_irl_jax.agents.actor_critic import Outputs
from relm_irl_jax.agents.siamese.forward import passes_by_frames, passes_by_pairs
from relm_irl_jax.agents.siamese.network import SiameseActorCritic
from relm_irl_jax.agents.siamese.state_target_pairs import state_target_pairs
from relm_irl_jax.agents.siamese.training import init_parameters

PROBLEM = problem()
WORLD, TARGETS = PROBLEM.world, PROBLEM.targets
PREDICTED = -np.abs(np.sin(np.arange(120.0))).reshape(3, 40)

# Two steps of two workers for each head, with four views each, the latest first.
STATE = np.asarray([[[1, 5, 5], [17, 20, 39]], [[2, 5, 0], [18, 20, 16]]])
VIEWS = np.stack([STATE, (STATE + 1) % 40, STATE, 39 - STATE], -1)
TARGET = np.asarray([[[0, 1, 1], [2, 2, 2]], [[0, 1, 0], [2, 2, 2]]])


def network_and_parameters(history, observe_reward):
    network = SiameseActorCritic(n_heads=2, width=8, history=history, observe_reward=observe_reward, uniform=True)
    parameters = init_parameters(jax.random.key(1), network, WORLD)
    generator = np.random.default_rng(2)
    moved = lambda p: p + 0.1 * generator.normal(size=p.shape).astype(np.float32)  # noqa: E731  biases are not 0
    return network, jax.tree.map(moved, parameters)


def plain(parameters, history, observe_reward):
    """The equations of the network's docstring, frame by frame, in float64."""
    p = jax.tree.map(lambda x: np.asarray(x, np.float64), parameters["params"])
    features, relu = np.asarray(WORLD.features, np.float64), lambda x: np.maximum(x, 0)
    target_state = np.asarray(TARGETS.state)
    logits, value = np.empty((*TARGET.shape, 4)), np.empty(TARGET.shape)
    for index in np.ndindex(*TARGET.shape):
        head, row = index[1], TARGET[index]
        encode = lambda views: relu(  # noqa: E731
            np.concatenate(features[views]) @ p["shared"]["kernel"] + p["shared"]["bias"]
        )
        current = encode(VIEWS[index][:history])
        wanted = encode(np.repeat(target_state[row], history))
        fusion = (
            current @ p["fusion_state"]["kernel"] + p["fusion_state"]["bias"] + wanted @ p["fusion_target"]["kernel"]
        )
        if observe_reward:
            fusion = fusion + PREDICTED[row, VIEWS[index][0]] * p["fusion_reward"]
        hidden = relu(relu(fusion) @ p["head_kernel"][head] + p["head_bias"][head, 0])
        logits[index] = p["policy_kernel"][head] @ hidden + p["policy_bias"][head, 0]
        value[index] = p["value_kernel"][head, 0] @ hidden + p["value_bias"][head, 0, 0]
    return logits, value


def loss(logits, value):
    return np.sin(logits).sum() + np.cos(value).sum()


@pytest.mark.parametrize("form", ["frames", "tables", "pairs"])
@pytest.mark.parametrize(("history", "observe_reward"), [(1, True), (4, False)])
def test_every_form_computes_the_network_and_its_gradient(form, history, observe_reward):
    if form == "pairs" and history > 1:
        pytest.skip("pairs are for one view")
    network, parameters = network_and_parameters(history, observe_reward)
    predicted = jnp.asarray(PREDICTED, jnp.float32) if observe_reward else None
    targets = type(TARGETS)(**{**vars(TARGETS), "predicted_reward": predicted})
    pairs = state_target_pairs(WORLD, targets, np.arange(2), 2)
    views, target = jnp.asarray(VIEWS[..., :history], jnp.int32), jnp.asarray(TARGET, jnp.int32)

    @jax.jit
    def outputs_and_gradient(parameters):
        if form == "pairs":
            forward, backward = passes_by_pairs(network, parameters, WORLD, targets, pairs)
        else:
            frames = 1000 if form == "tables" else 12
            forward, backward = passes_by_frames(network, parameters, WORLD, targets, frames)
        steps = [forward(views[t], target[t]) for t in range(2)]
        evaluated = jax.tree.map(lambda *x: jnp.stack(x), *steps)
        outputs = evaluated.outputs
        return outputs, backward(evaluated, Outputs(jnp.cos(outputs.logits), -jnp.sin(outputs.value)))

    outputs, gradient = outputs_and_gradient(parameters)
    logits, value = plain(parameters, history, observe_reward)
    np.testing.assert_allclose(outputs.logits, logits, atol=1e-5, rtol=1e-5)
    np.testing.assert_allclose(outputs.value, value, atol=1e-5, rtol=1e-5)
    generator = np.random.default_rng(3)
    leaves, tree = jax.tree.flatten(parameters)
    for number, leaf in enumerate(leaves):
        direction = generator.normal(size=leaf.shape)
        moved = [
            jax.tree.unflatten(
                tree, [np.asarray(x, np.float64) + s * direction if i == number else x for i, x in enumerate(leaves)]
            )
            for s in (1e-6, -1e-6)
        ]
        slope = (
            loss(*plain(moved[0], history, observe_reward)) - loss(*plain(moved[1], history, observe_reward))
        ) / 2e-6
        assert abs(slope) > 1e-6
        found = float((np.asarray(jax.tree.leaves(gradient)[number], np.float64) * direction).sum())
        assert found == pytest.approx(slope, rel=1e-3, abs=1e-4)


def test_pairs_are_numbered_head_by_head():
    """Three scenes of two types, whose heads are not in the order of the scenes."""
    pairs = state_target_pairs(WORLD, TARGETS, np.asarray([1, 0]), 2)
    assert [len(state) for state in pairs.state] == [24, 32]
    state, target = (np.concatenate([np.asarray(x) for x in columns]) for columns in (pairs.state, pairs.target))
    for number, (s, g) in enumerate(zip(state, target, strict=True)):
        assert WORLD.scene[s] == TARGETS.scene[g]
        assert pairs.index(WORLD, jnp.int32(s), jnp.int32(g)) == number


def test_uniform_weights_lie_within_one_over_the_root_of_the_inputs():
    network = SiameseActorCritic(n_heads=2, width=64, history=4, uniform=True)
    weights = init_parameters(jax.random.key(0), network, WORLD)["params"]
    inputs = [(weights["shared"]["kernel"], 4 * 12)]
    inputs += [(weights[name]["kernel"], 2 * 64) for name in ("fusion_state", "fusion_target")]
    inputs += [(weights[name], 64) for name in ("head_kernel", "policy_kernel", "value_kernel")]
    for weight, count in inputs:
        largest = float(jnp.abs(weight).max())
        assert 0.95 / np.sqrt(count) < largest <= 1 / np.sqrt(count)
