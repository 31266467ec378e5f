"""Behaviour cloning: whose decisions it sees, and that it imitates them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from interruption import assert_same, interrupt, resume
from tiny import SMALL, demonstrations, problem

from relm_irl_jax.agents.siamese.behaviour_cloning import BehaviourCloningAgent, decisions_by_head
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import Demonstrations, TrainingLog

AGENT = BehaviourCloningAgent(dataclasses.replace(SMALL, workers=16, learning_rate=3e-2))


def trained(log):
    return AGENT.train(jax.random.key(0), problem(frames=8_000), log)


@pytest.fixture(scope="module")
def uninterrupted():
    return trained(TrainingLog())


def test_views_before_the_start_are_the_first_one_repeated():
    state, step = jnp.asarray([7, 8, 3, 17], jnp.int32), jnp.asarray([0, 1, 2, 0], jnp.int32)
    same = jnp.zeros(4, jnp.int32)
    world = problem().world
    decisions = decisions_by_head(Demonstrations(state, same, same, step), world, np.arange(2), 3)
    assert decisions.views[0, :3].tolist() == [[7, 7, 7], [8, 7, 7], [3, 8, 7]]
    assert decisions.views[1, 0].tolist() == [17, 17, 17]


def test_decisions_are_sorted_by_head():
    shown = demonstrations()
    decisions = decisions_by_head(shown, problem().world, np.arange(2), 1)
    head = np.asarray(shown.target) // 2  # targets 0 and 1 are the first room's
    for number in range(2):
        own, count = head == number, int(decisions.count[number])
        assert count == own.sum()
        np.testing.assert_array_equal(decisions.views[number, :count, 0], np.asarray(shown.state)[own])
        np.testing.assert_array_equal(decisions.action[number, :count], np.asarray(shown.action)[own])


def test_demonstrated_decisions_are_imitated(uninterrupted):
    parameters, curve = uninterrupted
    assert curve.accuracy[-1] == 1.0
    assert curve.loss[-1] < 0.1 < curve.loss[0]
    assert curve.frames[-1] >= 8_000
    world, targets, shown = problem().world, problem().targets, demonstrations()
    policy = AGENT.policy(parameters, world, targets)
    logits = policy.outputs.logits[policy.pairs.index(world, shown.state, shown.target)]
    np.testing.assert_array_equal(logits.argmax(-1), shown.action)


def test_an_interrupted_cloning_ends_the_same(uninterrupted, tmp_path):
    interrupt(tmp_path, trained)
    assert_same(uninterrupted, resume(tmp_path, trained)[0])


def test_a_head_without_demonstrations_is_refused():
    shown = demonstrations()
    first = np.asarray(shown.target) < 2
    part = Demonstrations(*(jnp.asarray(np.asarray(column)[first]) for column in vars(shown).values()))
    with pytest.raises(InputError, match="has no demonstration"):
        decisions_by_head(part, problem().world, np.arange(2), 1)
