"""Acting: every worker takes t_max steps from the same parameters."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax import env
from relm_irl_jax.env import Episode, Lane
from relm_irl_jax.rewards.model import RewardModel
from relm_irl_jax.world import Targets, World

Actor = Callable[
    [PRNGKeyArray, Int32[Array, "groups batch history"], Int32[Array, "groups batch"]],
    tuple[Int32[Array, "groups batch"], Any],
]
"""Maps a key, last states (the latest first) and targets of all workers to one action each, and to what learning wants
kept beside it."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Experience:
    """Steps of all workers; the leading axis is time.

    Attributes:
        state: state before the action.
        earlier: states before that, the latest first, if any were observed.
        target: row of `Targets`.
        action: action taken.
        reward: reward received.
        next_state: state after the action, also where the episode ended.
        terminated: the action reached the target.
        truncated: the action was the episode's last allowed one.
        record: what the actor kept beside its action.
    """

    state: Int32[Array, "time groups batch"]
    earlier: Int32[Array, "time groups batch earlier"] | None
    target: Int32[Array, "time groups batch"]
    action: Int32[Array, "time groups batch"]
    reward: Float32[Array, "time groups batch"]
    next_state: Int32[Array, "time groups batch"]
    terminated: Bool[Array, "time groups batch"]
    truncated: Bool[Array, "time groups batch"]
    record: Any

    @property
    def views(self) -> Int32[Array, "time groups batch history"]:
        """States whose views were observed before the action, the latest first."""
        return env.last_states(self.state, self.earlier)

    @property
    def next_views(self) -> Int32[Array, "time groups batch history"]:
        """States whose views are observed after the action, the latest first, also where the episode ended."""
        earlier = None if self.earlier is None else self.views[..., :-1]
        return env.last_states(self.next_state, earlier)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class EpisodeSums:
    """Sums over the episodes that ended, from which rates and means follow.

    Attributes:
        episodes: episodes ended.
        successes: episodes that reached the target.
        excess: path length minus shortest path, summed, in actions.
        weighted: success weighted by path length, summed.
        reward: rewards of all steps, summed.
    """

    episodes: Float32[Array, "*time"]
    successes: Float32[Array, "*time"]
    excess: Float32[Array, "*time"]
    weighted: Float32[Array, "*time"]
    reward: Float32[Array, "*time"]


def sample_action(key: PRNGKeyArray, logits: Float32[Array, "*batch 4"]) -> Int32[Array, "*batch"]:
    """Draw actions from the softmax of logits with one uniform number each, by inverting the cumulative sum.

    Args:
        key: source of randomness.
        logits: unnormalised log-probabilities.

    Returns:
        Action numbers.
    """
    cumulative = jnp.cumsum(jax.nn.softmax(logits), axis=-1)
    draw = jax.random.uniform(key, logits.shape[:-1]) * cumulative[..., -1]
    return (draw[..., None] >= cumulative[..., :-1]).sum(-1).astype(jnp.int32)


def rollout(
    key: PRNGKeyArray,
    actor: Actor,
    episode: Episode,
    lane: Lane,
    world: World,
    targets: Targets,
    reward_model: RewardModel,
    cap: Int32[Array, ""],
    length: int,
) -> tuple[Episode, Experience, EpisodeSums]:
    """Step all workers `length` times; episodes that end are reset at once, start and target redrawn.

    Args:
        key: source of randomness.
        actor: the agent.
        episode: where each worker stands; every field is [groups, batch].
        lane: targets that each worker may be sent to; every field is [groups, batch].
        world: the scenes.
        targets: the targets.
        reward_model: the reward.
        cap: number of steps after which an episode is truncated.
        length: steps to take. Static.

    Returns:
        Where each worker stands afterwards, the experience and sums over the episodes that ended.
    """
    over_workers = lambda function: jax.vmap(jax.vmap(function))  # noqa: E731

    def advance(episode: Episode, key: PRNGKeyArray) -> tuple[Episode, tuple[Experience, EpisodeSums]]:
        action_key, reset_key = jax.random.split(key)
        action, record = actor(action_key, episode.views, episode.target)
        after, transition = over_workers(lambda e, a: env.step(e, a, world, targets, cap))(episode, action)
        reward = over_workers(lambda t: reward_model(t, world, targets))(transition)
        done = transition.terminated | transition.truncated
        shortest = over_workers(lambda e: env.shortest(e, world, targets))(after)
        ended, reached = done.astype(jnp.float32), transition.terminated.astype(jnp.float32)
        sums = EpisodeSums(
            episodes=ended.sum(),
            successes=reached.sum(),
            excess=(ended * (after.steps - shortest).astype(jnp.float32)).sum(),
            weighted=(reached * shortest.astype(jnp.float32) / after.steps.astype(jnp.float32)).sum(),
            reward=reward.sum(),
        )
        following = env.select(done, env.reset_all(reset_key, targets, lane, episode.views.shape[-1]), after)
        experience = Experience(
            state=transition.state,
            earlier=episode.earlier,
            target=transition.target,
            action=action,
            reward=reward,
            next_state=transition.next_state,
            terminated=transition.terminated,
            truncated=transition.truncated,
            record=record,
        )
        return following, (experience, sums)

    episode, (experience, sums) = jax.lax.scan(advance, episode, jax.random.split(key, length))
    return episode, experience, jax.tree.map(jnp.sum, sums)
