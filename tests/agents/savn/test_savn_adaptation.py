"""The interaction loss by hand, and the meta-gradient against finite differences in float64."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from relm_irl_jax import env
from relm_irl_jax.agents.savn.adaptation import (
    INTERACTION,
    Adaptation,
    Window,
    inner_step,
    interaction_loss,
    policy_logits,
)
from relm_irl_jax.agents.savn.update import Adapting, adapted_logits, hidden_layer

HEADS, BATCH, MEMORY, INTERVAL, WINDOWS = 2, 3, 4, 2, 3
NUMBERS = jnp.arange(HEADS, dtype=jnp.int32)


def test_the_interaction_loss_and_its_gradient_by_hand():
    """One episode, two steps, two units: the loss, and the change of the policy's bias that descends it."""
    hidden = jnp.asarray([[0.5, -1.0], [2.0, 0.25]]).reshape(2, 1, 1, 2)
    filters = np.zeros((2, 6, 2), np.float32)
    filters[0, :, 0] = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]  # of the first step: both units, and the first action
    filters[1, :, 1] = [-1.0, 0.0, 0.0, 0.0, 0.0, 1.0]  # of the second step: the first unit, and the last action
    interaction = {"filters": jnp.asarray(filters), "bias": jnp.asarray([0.5, 0.0])}
    uniform = jnp.full((2, 1, 1, 4), 0.25)
    first, second = 0.5 + 0.5 - 2.0 + 0.75, -2.0 + 0.25  # both below 0, where the slope is 0.01
    norm = 0.01 * np.hypot(first, second)
    np.testing.assert_allclose(interaction_loss(interaction, hidden, uniform), [[norm]], rtol=1e-4)

    parameters = {"params": {"policy_kernel": jnp.zeros((1, 4, 2)), "policy_bias": jnp.zeros((1, 1, 4))}}
    adaptation = Adaptation(jnp.int32(1), jnp.float32(10.0), "policy", 2, first_order=False)
    changed = inner_step(
        {**parameters, INTERACTION: interaction},
        Window(hidden, jnp.zeros_like(hidden)),
        adaptation.unchanged((1, 1), 2),
        jnp.zeros(1, jnp.int32),
        adaptation,
    )
    slope = np.asarray([first, second]) * 0.01 / np.hypot(first, second)  # ∂ℓ/∂ of what the filters give
    by_policy = np.asarray([3.0 * slope[0], 0, 0, 0]), np.asarray([0, 0, 0, slope[1]])
    softmax = np.eye(4) / 4 - 1 / 16  # ∂π/∂logits at the uniform policy
    expected = -10.0 * sum(softmax @ step for step in by_policy)
    np.testing.assert_allclose(changed["policy_bias"][0, 0], expected, rtol=1e-4)
    np.testing.assert_array_equal(changed["policy_kernel"], 0.0)  # the layer below is 0


def draw(generator, *shape):
    return jnp.asarray(generator.normal(size=shape))


@pytest.fixture(scope="module", params=["policy", "top"])
def problem64(request):
    """Everything above the memory in float64: an episode ends within the second window, another with the third."""
    with jax.enable_x64(True):
        generator = np.random.default_rng(0)
        parameters = {
            "params": {
                "head_kernel": draw(generator, HEADS, MEMORY, MEMORY),
                "head_bias": draw(generator, HEADS, 1, MEMORY),
                "policy_kernel": draw(generator, HEADS, 4, MEMORY),
                "policy_bias": draw(generator, HEADS, 1, 4),
            },
            INTERACTION: {"filters": draw(generator, INTERVAL, MEMORY + 4, 5), "bias": draw(generator, 5)},
        }
        hidden = draw(generator, WINDOWS * INTERVAL, HEADS, BATCH, MEMORY)
        weights = draw(generator, WINDOWS * INTERVAL, HEADS, BATCH, 4)
        over = np.zeros((WINDOWS * INTERVAL, HEADS, BATCH), bool)
        over[2, 0, 0] = over[5, 1, 2] = over[1, 1, 0] = True
        due = ~over.reshape(WINDOWS, INTERVAL, HEADS, BATCH).any(1)
        due[1, 1, 1] = False  # as many changes as are allowed
        adaptation = Adaptation(jnp.int32(9), jnp.asarray(0.3, jnp.float64), request.param, INTERVAL, False)
        first = jax.tree.map(lambda x: 0.1 * draw(generator, *x.shape), adaptation.unchanged((HEADS, BATCH), MEMORY))
        yield parameters, hidden, weights, jnp.asarray(over), Adapting(first, jnp.asarray(due)), adaptation


def objective(parameters, hidden, given, adaptation):
    weights, over, adapting = given
    steps = Window(hidden, jax.vmap(lambda h: hidden_layer(parameters, h, NUMBERS))(hidden))
    return (weights * adapted_logits(parameters, steps, over, adapting, adaptation)[0]).sum()


def slopes(function, leaves, tree, generator):
    """Direction and finite difference for each leaf."""
    for number, leaf in enumerate(leaves):
        direction = generator.normal(size=leaf.shape)
        values = [
            float(
                function(
                    jax.tree.unflatten(
                        tree, [x + s * direction * 1.0 if i == number else x for i, x in enumerate(leaves)]
                    )
                )
            )
            for s in (1e-6, -1e-6)
        ]
        yield number, direction, (values[0] - values[1]) / 2e-6


def test_the_full_meta_gradient_is_that_of_finite_differences(problem64):
    """With respect to the weights, to the interaction loss and to the memory's outputs."""
    with jax.enable_x64(True):
        parameters, hidden, *given, adaptation = problem64
        function = jax.jit(lambda x: objective(*x, given, adaptation))
        gradient = jax.tree.leaves(jax.jit(jax.grad(function))((parameters, hidden)))
        leaves, tree = jax.tree.flatten((parameters, hidden))
        for number, direction, slope in slopes(function, leaves, tree, np.random.default_rng(1)):
            assert abs(slope) > 1e-4
            assert float((gradient[number] * direction).sum()) == pytest.approx(slope, rel=1e-6)


@pytest.mark.slow
def test_the_first_order_meta_gradient_holds_the_weights_in_changes_fixed(problem64):
    """Finite differences where changes are computed at the weights as they are, by the loss that moves."""
    with jax.enable_x64(True):
        parameters, hidden, *given, adaptation = problem64
        first_order = dataclasses.replace(adaptation, first_order=True)
        weights, over, adapting = given

        def changes_of(interaction, at):
            """Δ in each window, by steps that are computed where the weights and Δ are given."""
            changes, change = [adapting.first], adapting.first
            for window in range(WINDOWS - 1):
                now = slice(window * INTERVAL, (window + 1) * INTERVAL)
                base, here = {**parameters, INTERACTION: interaction}, change if at is None else at[window]
                below = jax.vmap(lambda h: hidden_layer(parameters, h, NUMBERS))(hidden[now])
                after = inner_step(base, Window(hidden[now], below), here, NUMBERS, adaptation)
                moved = jax.tree.map(lambda old, new, from_here: old + new - from_here, change, after, here)
                change = env.select(adapting.due[window], moved, change)
                change = env.select(over[now].any(0), jax.tree.map(jnp.zeros_like, change), change)
                changes.append(change)
            return changes

        given_changes = changes_of(parameters[INTERACTION], None)

        def function(parameters_now):
            changes, total = changes_of(parameters_now[INTERACTION], given_changes), 0.0
            for window in range(WINDOWS):
                now = slice(window * INTERVAL, (window + 1) * INTERVAL)
                below = jax.vmap(lambda h: hidden_layer(parameters_now, h, NUMBERS))(hidden[now])
                changed = jnp.stack([~over[now][:k].any(0) for k in range(INTERVAL)])
                logits = policy_logits(parameters_now, Window(hidden[now], below), changes[window], NUMBERS, changed)
                total = total + (weights[now] * logits).sum()
            return total

        value = function(parameters)
        np.testing.assert_allclose(value, objective(parameters, hidden, given, first_order), rtol=1e-12)
        gradient = jax.jit(jax.grad(lambda p: objective(p, hidden, given, first_order)))(parameters)
        leaves, tree = jax.tree.flatten(parameters)
        moved = jax.jit(function)
        for number, direction, slope in slopes(moved, leaves, tree, np.random.default_rng(2)):
            found = float((jax.tree.leaves(gradient)[number] * direction).sum())
            assert found == pytest.approx(slope, rel=1e-6)
        full = jax.jit(jax.grad(lambda p: objective(p, hidden, given, adaptation)))(parameters)
        for name in ("filters", "bias"):
            assert not np.allclose(gradient[INTERACTION][name], 0)
        assert not np.allclose(full["params"]["policy_kernel"], gradient["params"]["policy_kernel"])
