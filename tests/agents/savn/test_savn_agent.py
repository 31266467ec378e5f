"""The agent that adapts: without inner steps it is the recurrent agent; interrupted; what its policies change."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from interruption import assert_same, interrupt, resume
from tiny import CHUNK, RECURRENT, SAVN, problem

from relm_irl_jax.agents.recurrent.agent import RecurrentAgent
from relm_irl_jax.agents.recurrent.training import make_network
from relm_irl_jax.agents.recurrent.unroll import episode_starts, unroll
from relm_irl_jax.agents.recurrent.update import UpdateInputs, sequence_gradient
from relm_irl_jax.agents.savn.adaptation import INTERACTION, Window
from relm_irl_jax.agents.savn.agent import SavnAgent
from relm_irl_jax.agents.savn.training import init_train_state, meta_inputs
from relm_irl_jax.agents.savn.update import adapted_logits, collect, ends, hidden_layer, meta_gradient
from relm_irl_jax.errors import InputError
from relm_irl_jax.evaluation import trace_episodes
from relm_irl_jax.types import Observation, TrainingLog

FRAMES = 2 * CHUNK
KEY = jax.random.key(5)


def trained(log, **changes):
    return SavnAgent(dataclasses.replace(SAVN, inner_rate=3.0, **changes)).train(KEY, problem(FRAMES * 2), log)


@pytest.fixture(scope="module")
def adapted():
    return trained(TrainingLog())


def rollout_of(settings, cap=20, rollouts=1):
    """A rollout of new weights, after some others."""
    inputs, n_heads = meta_inputs(problem(cap=cap), settings)
    network, windows = make_network(settings, n_heads), settings.t_max // settings.interval
    state = init_train_state(KEY, inputs, network)
    act = jax.jit(lambda key, s: collect(key, s, inputs, network, windows))
    for number in range(rollouts - 1):
        workers, *_ = act(jax.random.key(number), state)
        state = dataclasses.replace(state, workers=workers)
    return network, inputs, state, act(jax.random.key(rollouts), state)


@pytest.mark.slow
def test_without_inner_steps_the_gradient_is_that_of_the_recurrent_agent():
    network, inputs, state, (_, (sequences, adapting), _) = rollout_of(dataclasses.replace(SAVN, inner_steps=0))
    assert not np.asarray(adapting.due).any()
    found = jax.jit(lambda theta: meta_gradient(network, theta, inputs, sequences, adapting))(state.parameters)
    plain = UpdateInputs(inputs.task, inputs.loss, inputs.optimizer)
    theta = {"params": state.parameters["params"]}
    expected = jax.jit(lambda theta: sequence_gradient(network, theta, plain, sequences))(theta)
    for name, value in jax.tree_util.tree_leaves_with_path(expected):
        assert np.asarray(value).any(), name
    for one, other in zip(jax.tree.leaves(found["params"]), jax.tree.leaves(expected["params"]), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6, rtol=1e-4)
    assert not any(np.asarray(x).any() for x in jax.tree.leaves(found[INTERACTION]))


def test_a_policy_without_inner_steps_acts_as_the_recurrent_policy(adapted):
    """And one with inner steps does not: the trained interaction loss changes what it does."""
    parameters, given = adapted[0], problem()
    plain = RecurrentAgent(RECURRENT).policy({"params": parameters["params"]}, given.world, given.targets)

    def paths(policy):
        return trace_episodes(jax.random.key(2), policy, given.world, given.targets, 20)[0]

    settings = dataclasses.replace(SAVN, inner_rate=100.0)
    np.testing.assert_array_equal(
        paths(SavnAgent(settings, inner_steps=0).policy(parameters, given.world, given.targets)), paths(plain)
    )
    assert (paths(SavnAgent(settings).policy(parameters, given.world, given.targets)) != paths(plain)).any()


def test_weights_change_after_every_interval_and_at_most_so_often(adapted):
    parameters, given = adapted[0], problem()
    policy = SavnAgent(SAVN).policy(parameters, given.world, given.targets)
    shape = (2, 1)
    memory, view = policy.init(shape), jnp.asarray([[0], [16]], jnp.int32)
    act = jax.jit(policy.act)
    kernels, changes = [], []
    for _ in range(10):
        observation = Observation(view, jnp.zeros(shape, bool))
        memory, _ = act(KEY, memory, observation, jnp.asarray([[0], [2]], jnp.int32))
        kernels.append(np.asarray(memory.worker.change["policy_kernel"]))
        changes.append(int(memory.worker.changes[0, 0]))
    assert changes == [0, 1, 1, 2, 2, 3, 3, 3, 3, 3]
    moved = [bool((kernels[t] != kernels[t - 1]).any()) for t in range(1, 10)]
    assert moved == [True, False, True, False, True, False, False, False, False]


def test_learning_sees_the_weights_that_acted():
    """The same changes again lead to the workers' weights, with episodes that end in the midst of windows."""
    settings = dataclasses.replace(SAVN, inner_rate=10.0, workers=16, t_max=8)
    network, inputs, state, (after, (sequences, adapting), _) = rollout_of(settings, cap=9, rollouts=3)
    experience, theta = sequences.experience, state.parameters
    due, over = np.asarray(adapting.due), np.asarray(ends(experience))
    in_windows = over.reshape(4, 2, *over.shape[1:])
    assert due.any()
    assert in_windows[:, 0].any()
    assert not (due & in_windows.any(1)).any()
    hidden = unroll(network, theta, sequences.first, experience.output.inputs, episode_starts(experience))
    below = jax.vmap(lambda h: hidden_layer(theta, h, jnp.arange(2, dtype=jnp.int32)))(hidden)
    _, change = adapted_logits(theta, Window(hidden, below), ends(experience), adapting, inputs.adaptation)
    assert np.asarray(change["policy_kernel"]).any()
    for name, value in change.items():
        np.testing.assert_allclose(value, after.memory.change[name], atol=1e-5)
        assert not np.asarray(value)[over[-1]].any()
    assert not np.asarray(after.memory.changes)[over[-1]].any()


def test_an_interrupted_training_ends_the_same(adapted, tmp_path):
    interrupt(tmp_path, lambda log: trained(log))
    result, _ = resume(tmp_path, lambda log: trained(log))
    assert_same(adapted, result)


def test_rollouts_are_whole_windows():
    with pytest.raises(InputError, match=r"savn\.t_max: 4 is no multiple of savn\.interval, 3"):
        SavnAgent(dataclasses.replace(SAVN, interval=3)).train(KEY, problem(), TrainingLog())
