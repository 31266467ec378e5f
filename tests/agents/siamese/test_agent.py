"""The siamese agent on problems whose solution is known, with several seeds and devices, and interrupted."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene
from interruption import assert_same, interrupt, resume
from tiny import CHUNK, SMALL, problem

from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.agents.siamese.joint_seeds import stack_padded
from relm_irl_jax.rewards.equation import LinearRewardForm
from relm_irl_jax.rewards.functions import LinearReward, ManualReward
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import Target
from relm_irl_jax.types import TrainingLog, TrainingProblem
from relm_irl_jax.world import build_targets, build_world


def corridor(n: int, features: np.ndarray, name: str) -> Scene:
    """States 0 … n in a row; action 0 goes on, action 3 goes back, the others stay."""
    states = np.arange(n + 1)
    blocked = np.full(n + 1, -1)
    graph = np.stack([np.where(states < n, states + 1, -1), blocked, blocked, states - 1], axis=1).astype(np.int32)
    distance = np.abs(states[:, None] - states).astype(np.int32)
    location = np.stack([0.5 * states, 0 * states], axis=1).astype(float)
    return Scene(name, name, location, np.zeros(n + 1), graph, distance, features=features[: n + 1])


@pytest.fixture(scope="module")
def solved():
    """A decision (a corridor of 2 states), a corridor of 3 and a room of 9 places, each with a head of its own.

    Entering the target pays 1, a collision costs 0.5 and any other step 0.1; γ = 0.8.
    """
    features = np.eye(41, dtype=np.float32)
    scenes = [
        corridor(1, features, "decision"),
        corridor(2, features[2:], "corridor"),
        grid_scene(3, 3, name="room-0", features=features[5:]),
    ]
    targets = [Target(0, 1), Target(1, 2), Target(2, 18)]
    world = build_world(scenes)
    reward = ManualReward(jnp.float32(1.0), jnp.float32(-0.5), jnp.float32(-0.1))
    settings = SiameseSettings(
        width=64,
        workers=192,
        t_max=8,
        discount=0.8,
        entropy_weight=0.05,
        value_weight=1.0,
        learning_rate=3e-3,
        decay="none",
        initialisation="he",
        heads="room_type",
        imagine="none",
    )
    tables = build_targets(scenes, targets)
    agent = SiameseAgent(settings)
    parameters, _ = agent.train(jax.random.key(0), TrainingProblem(world, tables, reward, 40, 1_200_000), TrainingLog())
    policy = agent.policy(parameters, world, tables)
    rows = []
    for row, (scene, first) in enumerate(zip(scenes, (0, 2, 5), strict=True)):
        index = policy.pairs.index(world, first + jnp.arange(scene.n_states), jnp.full(scene.n_states, row))
        rows.append((np.asarray(jax.nn.softmax(policy.outputs.logits[index])), np.asarray(policy.outputs.value[index])))
    return scenes, rows


def test_one_decision(solved):
    """A bandit: the first action ends the episode with 1, each other one costs 0.5."""
    policy, value = solved[1][0]
    assert policy[0, 0] > 0.95
    np.testing.assert_allclose(value[0], 1.0, atol=0.1)


def test_two_steps(solved):
    """V(1) = 1 and V(0) = −0.1 + 0.8 · 1."""
    policy, value = solved[1][1]
    assert (policy[:2, 0] > 0.95).all()
    np.testing.assert_allclose(value[:2], [0.7, 1.0], atol=0.1)


def test_nine_places(solved):
    """d steps away V = γ^(d−1) − 0.1 (1 − γ^(d−1)) / (1 − γ), and every action shortens the path."""
    scenes, rows = solved
    policy, value = rows[2]
    distance = scenes[2].shortest_path_distance[:, 18].astype(float)
    away = distance > 0
    next_distance = scenes[2].shortest_path_distance[np.maximum(scenes[2].graph, 0), 18]
    next_distance = np.where(scenes[2].graph < 0, distance[:, None], next_distance)
    assert (next_distance[away, policy[away].argmax(1)] == distance[away] - 1).all()
    power = 0.8 ** (distance - 1)
    np.testing.assert_allclose(value[away], (power - 0.1 * (1 - power) / 0.2)[away], atol=0.1)


def trained(log):
    return SiameseAgent(SMALL).train(jax.random.key(5), problem(), log)


@pytest.fixture(scope="module")
def uninterrupted():
    return trained(TrainingLog())


def test_the_same_key_gives_the_same_agent(uninterrupted):
    assert_same(uninterrupted, trained(TrainingLog()))


def test_an_interrupted_training_ends_the_same(uninterrupted, tmp_path):
    interrupt(tmp_path, trained)
    assert [x.name for x in RunFolder(tmp_path).checkpoints("rl", 0).iterdir()] == ["2"]
    result, moved = resume(tmp_path, trained)
    assert moved == [2 * CHUNK, CHUNK, CHUNK]
    assert_same(uninterrupted, result)


def learned_reward(seed, rows):
    """Weights drawn at random, as many as the seed's targets happen to need."""
    generator = np.random.default_rng(seed)
    return LinearReward(
        weights=jnp.asarray(generator.normal(size=(rows, 5)), jnp.float32),
        row=jnp.asarray(generator.integers(0, rows, (3, 24)), jnp.int32),
        phi=jnp.asarray(generator.normal(size=(40, 5)), jnp.float32),
        form=LinearRewardForm(jnp.float32(1.0), jnp.float32(0.3), relative=True),
    )


@pytest.mark.slow
def test_joint_seeds_are_the_seeds_alone_and_can_be_interrupted(tmp_path):
    agent = SiameseAgent(SMALL)
    keys = [jax.random.key(5), jax.random.key(6)]
    problems = [problem(reward=learned_reward(seed, rows)) for seed, rows in ((0, 7), (1, 4))]
    joint = agent.train_jointly(keys, problems, TrainingLog())
    assert not np.allclose(*(jax.tree.leaves(parameters)[0] for parameters, _ in joint))
    parameters, curve = joint[0]
    alone, own = agent.train(keys[0], problems[0], TrainingLog())
    for a, b in zip(jax.tree.leaves(alone), jax.tree.leaves(parameters), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-5)
    np.testing.assert_array_equal(curve.episodes, own.episodes)
    np.testing.assert_allclose(curve.reward, own.reward, rtol=1e-5)
    interrupt(tmp_path, lambda log: agent.train_jointly(keys, problems, log))
    resumed, moved = resume(tmp_path, lambda log: agent.train_jointly(keys, problems, log))
    assert moved[0] == 2 * moved[1]
    for one, other in zip(joint, resumed, strict=True):
        assert_same(one, other)


def test_shorter_arrays_are_padded_at_the_end():
    (stacked,) = stack_padded([jnp.ones((1, 2)), jnp.ones((2, 1))])
    assert stacked.tolist() == [[[1, 1], [0, 0]], [[1, 0], [1, 0]]]
