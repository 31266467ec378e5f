"""Rollouts: every worker takes t_max steps with the same parameters."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax import env
from relm_irl_jax.env import Episode, TargetRange
from relm_irl_jax.rewards.functions import RewardFunction
from relm_irl_jax.types import Memory, Observation
from relm_irl_jax.world import Targets, World

Act = Callable[
    [PRNGKeyArray, Memory, Observation, Int32[Array, "groups batch"]],
    tuple[Memory, Int32[Array, "groups batch"], Any],
]
"""Maps a key and the memories, observations and targets of all workers to the next memories, the actions, and further
outputs that learning needs."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Workers:
    """The state of all workers between two steps.

    Attributes:
        episode: each worker's episode; every field is [groups, batch].
        memory: each worker's memory.
        collided: whether each worker's last action collided.
    """

    episode: Episode
    memory: Memory
    collided: Bool[Array, "*groups batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Experience:
    """Transitions of all workers; the leading axis is time.

    Attributes:
        state: state before the action.
        target: row of `Targets`.
        action: action taken.
        reward: reward received.
        next_state: state after the action, before any reset.
        terminated: the action reached the target.
        truncated: the action was the episode's last allowed one.
        output: the further outputs of `Act`.
    """

    state: Int32[Array, "*time groups batch"]
    target: Int32[Array, "*time groups batch"]
    action: Int32[Array, "*time groups batch"]
    reward: Float32[Array, "*time groups batch"]
    next_state: Int32[Array, "*time groups batch"]
    terminated: Bool[Array, "*time groups batch"]
    truncated: Bool[Array, "*time groups batch"]
    output: Any


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class EpisodeSums:
    """Sums over the episodes that ended, from which means are computed.

    Attributes:
        episodes: number of episodes that ended.
        successes: number of episodes that reached the target.
        excess_length: sum of path length minus shortest path, in actions.
        weighted_successes: sum of success weighted by path length.
        reward: sum of the rewards of all steps.
    """

    episodes: Float32[Array, "*updates"]
    successes: Float32[Array, "*updates"]
    excess_length: Float32[Array, "*updates"]
    weighted_successes: Float32[Array, "*updates"]
    reward: Float32[Array, "*updates"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class NavigationTask:
    """The constant inputs of a rollout.

    Attributes:
        world: the scenes.
        targets: the targets.
        target_range: targets from which each worker draws; every field is [groups, batch].
        reward: the reward function.
        cap: number of steps after which an episode is truncated.
    """

    world: World
    targets: Targets
    target_range: TargetRange
    reward: RewardFunction
    cap: Int32[Array, ""]


def sample_action(key: PRNGKeyArray, logits: Float32[Array, "*batch 4"]) -> Int32[Array, "*batch"]:
    """Draw actions from the softmax of logits, by inverting the cumulative distribution with one uniform number each.

    Args:
        key: source of randomness.
        logits: unnormalised log-probabilities.

    Returns:
        Action numbers.
    """
    cumulative = jnp.cumsum(jax.nn.softmax(logits), axis=-1)
    draw = jax.random.uniform(key, logits.shape[:-1]) * cumulative[..., -1]
    return (draw[..., None] >= cumulative[..., :-1]).sum(-1).astype(jnp.int32)


def choose_action(key: PRNGKeyArray, logits: Float32[Array, "*batch 4"], greedy: bool) -> Int32[Array, "*batch"]:
    """Choose the most probable actions, or draw actions from the policy.

    Args:
        key: source of randomness.
        logits: unnormalised log-probabilities.
        greedy: whether to take the most probable action. Static.

    Returns:
        Action numbers.
    """
    return jnp.argmax(logits, -1).astype(jnp.int32) if greedy else sample_action(key, logits)


def init_workers(key: PRNGKeyArray, task: NavigationTask, memory: Memory) -> Workers:
    """Start an episode for every worker.

    Args:
        key: source of randomness.
        task: the task.
        memory: memory of a worker before its first observation.

    Returns:
        The workers before their first action.
    """
    episode = env.reset_all(key, task.targets, task.target_range)
    return Workers(episode, memory, jnp.zeros(task.target_range.first.shape, bool))


def rollout(
    key: PRNGKeyArray, act: Act, workers: Workers, task: NavigationTask, initial_memory: Memory, length: int
) -> tuple[Workers, Experience, EpisodeSums]:
    """Step all workers `length` times; when an episode ends, the worker starts another one.

    Args:
        key: source of randomness.
        act: chooses actions.
        workers: the workers.
        task: the task.
        initial_memory: memory of a worker before its first observation.
        length: steps to take. Static.

    Returns:
        The next state of the workers, the experience, and sums over the episodes that ended.
    """
    reward_of = jax.vmap(jax.vmap(lambda transition: task.reward(transition, task.world, task.targets)))

    def advance(workers: Workers, key: PRNGKeyArray) -> tuple[Workers, tuple[Experience, EpisodeSums]]:
        action_key, reset_key = jax.random.split(key)
        episode = workers.episode
        observation = Observation(episode.state, workers.collided)
        memory, action, output = act(action_key, workers.memory, observation, episode.target)
        next_episode, transition = env.step(episode, action, task.world, task.targets, task.cap)
        reward = reward_of(transition)
        done = transition.terminated | transition.truncated
        shortest = env.shortest_path(next_episode, task.world, task.targets)
        ended, reached = done.astype(jnp.float32), transition.terminated.astype(jnp.float32)
        sums = EpisodeSums(
            episodes=ended.sum(),
            successes=reached.sum(),
            excess_length=(ended * (next_episode.steps - shortest).astype(jnp.float32)).sum(),
            weighted_successes=(reached * shortest.astype(jnp.float32) / next_episode.steps.astype(jnp.float32)).sum(),
            reward=reward.sum(),
        )
        next_workers = Workers(
            episode=env.select(done, env.reset_all(reset_key, task.targets, task.target_range), next_episode),
            memory=env.select(done, initial_memory, memory),
            collided=transition.collided & ~done,
        )
        experience = Experience(
            state=transition.state,
            target=transition.target,
            action=action,
            reward=reward,
            next_state=transition.next_state,
            terminated=transition.terminated,
            truncated=transition.truncated,
            output=output,
        )
        return next_workers, (experience, sums)

    workers, (experience, sums) = jax.lax.scan(advance, workers, jax.random.split(key, length))
    return workers, experience, jax.tree.map(jnp.sum, sums)
