"""The recurrent network against one written in NumPy: outputs, resets and the gradient through time."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies
from tiny import RECURRENT, problem

from relm_irl_jax.agents.recurrent.training import init_train_state, make_network, update_inputs
from relm_irl_jax.agents.recurrent.unroll import episode_starts, unroll
from relm_irl_jax.agents.recurrent.update import collect, sequence_gradient

CAP = 6
"""Short episodes, so that every rollout has resets."""


def sigmoid(x):
    return 1.0 / (1.0 + np.exp(-x))


def plain(parameters, features, target_state, sequences, lstm):
    """Logits and values [time, heads, batch] in float64."""
    p = jax.tree.map(lambda x: np.asarray(x, np.float64), parameters["params"])
    experience, seen = sequences.experience, sequences.experience.output.seen
    starts = np.asarray(episode_starts(experience))
    hidden = np.asarray(sequences.first.hidden, np.float64)
    cell = np.asarray(sequences.first.cell, np.float64) if lstm else None
    encode = lambda state: np.maximum(features[state] @ p["shared"]["kernel"] + p["shared"]["bias"], 0)  # noqa: E731
    logits, values = [], []
    for t in range(len(starts)):
        hidden = np.where(starts[t][..., None], 0.0, hidden)
        view, target, action, collided = (np.asarray(x[t]) for x in vars(seen).values())
        fusion = encode(view) @ p["fusion_state"]["kernel"] + p["fusion_state"]["bias"]
        fusion = fusion + encode(target_state[target]) @ p["fusion_target"]["kernel"]
        event = np.where((action < 0)[..., None], 0.0, p["event"][2 * action + collided])
        u = np.maximum(fusion + event, 0)
        x = u @ p["input"]["kernel"] + p["input"]["bias"]
        h = hidden @ p["recurrent_kernel"]
        if lstm:
            cell = np.where(starts[t][..., None], 0.0, cell)
            enter, keep, out, candidate = np.split(x + h, 4, -1)
            cell = sigmoid(keep + 1) * cell + sigmoid(enter) * np.tanh(candidate)
            hidden = sigmoid(out) * np.tanh(cell)
        else:
            (xr, xz, xn), (hr, hz, hn) = np.split(x, 3, -1), np.split(h, 3, -1)
            candidate = np.tanh(xn + sigmoid(xr + hr) * (hn + p["candidate_bias"]))
            hidden = (1 - sigmoid(xz + hz + 1)) * candidate + sigmoid(xz + hz + 1) * hidden
        top = np.maximum(np.einsum("gbw,gwv->gbv", hidden + u, p["head_kernel"]) + p["head_bias"], 0)
        logits.append(np.einsum("gbw,gaw->gba", top, p["policy_kernel"]) + p["policy_bias"])
        values.append((np.einsum("gbw,gow->gbo", top, p["value_kernel"]) + p["value_bias"])[..., 0])
    return np.stack(logits), np.stack(values)


def plain_loss(logits, values, sequences, weights):
    """The loss by hand; what the actions and returns were stays fixed."""
    experience = sequences.experience
    reward, next_value = np.asarray(experience.reward), np.asarray(sequences.next_value)
    terminated, truncated = np.asarray(experience.terminated), np.asarray(experience.truncated)
    following, returns = next_value[-1], []
    for t in reversed(range(len(reward))):
        after = np.where(truncated[t], next_value[t], following)
        following = reward[t] / float(weights.return_scale) + float(weights.discount) * np.where(
            terminated[t], 0, after
        )
        returns.append(following)
    returns = np.stack(returns[::-1])
    log_policy = logits - np.log(np.exp(logits).sum(-1, keepdims=True))
    chosen = np.take_along_axis(log_policy, np.asarray(experience.action)[..., None], -1)[..., 0]
    advantage = returns - np.asarray(experience.output.value)
    entropy = -(np.exp(log_policy) * log_policy).sum(-1)
    value_error = (returns - values) ** 2
    return (-chosen * advantage + float(weights.value) * value_error - float(weights.entropy) * entropy).mean()


@pytest.fixture(scope="module", params=["gru", "lstm"])
def collected(request):
    """A rollout in the middle of episodes, with larger weights of the policy than at first."""
    chosen = dataclasses.replace(RECURRENT, cell=request.param, t_max=5)
    given_problem = problem(cap=CAP)
    inputs, n_heads = update_inputs(given_problem, chosen, "recurrent")
    network = make_network(chosen, n_heads)
    state = init_train_state(jax.random.key(0), inputs, network)
    p = dict(state.parameters["params"])
    p["policy_kernel"] = p["policy_kernel"] * 300.0
    p["candidate_bias" if request.param == "gru" else "head_bias"] += 0.3
    state = dataclasses.replace(state, parameters={"params": p})
    act = jax.jit(lambda key, state: collect(key, state, inputs.task, network, 5))
    workers, *_ = act(jax.random.key(1), state)
    state = dataclasses.replace(state, workers=workers)
    return request.param == "lstm", given_problem, inputs, network, state, act


def test_the_gradient_goes_through_time_as_in_numpy(collected):
    lstm, given_problem, inputs, network, state, act = collected
    _, sequences, _ = act(jax.random.key(2), state)
    assert np.asarray(episode_starts(sequences.experience)).any()
    assert np.abs(np.asarray(sequences.first.hidden)).max() > 0.1
    features = np.asarray(given_problem.world.features, np.float64)
    target_state = np.asarray(given_problem.targets.state)
    reference = lambda parameters: plain(parameters, features, target_state, sequences, lstm)  # noqa: E731
    _, values = reference(state.parameters)
    np.testing.assert_allclose(sequences.experience.output.value, values, atol=1e-5, rtol=1e-4)
    gradient = jax.jit(lambda theta: sequence_gradient(network, theta, inputs, sequences))(state.parameters)
    leaves, tree = jax.tree.flatten(state.parameters)
    generator = np.random.default_rng(3)
    for number, leaf in enumerate(leaves):
        direction = generator.normal(size=leaf.shape)
        moved = []
        for step in (1e-6, -1e-6):
            exact = [np.asarray(x, np.float64) for x in leaves]
            exact[number] = exact[number] + step * direction
            moved.append(plain_loss(*reference(jax.tree.unflatten(tree, exact)), sequences, inputs.loss))
        slope = (moved[0] - moved[1]) / 2e-6
        found = float((np.asarray(jax.tree.leaves(gradient)[number], np.float64) * direction).sum())
        assert abs(slope) > 1e-6
        assert found == pytest.approx(slope, rel=2e-3, abs=1e-5)


def test_the_next_value_is_that_of_the_agent_which_goes_on(collected):
    """Within an episode the value at the next step; after truncation that of an agent that has not been reset."""
    *_, state, act = collected
    _, sequences, _ = act(jax.random.key(2), state)
    experience, record = sequences.experience, sequences.experience.output
    done = np.asarray(experience.terminated | experience.truncated)
    goes_on = ~done[:-1]
    next_value, value = np.asarray(sequences.next_value), np.asarray(record.value)
    np.testing.assert_array_equal(next_value[:-1][goes_on], value[1:][goes_on])
    assert np.asarray(experience.truncated).any()
    fresh = np.asarray(experience.truncated)[:-1]
    assert not np.isclose(next_value[:-1][fresh], value[1:][fresh]).any()


@given(strategies.integers(0, 2**31 - 1))
@settings(max_examples=8, deadline=None)
def test_nothing_is_remembered_of_an_earlier_episode(collected, seed):
    """The memory at the first step of an episode is that of an agent that has seen nothing else."""
    _, _, _, network, state, act = collected
    _, sequences, _ = act(jax.random.key(seed), state)
    experience, record = sequences.experience, sequences.experience.output
    starts = episode_starts(experience)
    hidden = unroll(network, state.parameters, sequences.first, record.inputs, starts)
    np.testing.assert_allclose(network.recall(record.recurrent, record.inputs), hidden, atol=1e-6)
    alone = unroll(network, state.parameters, sequences.first, record.inputs, jnp.ones_like(starts))
    at_start = np.asarray(starts)
    np.testing.assert_allclose(np.asarray(hidden)[at_start], np.asarray(alone)[at_start], atol=1e-6)
    assert (np.asarray(record.seen.last_action)[at_start] == -1).all()
    assert not np.asarray(record.seen.collided)[at_start].any()
    later = ~at_start & (np.arange(len(at_start)) > 0)[:, None, None]
    actions = np.asarray(experience.action)
    assert (np.asarray(record.seen.last_action)[1:][later[1:]] == actions[:-1][later[1:]]).all()
    assert not np.allclose(np.asarray(hidden)[later], np.asarray(alone)[later], atol=1e-3)
