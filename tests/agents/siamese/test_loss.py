"""Returns and loss of the actor-critic against hand computation."""

import jax.numpy as jnp
import numpy as np
import pytest

from relm_irl_jax.agents.actor_critic import LossWeights, Outputs, actor_critic_loss, n_step_returns
from relm_irl_jax.agents.rollout import Experience
from relm_irl_jax.agents.siamese.forward import Evaluation
from relm_irl_jax.agents.siamese.next_values import next_values


def returns(reward, terminated, truncated, next_value):
    as_float = [jnp.asarray(reward, jnp.float32), jnp.asarray(terminated), jnp.asarray(truncated)]
    return n_step_returns(*as_float, jnp.asarray(next_value, jnp.float32), jnp.float32(0.5)).tolist()


def test_returns_bootstrap_after_the_last_step():
    assert returns([1, 1, 1], [False] * 3, [False] * 3, [0, 0, 8]) == [2.75, 3.5, 5.0]


def test_termination_does_not_bootstrap():
    assert returns([1, 1, 1], [False, True, False], [False] * 3, [9, 9, 8]) == [1.5, 1.0, 5.0]


def test_truncation_bootstraps_with_the_next_state():
    assert returns([1, 1, 1], [False] * 3, [False, True, False], [9, 4, 8]) == [2.5, 3.0, 5.0]


def test_loss_equals_a_hand_written_loop():
    """One worker that observes two views, four steps: truncated at the second, terminated at the third."""
    generator = np.random.default_rng(2)
    logits, value = generator.normal(size=(10, 4)), generator.normal(size=(10, 10))
    state, earlier, next_state = [0, 1, 2, 3], [0, 0, 2, 3], [1, 7, 8, 9]
    action, reward = [1, 0, 3, 2], [0.5, -1.0, 2.0, 0.25]
    column = lambda values, dtype: jnp.asarray(values, dtype).reshape(4, 1, 1)  # noqa: E731
    outputs = Outputs(
        logits=jnp.asarray(logits[state], jnp.float32).reshape(4, 1, 1, 4),
        value=column(value[state, earlier], jnp.float32),
    )
    views = jnp.stack([column(state, jnp.int32), column(earlier, jnp.int32)], -1)
    experience = Experience(
        state=column(state, jnp.int32),
        target=column([0, 0, 0, 0], jnp.int32),
        action=column(action, jnp.int32),
        reward=column(reward, jnp.float32),
        next_state=column(next_state, jnp.int32),
        terminated=column([False, False, True, False], bool),
        truncated=column([False, True, False, False], bool),
        output=Evaluation(outputs, views, column([0, 0, 0, 0], jnp.int32), None),
    )
    next_value = next_values(lambda v, t: jnp.asarray(value, jnp.float32)[v[..., 0], v[..., 1]], experience)
    weights = LossWeights(jnp.float32(0.9), jnp.float32(0.5), jnp.float32(0.1), jnp.float32(2.0))
    loss = actor_critic_loss(outputs, next_value, experience, weights, jnp.mean)
    total = actor_critic_loss(outputs, next_value, experience, weights, jnp.sum)

    last = 0.125 + 0.9 * value[9, 3]
    third = 1.0
    second = -0.5 + 0.9 * value[7, 1]
    first = 0.25 + 0.9 * second
    expected = 0.0
    for s, e, a, R in zip(state, earlier, action, [first, second, third, last], strict=True):
        probability = np.exp(logits[s]) / np.exp(logits[s]).sum()
        delta = R - value[s, e]
        entropy = -(probability * np.log(probability)).sum()
        expected += (-np.log(probability[a]) * delta + 0.5 * delta**2 - 0.1 * entropy) / 4
    assert float(loss) == pytest.approx(expected, rel=1e-5)
    assert float(total) == pytest.approx(4 * expected, rel=1e-5)
