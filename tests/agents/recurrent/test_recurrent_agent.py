"""The recurrent agent: the same again, interrupted, and a maze that only memory solves."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from interruption import assert_same, interrupt, resume
from maze import maze_problem
from tiny import CHUNK, RECURRENT, problem

from relm_irl_jax.agents.recurrent.agent import RecurrentAgent
from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.errors import InputError
from relm_irl_jax.evaluation import compute_metrics, evaluate
from relm_irl_jax.types import TrainingLog


def trained(log):
    return RecurrentAgent(RECURRENT).train(jax.random.key(5), problem(), log)


@pytest.fixture(scope="module")
def uninterrupted():
    return trained(TrainingLog())


def test_the_same_key_gives_the_same_agent(uninterrupted):
    assert_same(uninterrupted, trained(TrainingLog()))


def test_an_interrupted_training_ends_the_same(uninterrupted, tmp_path):
    interrupt(tmp_path, trained)
    result, moved = resume(tmp_path, trained)
    assert moved == [2 * CHUNK, CHUNK, CHUNK]
    assert_same(uninterrupted, result)


@pytest.mark.parametrize(
    ("changes", "cap", "message"),
    [
        ({"t_max": 16}, 10, r"recurrent\.t_max: 16 exceeds the cap of 10 steps"),
        ({"workers": 1}, 50, r"recurrent\.workers: 1 workers are too few for 2 heads"),
    ],
)
def test_settings_that_cannot_work_are_refused(changes, cap, message):
    agent = RecurrentAgent(dataclasses.replace(RECURRENT, **changes))
    with pytest.raises(InputError, match=message):
        agent.train(jax.random.key(0), problem(cap=cap, frames=CHUNK), TrainingLog())


def success(agent, given):
    parameters, _ = agent.train(jax.random.key(0), given, TrainingLog())
    policy = agent.policy(parameters, given.world, given.targets)
    episodes = evaluate(jax.random.key(1), policy, given.world, given.targets, given.cap, 400)
    return compute_metrics(episodes, 0).success_rate


@pytest.mark.slow
@pytest.mark.parametrize("cell", ["gru", "lstm"])
def test_only_memory_solves_the_maze(cell):
    """What the first view shows decides at the junction, three views later."""
    given = maze_problem(frames=400_000)
    sizes = {"workers": 64, "t_max": 8, "width": 16, "learning_rate": 2e-3, "entropy_weight": 0.01}
    memory = RecurrentAgent(dataclasses.replace(RECURRENT, cell=cell, **{**sizes, "memory": 16}))
    assert success(memory, given) > 0.95
    if cell == "gru":
        assert 0.3 < success(SiameseAgent(SiameseSettings(**sizes)), given) < 0.6


def test_the_maze_is_a_coin_toss_without_memory():
    """Its views beyond the first are the same on both sides."""
    given = maze_problem(frames=1)
    features = np.asarray(given.world.features)
    assert (features[1:4] == features[7:10]).all()
    assert (features[0] != features[6]).any()
    goals = np.asarray(given.targets.state)
    assert (features[goals[0]] == features[goals[1]]).all()
    np.testing.assert_array_equal(given.targets.start[:, 0], [0, 6])
    assert (jnp.asarray(given.targets.n_starts) == 1).all()
