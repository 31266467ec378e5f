"""Worker processes, own rewards, and the adapters to other interfaces."""

import subprocess
import sys
import warnings

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from builders import grid_scene, labelled
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from relm_irl_jax import env
from relm_irl_jax.errors import InputError
from relm_irl_jax.gym import NavigationEnv, NavigationVectorEnv, functional_env, stable_baselines3_env


@pytest.fixture(scope="module")
def room():
    return labelled(grid_scene(3, 3), 4, np.random.default_rng(0))


# JAX, which this process uses, warns of every fork.
@pytest.mark.filterwarnings("ignore:os.fork:RuntimeWarning", "ignore:This process .* is multi-threaded")
def test_forked_workers_step_as_this_process_does(room):
    makers = [lambda: NavigationEnv(room, cap=5)] * 2
    rewards = []
    for kind in (SyncVectorEnv, AsyncVectorEnv):  # the default context, which forks
        environments = kind(makers)
        environments.reset(seed=3)
        rewards.append([environments.step(np.array([n % 4, 1]))[1].tolist() for n in range(12)])
        environments.close()
    assert rewards[0] == rewards[1]
    assert len(set(map(tuple, rewards[0]))) > 1


# In a process of its own, since this one has loaded JAX.
def test_stepping_loads_no_jax(tmp_path):
    program = """
import sys, numpy, relm_irl_jax
from builders import grid_scene
from relm_irl_jax.gym import NavigationEnv, NavigationVectorEnv
for make in (NavigationEnv, lambda room: NavigationVectorEnv(3, room)):
    environment = make(grid_scene(2, 2))
    environment.reset(seed=0)
    environment.step(environment.action_space.sample())
print("jax" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd="tests", check=True)
    assert done.stdout == "False\n"


@pytest.mark.parametrize("action", [7, -1, 1.0, None, "MoveAhead"])
def test_what_is_no_action_is_refused(room, action):
    environment = NavigationEnv(room)
    environment.reset(seed=0)
    with pytest.raises(gymnasium.error.InvalidAction, match=r"is no action; give 0 \(MoveAhead\), 1 \(RotateRight\)"):
        environment.step(action)
    environment.step(np.int64(3))


@pytest.mark.parametrize("actions", [[0, 4], [0, -1], [0], [0.0, 1.0], 2])
def test_what_are_no_actions_are_refused(room, actions):
    environments = NavigationVectorEnv(2, room)
    environments.reset(seed=0)
    with pytest.raises(gymnasium.error.InvalidAction):
        environments.step(actions)


def test_an_own_reward_is_paid_by_all_environments(room):
    def reward(t):  # features are one-hot: the product is 1 where the view is unchanged
        return 5.0 * t.arrived - t.view @ t.next_view - 0.1 * t.action

    single, many = NavigationEnv(room, 7, reward=reward), NavigationVectorEnv(2, room, 7, reward=reward)
    functional, params = functional_env(single.problem)
    single.reset(seed=0)
    many.reset(seed=0)
    episode = env.Episode(*(jnp.int32(n) for n in (single._states[0], 0, single._states[0], 0)))
    many._states[:] = single._states[0]
    for action in (1, 0, 2):
        state = single._states[0]
        _, own, arrived, _, _ = single.step(action)
        after = single._states[0]
        assert own == pytest.approx(5.0 * arrived - (after == state) - 0.1 * action)
        np.testing.assert_allclose(many.step(np.array([action] * 2))[1], own)
        _, episode, paid, _, _ = functional.step(jax.random.key(0), episode, action, params)
        assert float(paid) == pytest.approx(own, abs=1e-6)


def test_the_functional_environment_is_the_same_process(room):
    functional, params = functional_env(NavigationEnv(room, cap=6).problem)
    step = jax.jit(jax.vmap(functional.step, in_axes=(0, 0, 0, None)))
    _, state = jax.vmap(functional.reset, in_axes=(0, None))(jax.random.split(jax.random.key(0), 64), params)
    generator, distances = np.random.default_rng(0), room.shortest_path_distance
    targets = np.asarray(params.targets.state)
    successors = np.asarray(params.world.successor)
    ends = 0
    for number in range(15):
        actions = generator.integers(4, size=64).astype(np.int32)
        before, row, steps = (np.asarray(x) for x in (state.state, state.target, state.steps))
        keys = jax.random.split(jax.random.key(number), 64)
        observation, state, reward, done, facts = step(keys, state, actions, params)
        after = successors[before, actions]
        arrived = after == targets[row]
        np.testing.assert_array_equal(facts["terminated"], arrived)
        np.testing.assert_array_equal(facts["truncated"], (steps + 1 >= 6) & ~arrived)
        np.testing.assert_array_equal(facts["distance"], distances[after, targets[row]])
        np.testing.assert_allclose(reward, np.where(arrived, 10, np.where(after == before, -0.1, -0.01)), rtol=1e-6)
        np.testing.assert_array_equal(np.asarray(state.state)[~done], after[~done])
        assert (np.asarray(state.steps)[done] == 0).all()
        np.testing.assert_array_equal(np.argmax(observation["view"], 1), state.state)
        ends += int(done.sum())
    assert ends > 64


def test_episodes_that_end_begin_again_at_once(room):
    environments = NavigationVectorEnv(64, room, cap=4, autoreset_mode="SameStep")
    environments.reset(seed=0)
    generator = np.random.default_rng(0)
    for _ in range(9):
        before, rows = environments._states[:, 0], environments._rows.copy()
        actions = generator.integers(4, size=64)
        _, _, terminated, truncated, facts = environments.step(actions)
        over = terminated | truncated
        after, target = environments.problem.successor[before, actions], environments.problem.tables.state[rows]
        np.testing.assert_array_equal(terminated, after == target)
        assert (facts["steps"][over] == 0).all()
        for agent in np.flatnonzero(over):
            assert facts["final_obs"][agent]["view"].argmax() == after[agent]
            assert facts["final_info"]["success"][agent] == terminated[agent]
            assert facts["final_info"]["steps"][agent] == 4 or terminated[agent]


def test_stable_baselines3_trains_on_many_agents(room):
    peer = pytest.importorskip("stable_baselines3", reason="stable-baselines3 (extra `peers`) is not installed")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        environment = stable_baselines3_env(NavigationVectorEnv(8, room, cap=9, autoreset_mode="SameStep"))
        learner = peer.PPO(
            "MultiInputPolicy", environment, n_steps=8, batch_size=32, policy_kwargs={"net_arch": [16]}, seed=0
        )
        learner.learn(256)
    assert len(learner.ep_info_buffer) > 0
    assert all(episode["l"] <= 9 for episode in learner.ep_info_buffer)
    assert {episode["r"] > 5 for episode in learner.ep_info_buffer} == {True, False}


def test_stable_baselines3_needs_resets_in_the_same_step(room):
    with pytest.raises(InputError, match='give autoreset_mode="SameStep"'):
        stable_baselines3_env(NavigationVectorEnv(2, room))
