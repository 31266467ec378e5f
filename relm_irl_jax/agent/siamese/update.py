"""Learning: the n-step advantage actor-critic loss (paper, Equations 18-22 and Algorithm 1) and one update of it.

All workers act from the same parameters θ and their gradients make one update: the synchronous limit of A3C, in which
no worker's gradient is stale. Where A3C's workers apply theirs one after the other, θ moves by the sum of them. Adam
moves as far by their mean, which does not depend on the number of workers and is the default; the original agent's
RMSProp (`optimiser_of`) is close to gradient descent and needs the sum.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agent.learning import Parameters
from relm_irl_jax.agent.rollout import Actor, EpisodeSums, Experience, rollout, sample_action
from relm_irl_jax.agent.settings import SiameseSettings
from relm_irl_jax.agent.siamese.network import Activations, SiameseActorCritic
from relm_irl_jax.agent.siamese.pairs import Outputs, Pairs
from relm_irl_jax.agent.siamese.passes import Forward, passes
from relm_irl_jax.env import Episode, Lane
from relm_irl_jax.rewards.model import RewardModel
from relm_irl_jax.world import Targets, World


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Learner:
    """Everything that training carries from update to update.

    Attributes:
        parameters: θ, the network's parameters.
        optimiser: the optimiser's state.
        episode: where each worker stands; every field is [groups, batch].
        key: source of all later randomness.
    """

    parameters: Parameters
    optimiser: optax.OptState
    episode: Episode
    key: PRNGKeyArray


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Setting:
    """What training looks up and never changes.

    Attributes:
        world: the training scenes.
        targets: the training targets.
        lane: targets that each worker may be sent to; every field is [groups, batch].
        reward_model: the reward.
        return_scale: returns are divided by this, so that values are of order one.
        pairs: every pair of a target and a state, where computing them all costs less than computing every frame.
    """

    world: World
    targets: Targets
    lane: Lane
    reward_model: RewardModel
    return_scale: Float32[Array, ""]
    pairs: Pairs | None = None


def optimiser_of(settings: SiameseSettings) -> optax.GradientTransformation:
    """The optimiser: gradients clipped by their global norm, then Adam, or the original agent's RMSProp:

        ν ← 0.99 ν + 0.01 g²,   θ ← θ − η g / √(ν + 0.1),   ν = 1 at first

    Where workers' gradients are summed, the bound is one worker's and counts once for each of them. η is constant, or
    falls along a line.

    Args:
        settings: the agent's settings.

    Returns:
        The gradient transformation.
    """
    rate = settings.learning_rate
    if settings.decay_frames is not None:
        rate = optax.linear_schedule(rate, 0.0, -(-settings.decay_frames // (settings.workers * settings.t_max)))
    if settings.optimizer == "adam":
        step = optax.adam(rate)
    else:
        step = optax.rmsprop(rate, decay=0.99, eps=0.1, initial_scale=1.0, eps_in_sqrt=True)
    bound = settings.gradient_clip * (settings.workers if settings.gradient == "sum" else 1)
    return optax.chain(optax.clip_by_global_norm(bound), step)


def n_step_returns(
    reward: Float32[Array, "time *batch"],
    terminated: Bool[Array, "time *batch"],
    truncated: Bool[Array, "time *batch"],
    next_value: Float32[Array, "time *batch"],
    discount: float,
) -> Float32[Array, "time *batch"]:
    """Discounted returns up to the end of the episode or of the rollout (Equation 18; Algorithm 1, lines 12-15).

        R_t = r_t                      if the step reached the target,
        R_t = r_t + γ V(s_{t+1})       if it was the episode's last allowed or the rollout's last,
        R_t = r_t + γ R_{t+1}          otherwise.

    Only reaching the target sets the value behind it to zero; running out of steps does not.

    Args:
        reward: rewards.
        terminated: whether the step reached the target.
        truncated: whether the step was the episode's last allowed one.
        next_value: value of the state after each step, before any reset.
        discount: γ.

    Returns:
        The returns.
    """

    def backward(following: Array, now: tuple[Array, ...]) -> tuple[Array, Array]:
        reward, terminated, truncated, next_value = now
        behind = jnp.where(truncated, next_value, following)
        result = reward + discount * jnp.where(terminated, 0.0, behind)
        return result, result

    _, returns = jax.lax.scan(backward, next_value[-1], (reward, terminated, truncated, next_value), reverse=True)
    return returns


def update(
    learner: Learner, setting: Setting, network: SiameseActorCritic, settings: SiameseSettings, cap: int
) -> tuple[Learner, EpisodeSums]:
    """Act t_max steps with every worker, then take one gradient step.

    Args:
        learner: the state of training.
        setting: scenes, targets, lanes and reward.
        network: the network. Static.
        settings: the agent's settings. Static.
        cap: number of steps after which an episode is truncated. Static.

    Returns:
        The next state of training, and sums over the episodes that ended.
    """
    key, rollout_key = jax.random.split(learner.key)
    frames = setting.lane.first.size * settings.t_max
    at, pull = passes(network, learner.parameters, setting.world, setting.targets, setting.pairs, frames)
    episode, experience, sums = rollout(
        rollout_key,
        sampling_actor(at),
        learner.episode,
        setting.lane,
        setting.world,
        setting.targets,
        setting.reward_model,
        jnp.int32(cap),
        settings.t_max,
    )
    next_value = values_behind(lambda views, target: at(views, target).value, experience)
    of_outputs = jax.grad(actor_critic_loss, argnums=(0, 1))(
        experience.record.logits,
        experience.record.value,
        next_value,
        experience,
        setting.return_scale,
        settings,
    )
    gradient = pull(experience, *of_outputs)
    change, optimiser = optimiser_of(settings).update(gradient, learner.optimiser, learner.parameters)
    return Learner(cast(Parameters, optax.apply_updates(learner.parameters, change)), optimiser, episode, key), sums


def sampling_actor(network: Forward) -> Actor:
    """Act by drawing from the policy, and keep the forward pass for learning.

    Args:
        network: the forward pass for last states and targets of all workers.

    Returns:
        The actor.
    """

    def act(key: PRNGKeyArray, views: Array, target: Array) -> tuple[Array, Activations | Outputs]:
        seen = network(views, target)
        return sample_action(key, seen.logits), seen

    return act


def values_behind(
    value: Callable[
        [Int32[Array, "groups batch history"], Int32[Array, "groups batch"]], Float32[Array, "groups batch"]
    ],
    experience: Experience,
) -> Float32[Array, "time groups batch"]:
    """Value of the state after each step, before any reset.

    Within an episode it is known from the next step; behind the rollout's last step and behind a truncated one it is
    computed here. Since the cap is not below t_max, a worker is truncated at most once in a rollout.

    Args:
        value: maps last states and targets to values.
        experience: the steps.

    Returns:
        The values; behind a step that reached the target, any number.
    """
    cut = jnp.argmax(experience.truncated, axis=0)[None]
    next_views = experience.next_views
    behind_cut = value(
        jnp.take_along_axis(next_views, cut[..., None], 0)[0], jnp.take_along_axis(experience.target, cut, 0)[0]
    )
    behind_last = value(next_views[-1], experience.target[-1])
    following = jnp.where(experience.truncated[:-1], behind_cut, experience.record.value[1:])
    return jnp.concatenate([following, behind_last[None]])


def actor_critic_loss(
    logits: Float32[Array, "time groups batch 4"],
    value: Float32[Array, "time groups batch"],
    next_value: Float32[Array, "time groups batch"],
    experience: Experience,
    return_scale: Float32[Array, ""],
    settings: SiameseSettings,
) -> Float32[Array, ""]:
    """Policy-gradient loss, value error and entropy over steps and workers (Equations 20-22).

        δ_t = R_t − V(s_t),   R_t from rewards divided by the return scale
        loss = mean( −log π(a_t|s_t) δ_t + c_v δ_t² − c_e H(π(·|s_t)) )

    with δ_t held fixed in the first term and R_t in both; the sum instead of the mean where the settings say so.

    Args:
        logits: action logits at each step.
        value: values at each step.
        next_value: value of the state after each step.
        experience: the steps.
        return_scale: divisor of returns.
        settings: the agent's settings.

    Returns:
        The loss.
    """
    returns = n_step_returns(
        experience.reward / return_scale,
        experience.terminated,
        experience.truncated,
        jax.lax.stop_gradient(next_value),
        settings.discount,
    )
    delta = returns - value
    log_policy = jax.nn.log_softmax(logits)
    chosen = jnp.take_along_axis(log_policy, experience.action[..., None], -1)[..., 0]
    entropy = -(jnp.exp(log_policy) * log_policy).sum(-1)
    return over_steps(
        -chosen * jax.lax.stop_gradient(delta) + settings.value_weight * delta**2 - settings.entropy_weight * entropy,
        settings,
    )


def over_steps(loss: Float32[Array, "*steps"], settings: SiameseSettings) -> Float32[Array, ""]:
    """The loss of an update from those of its steps.

    Args:
        loss: of each step of each worker.
        settings: the agent's settings.

    Returns:
        Mean or sum.
    """
    return loss.mean() if settings.gradient == "mean" else loss.sum()
