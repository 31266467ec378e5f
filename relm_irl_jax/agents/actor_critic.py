"""The n-step advantage actor-critic loss (paper, Equations 18-22 and Algorithm 1), which several agents share."""

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float32

from relm_irl_jax.agents.rollout import Experience


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Outputs:
    """Outputs of the network.

    Attributes:
        logits: action logits.
        value: values, in units of the return scale.
    """

    logits: Float32[Array, "*batch 4"]
    value: Float32[Array, "*batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class LossWeights:
    """Numbers of the loss.

    Attributes:
        discount: γ.
        value: c_v, weight of the squared value error.
        entropy: c_e, weight of the policy's entropy.
        return_scale: rewards are divided by this, so that values are of order one.
    """

    discount: Float32[Array, ""]
    value: Float32[Array, ""]
    entropy: Float32[Array, ""]
    return_scale: Float32[Array, ""]


def n_step_returns(
    reward: Float32[Array, "time *batch"],
    terminated: Bool[Array, "time *batch"],
    truncated: Bool[Array, "time *batch"],
    next_value: Float32[Array, "time *batch"],
    discount: Float32[Array, ""],
) -> Float32[Array, "time *batch"]:
    """Discounted returns up to the end of the episode or of the rollout (Equation 18; Algorithm 1, lines 12-15).

        R_t = r_t                      if the step reached the target,
        R_t = r_t + γ V(s_{t+1})       if it was truncated or the rollout's last,
        R_t = r_t + γ R_{t+1}          otherwise.

    Termination sets the next value to zero; truncation does not.

    Args:
        reward: rewards.
        terminated: whether the step reached the target.
        truncated: whether the step reached the cap.
        next_value: value of the state after each step, before any reset.
        discount: γ.

    Returns:
        The returns.
    """

    def accumulate(next_return: Array, step: tuple[Array, ...]) -> tuple[Array, Array]:
        reward, terminated, truncated, next_value = step
        bootstrap = jnp.where(truncated, next_value, next_return)
        result = reward + discount * jnp.where(terminated, 0.0, bootstrap)
        return result, result

    _, returns = jax.lax.scan(accumulate, next_value[-1], (reward, terminated, truncated, next_value), reverse=True)
    return returns


def actor_critic_loss(
    outputs: Outputs,
    next_value: Float32[Array, "time groups batch"],
    experience: Experience,
    weights: LossWeights,
    reduce: Callable[[Float32[Array, "time groups batch"]], Float32[Array, ""]],
) -> Float32[Array, ""]:
    """Policy-gradient loss, value error and entropy over steps and workers (Equations 20-22).

        δ_t = R_t − V(s_t),   R_t from rewards divided by the return scale
        loss = mean( −log π(a_t|s_t) δ_t + c_v δ_t² − c_e H(π(·|s_t)) )

    where gradients flow neither through δ_t in the first term nor through R_t.

    Args:
        outputs: policy and value at each step.
        next_value: value of the state after each step.
        experience: the steps.
        weights: numbers of the loss.
        reduce: mean or sum over steps and workers.

    Returns:
        The loss.
    """
    returns = n_step_returns(
        experience.reward / weights.return_scale,
        experience.terminated,
        experience.truncated,
        jax.lax.stop_gradient(next_value),
        weights.discount,
    )
    delta = returns - outputs.value
    log_policy = jax.nn.log_softmax(outputs.logits)
    chosen = jnp.take_along_axis(log_policy, experience.action[..., None], -1)[..., 0]
    entropy = -(jnp.exp(log_policy) * log_policy).sum(-1)
    return reduce(-chosen * jax.lax.stop_gradient(delta) + weights.value * delta**2 - weights.entropy * entropy)
