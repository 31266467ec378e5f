"""One update on imagined targets: draw targets, walk with every worker, then take one gradient step.

Differences from `relm_irl_jax.agents.siamese.update`, which trains on few targets:

- Every update begins new episodes, with new targets; they are cut after t_max steps, and their return goes on with the
  value of the last state (truncation, not termination). Starts are therefore spread over all states from the beginning.
- A share of the episodes starts where a random walk from the target ends. Few others reach their target in t_max steps
  at first.
- Returns are λ-returns: n-step returns of many different targets have a large variance.

Equation 18 is the case λ = 1.
"""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agents.actor_critic import LossWeights, Outputs
from relm_irl_jax.agents.rollout import EpisodeSums
from relm_irl_jax.agents.siamese.imagined_targets import (
    DrawnPairs,
    PairsOfUpdate,
    draw_targets,
    evaluate_drawn,
)
from relm_irl_jax.agents.siamese.update import OptimizerNumbers, UpdateForm, make_optimizer
from relm_irl_jax.agents.training import apply_gradient, repeat_updates
from relm_irl_jax.types import Parameters
from relm_irl_jax.world import World

TRACE_DECAY = 0.95
"""λ of the returns."""

LONGEST_WALK = 30
"""Largest number of random actions between a target and a near start."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ImaginedInputs:
    """The constant inputs of an update.

    Attributes:
        world: the scenes.
        pairs: scenes and targets, of which an update draws some.
        collision: largest reward of an action that collides; infinite if collisions are paid like other actions.
        told: whether an episode ends at its target.
        given_share: share of given targets among those drawn.
        near_starts: share of the episodes that start near their target.
        loss: numbers of the loss.
        optimizer: numbers of the optimiser.
    """

    world: World
    pairs: DrawnPairs
    collision: Float32[Array, ""]
    told: Bool[Array, ""]
    given_share: Float32[Array, ""]
    near_starts: Float32[Array, ""]
    loss: LossWeights
    optimizer: OptimizerNumbers


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ImaginedState:
    """The state of a training between updates.

    Attributes:
        parameters: θ, the network's parameters.
        optimizer: the optimiser's state.
        key: source of the remaining randomness.
    """

    parameters: Parameters
    optimizer: optax.OptState
    key: PRNGKeyArray


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Steps:
    """The steps of all workers.

    Attributes:
        pair: pair of state and target before the action.
        action: action taken.
        reward: reward received.
        next_pair: pair after the action, before a new start.
        terminated: the episode ended at its target.
    """

    pair: Int32[Array, "*time workers"]
    action: Int32[Array, "*time workers"]
    reward: Float32[Array, "*time workers"]
    next_pair: Int32[Array, "*time workers"]
    terminated: Bool[Array, "*time workers"]


def near_starts(key: PRNGKeyArray, drawn: PairsOfUpdate) -> Int32[Array, "workers"]:
    """Begin a walk at each worker's target, and take up to `LONGEST_WALK` random actions.

    Args:
        key: source of randomness.
        drawn: the pairs.

    Returns:
        Pair of each worker's target with the state where its walk ends.
    """
    length_key, action_key = jax.random.split(key)
    workers = drawn.worker_target.shape
    length = jax.random.randint(length_key, workers, 1, LONGEST_WALK + 1)
    actions = jax.random.randint(action_key, (LONGEST_WALK, *workers), 0, 4)

    def step(pair: Array, taken: tuple[Array, Array]) -> tuple[Array, None]:
        number, action = taken
        return jnp.where(number < length, drawn.successor[pair, action], pair), None

    return jax.lax.scan(step, drawn.worker_target, (jnp.arange(LONGEST_WALK), actions))[0]


def walk(
    key: PRNGKeyArray, logits: Float32[Array, "pairs 4"], inputs: ImaginedInputs, drawn: PairsOfUpdate, length: int
) -> Steps:
    """Walk with all workers by the policy.

    Args:
        key: source of randomness.
        logits: the policy of every pair.
        inputs: scenes and pairs.
        drawn: the pairs.
        length: steps of each worker. Static.

    Returns:
        The steps.
    """
    pairs = inputs.pairs
    start_key, near_key, choice_key, step_key = jax.random.split(key, 4)
    workers = pairs.worker_first.shape
    anywhere = drawn.start(pairs, jax.random.uniform(start_key, workers))
    near = jax.random.uniform(choice_key, workers) < inputs.near_starts
    first = jnp.where(near, near_starts(near_key, drawn), anywhere)
    cumulative = jnp.cumsum(jax.nn.softmax(logits), -1)[:, :-1]

    def step(pair: Array, draw: Array) -> tuple[Array, Steps]:
        action = (draw[0][:, None] >= cumulative[pair]).sum(-1).astype(jnp.int32)
        following = drawn.successor[pair, action]
        reward = drawn.reward[following]
        reward = jnp.where(following == pair, jnp.minimum(reward, inputs.collision), reward)
        # An episode that is told of arrivals and starts at its target takes one step there.
        terminated = drawn.arrived[following] & inputs.told
        taken = Steps(pair, action, reward, following, terminated)
        return jnp.where(terminated, drawn.start(pairs, draw[1]), following), taken

    return jax.lax.scan(step, first, jax.random.uniform(step_key, (length, 2, *workers)))[1]


def returns_of(steps: Steps, value: Float32[Array, "pairs"], loss: LossWeights) -> Float32[Array, "time workers"]:
    """λ-returns of all steps.

        R_t = r_t                                          if the step reached the target and was told so,
        R_t = r_t + γ ((1 − λ) V(s_{t+1}) + λ R_{t+1})     otherwise, with R = V after the last step.

    Args:
        steps: the steps.
        value: value of every pair.
        loss: numbers of the loss.

    Returns:
        The returns, in units of the return scale.
    """
    next_value = value[steps.next_pair]

    def accumulate(following: Array, step: tuple[Array, ...]) -> tuple[Array, Array]:
        reward, terminated, next_value = step
        mixed = (1.0 - TRACE_DECAY) * next_value + TRACE_DECAY * following
        result = reward + loss.discount * jnp.where(terminated, 0.0, mixed)
        return result, result

    columns = (steps.reward / loss.return_scale, steps.terminated, next_value)
    return jax.lax.scan(accumulate, next_value[-1], columns, reverse=True)[1]


def loss_of_pairs(
    outputs: Outputs, steps: Steps, returns: Float32[Array, "time workers"], weights: LossWeights
) -> Float32[Array, ""]:
    """The loss of `relm_irl_jax.agents.actor_critic`, summed up for each pair before anything is differentiated.

    Args:
        outputs: policy and value of every pair.
        steps: the steps.
        returns: their returns.
        weights: numbers of the loss.

    Returns:
        The loss.
    """
    pair, action = steps.pair.reshape(-1), steps.action.reshape(-1)
    target = jax.lax.stop_gradient(returns.reshape(-1))
    advantage = target - jax.lax.stop_gradient(outputs.value)[pair]
    n_pairs, share = len(outputs.value), 1.0 / pair.size
    visits = jnp.zeros(n_pairs).at[pair].add(share)
    advantages = jnp.zeros((n_pairs, 4)).at[pair, action].add(advantage * share)
    mean_return = jnp.zeros(n_pairs).at[pair].add(target * share) / jnp.maximum(visits, share / 2)
    log_policy = jax.nn.log_softmax(outputs.logits)
    entropy = -(jnp.exp(log_policy) * log_policy).sum(-1)
    error = visits * (mean_return - outputs.value) ** 2
    return (weights.value * error - weights.entropy * visits * entropy - (advantages * log_policy).sum(-1)).sum()


def update_on_imagined(
    state: ImaginedState, inputs: ImaginedInputs, form: UpdateForm
) -> tuple[ImaginedState, EpisodeSums]:
    """Draw targets, walk t_max steps with every worker, then take one gradient step.

    Args:
        state: the state of training.
        inputs: scenes, targets, rewards and numbers.
        form: the static part. Static.

    Returns:
        The next state of training, and sums over the episodes. An episode here ends at its target or after t_max steps;
        its shortest path is not known, so that path lengths are NaN.
    """
    key, target_key, walk_key = jax.random.split(state.key, 3)
    drawn = draw_targets(target_key, inputs.pairs, inputs.given_share)

    def evaluate(parameters: Parameters) -> Outputs:
        return evaluate_drawn(form.network, parameters, inputs.world, inputs.pairs, drawn)

    outputs, vjp = jax.vjp(evaluate, state.parameters)
    steps = walk(walk_key, outputs.logits, inputs, drawn, form.t_max)
    returns = returns_of(steps, outputs.value, inputs.loss)
    gradient = vjp(jax.grad(loss_of_pairs)(outputs, steps, returns, inputs.loss))[0]
    optimizer = make_optimizer(form, inputs.optimizer)
    parameters, optimizer_state = apply_gradient(optimizer, gradient, state.optimizer, state.parameters)
    arrived = drawn.arrived[steps.next_pair]
    arrivals = jnp.where(inputs.told, arrived.sum(), arrived.any(0).sum()).astype(jnp.float32)
    cut = jnp.where(inputs.told, (~arrived[-1]).sum(), arrived.shape[1] - arrived.any(0).sum())
    unknown = jnp.float32(jnp.nan)
    sums = EpisodeSums(arrivals + cut.astype(jnp.float32), arrivals, unknown, unknown, steps.reward.sum())
    return ImaginedState(parameters, optimizer_state, key), sums


@partial(jax.jit, static_argnames=("form", "updates"))
def run_imagined_updates(
    state: ImaginedState, inputs: ImaginedInputs, *, form: UpdateForm, updates: int
) -> tuple[ImaginedState, EpisodeSums]:
    """Run several updates as one program.

    Args:
        state: the state of training.
        inputs: scenes, targets, rewards and numbers.
        form: the static part. Static.
        updates: number of updates. Static.

    Returns:
        The next state of training, and sums over the episodes.
    """
    return repeat_updates(lambda carry: update_on_imagined(carry, inputs, form), state, updates)
