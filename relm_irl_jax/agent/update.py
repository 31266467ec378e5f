"""Learning: the n-step advantage actor-critic loss (paper, Equations 18-22 and Algorithm 1) and one update of it.

All workers act from the same parameters θ and their gradients are averaged into one update: the synchronous limit
of A3C, in which no worker's gradient is stale.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float32, PRNGKeyArray

from relm_irl_jax.agent.networks import FusionTables, Parameters, SiameseActorCritic, policy_and_value, tabulate
from relm_irl_jax.agent.rollout import EpisodeSums, Experience, rollout
from relm_irl_jax.agent.settings import AgentSettings
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
    """

    world: World
    targets: Targets
    lane: Lane
    reward_model: RewardModel
    return_scale: Float32[Array, ""]


def optimiser_of(settings: AgentSettings) -> optax.GradientTransformation:
    """The optimiser: gradients clipped by their global norm, then Adam.

    Args:
        settings: the agent's settings.

    Returns:
        The gradient transformation.
    """
    return optax.chain(optax.clip_by_global_norm(settings.gradient_clip), optax.adam(settings.learning_rate))


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
    learner: Learner, setting: Setting, network: SiameseActorCritic, settings: AgentSettings, cap: int
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
    world, targets = setting.world, setting.targets
    heads = jnp.arange(network.n_heads)

    def evaluate(parameters: Parameters, tables: FusionTables, state: Array, target: Array) -> tuple[Array, Array]:
        return policy_and_value(network, parameters, tables, state, target, heads)

    tables, pull_back = jax.vjp(
        lambda parameters: tabulate(network, parameters, world.features, targets.state), learner.parameters
    )
    episode, experience, sums = rollout(
        rollout_key,
        lambda state, target: evaluate(learner.parameters, tables, state, target)[0],
        learner.episode,
        setting.lane,
        world,
        targets,
        setting.reward_model,
        jnp.int32(cap),
        settings.t_max,
    )

    def loss(parameters: Parameters, tables: FusionTables) -> Array:
        return actor_critic_loss(
            lambda state, target: evaluate(parameters, tables, state, target),
            experience,
            setting.return_scale,
            settings,
        )

    of_heads, of_tables = jax.grad(loss, argnums=(0, 1))(learner.parameters, tables)
    gradient = jax.tree.map(jnp.add, of_heads, pull_back(of_tables)[0])
    change, optimiser = optimiser_of(settings).update(gradient, learner.optimiser, learner.parameters)
    parameters = cast(Parameters, optax.apply_updates(learner.parameters, change))
    return Learner(parameters, optimiser, episode, key), sums


def actor_critic_loss(
    outputs: Callable[[Array, Array], tuple[Array, Array]],
    experience: Experience,
    return_scale: Float32[Array, ""],
    settings: AgentSettings,
) -> Float32[Array, ""]:
    """Policy-gradient loss, value error and entropy, averaged over steps and workers (Equations 20-22).

        δ_t = R_t − V(s_t),   R_t from rewards divided by the return scale
        loss = mean( −log π(a_t|s_t) δ_t + c_v δ_t² − c_e H(π(·|s_t)) )

    with δ_t held fixed in the first term. The values behind the rollout's last step and behind a truncated step are
    evaluated apart; since the cap is not below t_max, a worker is truncated at most once in a rollout.

    Args:
        outputs: maps states and targets [groups, batch] to logits and values.
        experience: the steps.
        return_scale: divisor of returns.
        settings: the agent's settings.

    Returns:
        The loss.
    """
    groups, batch = experience.state.shape[1:]

    def evaluate(state: Array, target: Array) -> tuple[Array, Array]:
        """Fold time into the batch, so that every group is one large product."""
        folded = [jnp.moveaxis(x, 0, 1).reshape(groups, -1) for x in (state, target)]
        unfold = lambda y: jnp.moveaxis(y.reshape(groups, -1, batch, *y.shape[2:]), 1, 0)  # noqa: E731
        logits, value = outputs(folded[0], folded[1])
        return unfold(logits), unfold(value)

    logits, value = evaluate(experience.state, experience.target)
    cut = jnp.argmax(experience.truncated, axis=0)[None]
    behind = [experience.next_state[-1:], jnp.take_along_axis(experience.next_state, cut, 0)]
    whose = [experience.target[-1:], jnp.take_along_axis(experience.target, cut, 0)]
    _, (behind_last, behind_cut) = evaluate(jnp.concatenate(behind), jnp.concatenate(whose))
    next_value = jnp.concatenate([jnp.where(experience.truncated[:-1], behind_cut, value[1:]), behind_last[None]])
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
    return (
        -chosen * jax.lax.stop_gradient(delta) + settings.value_weight * delta**2 - settings.entropy_weight * entropy
    ).mean()
