"""A plain advantage actor-critic in JAX, in the manner of PureJaxRL, to compare the speed of training with.

Environment, rollout and gradient are one compiled program, as there. The network has the layers of the siamese
actor-critic (Section III of the paper): a shared layer for view and target, a fusion layer, a hidden layer, policy and
value. It evaluates every frame, while the siamese agent evaluates every pair of a state and a target once.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, cast

import flax.linen as nn
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float32, Int32, Key, PRNGKeyArray

from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.gym.functional import EnvParams, FunctionalEnv, Observation
from relm_irl_jax.types import TrainingProblem


class Network(nn.Module):
    """The siamese network, evaluated frame by frame."""

    width: int

    @nn.compact
    def __call__(self, observation: Observation) -> tuple[Float32[Array, "*batch 4"], Float32[Array, "*batch"]]:
        """Logits of the actions, and the value."""
        shared = nn.Dense(self.width)
        x = jnp.concatenate([nn.relu(shared(observation[name])) for name in ("view", "target")], -1)
        x = nn.relu(nn.Dense(self.width)(x))
        x = nn.relu(nn.Dense(self.width)(x))
        return nn.Dense(4)(x), nn.Dense(1)(x)[..., 0]


class Step(NamedTuple):
    """One step of all workers."""

    observation: Observation
    action: Int32[Array, " worker"]
    reward: Float32[Array, " worker"]
    done: Bool[Array, " worker"]


def plain_program(problem: TrainingProblem, settings: SiameseSettings, updates: int) -> Callable[[], Any]:
    """Several updates of the plain actor-critic as one compiled program.

    Args:
        problem: scenes, targets and cap; rewards are the hand-made ones.
        settings: width, numbers of workers and steps, and the numbers of the loss.
        updates: number of updates in a call.

    Returns:
        The program, which returns the parameters after the updates and the mean reward of each.
    """
    params = EnvParams(problem.world, problem.targets, jnp.int32(problem.cap))
    environment = FunctionalEnv(None, params)
    network = Network(settings.width)
    evaluate = cast(Callable[[Any, Observation], tuple[Array, Array]], network.apply)
    optimiser = optax.chain(optax.clip_by_global_norm(settings.gradient_clip), optax.adam(settings.learning_rate))
    advance = jax.vmap(partial(environment.step, params=params))

    def act(carry: tuple[Any, Observation, Any], key: PRNGKeyArray):
        parameters, observation, state = carry
        action_key, step_key = jax.random.split(key)
        logits, _ = evaluate(parameters, observation)
        action = jax.random.categorical(action_key, logits).astype(jnp.int32)
        keys = jax.random.split(step_key, settings.workers)
        following, state, reward, done, _ = advance(keys, state, action)
        return (parameters, following, state), Step(observation, action, reward / problem.return_scale, done)

    def loss(parameters: Any, steps: Step, returns: Float32[Array, "step worker"]) -> Float32[Array, ""]:
        logits, value = evaluate(parameters, steps.observation)
        log_probabilities = jax.nn.log_softmax(logits)
        chosen = jnp.take_along_axis(log_probabilities, steps.action[..., None], -1)[..., 0]
        entropy = -(jnp.exp(log_probabilities) * log_probabilities).sum(-1).mean()
        error = returns - value
        policy = -(chosen * jax.lax.stop_gradient(error)).mean()
        return policy + settings.value_weight * jnp.square(error).mean() - settings.entropy_weight * entropy

    def update(carry: tuple[Any, Any, Observation, Any], key: PRNGKeyArray):
        parameters, moments, observation, state = carry
        keys = jax.random.split(key, settings.t_max)
        (_, observation, state), steps = jax.lax.scan(act, (parameters, observation, state), keys)
        last = evaluate(parameters, observation)[1]

        def backward(following: Float32[Array, " worker"], step: Step):
            value = step.reward + jnp.where(step.done, 0.0, settings.discount * following)
            return value, value

        _, returns = jax.lax.scan(backward, last, steps, reverse=True)
        gradient = jax.grad(loss)(parameters, steps, returns)
        change, moments = optimiser.update(gradient, moments)
        return (optax.apply_updates(parameters, change), moments, observation, state), steps.reward.mean()

    @jax.jit
    def run(parameters: Any, moments: Any, observation: Observation, state: Any, keys: Key[Array, "_"]):
        (parameters, *_), reward = jax.lax.scan(update, (parameters, moments, observation, state), keys)
        return parameters, reward

    reset_key, init_key, update_key = jax.random.split(jax.random.key(0), 3)
    reset = jax.vmap(partial(environment.reset, params=params))
    observation, state = reset(jax.random.split(reset_key, settings.workers))
    parameters = network.init(init_key, observation)
    keys = jax.random.split(update_key, updates)
    return lambda: run(parameters, optimiser.init(parameters), observation, state, keys)
