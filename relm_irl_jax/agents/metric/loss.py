"""The loss of the metric agent: distances are fitted to costs to go, the policy to the actions of minimum cost.

    loss = mean w(s,g) (D(s,g) − N(s,g))² + mean w(s,g) (D(F(s)_a, g) − N(s'_a, g))²       w = 1 / (1 + N(s,g))
         + c_policy · mean KL( best actions ‖ π(· | s, g) )
         + c_successor · mean ‖F(s)_a − ψ(s'_a)‖²

over pairs of states and goals that the experience graph connects. C is the minimum cost to go on the graph under the
method's reward. N is the number of steps of that path, or C itself (`metric.counts`). The best actions are those that
lead to the smallest C, within `metric.tolerance`; they have equal probability.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agents.metric.costs_to_go import CostsToGo, SceneStates
from relm_irl_jax.agents.metric.experience_graph import UNTRIED
from relm_irl_jax.agents.metric.network import DistanceForm, Embeddings, pairwise_distances
from relm_irl_jax.rewards.goals import Goals


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class LossWeights:
    """Numbers of the loss, see `relm_irl_jax.agents.settings.MetricSettings`.

    Attributes:
        target_share: share of the drawn goals that are training targets.
        policy: c_policy.
        successor: c_successor.
        tolerance: largest difference between costs to go that count as equal, in mean steps.
        inverse_temperature: β, factor of the distances in the policy's logits.
    """

    target_share: Float32[Array, ""]
    policy: Float32[Array, ""]
    successor: Float32[Array, ""]
    tolerance: Float32[Array, ""]
    inverse_temperature: Float32[Array, ""]


@dataclass(frozen=True)
class LossForm:
    """The static part of the loss.

    Attributes:
        states: states of each scene to draw.
        goals: goals of each scene to draw.
        distance: form of the distance.
    """

    states: int
    goals: int
    distance: DistanceForm


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Losses:
    """Parts of the loss.

    Attributes:
        distance: weighted squared error of distances, in squared units of a mean step.
        policy: Kullback-Leibler divergence from the best actions, in nats.
        successor: squared distance of successor embeddings from those of the states reached.
    """

    distance: Float32[Array, "*updates"]
    policy: Float32[Array, "*updates"]
    successor: Float32[Array, "*updates"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class LossInputs:
    """The inputs of the loss.

    Attributes:
        scenes: states of each scene.
        goals: the goals.
        costs: costs to go.
        weights: numbers of the loss.
    """

    scenes: SceneStates
    goals: Goals
    costs: CostsToGo
    weights: LossWeights


def metric_loss(
    key: PRNGKeyArray, embeddings: Embeddings, inputs: LossInputs, form: LossForm
) -> tuple[Float32[Array, ""], Losses]:
    """The loss over drawn states and goals of every scene; pairs that the graph does not connect are left out.

    Args:
        key: source of randomness.
        embeddings: embeddings of all states of the world.
        inputs: scenes, goals and costs to go.
        form: numbers to draw and form of the distance. Static.

    Returns:
        The loss and its parts.
    """
    scenes, costs, weights = inputs.scenes, inputs.costs, inputs.weights
    local, column = draw_pairs(key, inputs, form)
    scene = jnp.arange(len(scenes.count))[:, None]
    goal = scenes.state[scene, jnp.take_along_axis(inputs.goals.state, column, 1)]
    drawn = jax.tree.map(lambda table: table[scenes.state[scene, local]], embeddings)
    goal_embedding = embeddings.state[goal]
    length, next_length, next_cost = regression_targets(local, column, costs)
    distance = pairwise_distances(drawn.state, goal_embedding, form.distance)
    successor = drawn.successor.reshape(len(scenes.count), -1, drawn.successor.shape[-1])
    next_distance = pairwise_distances(successor, goal_embedding, form.distance).reshape(next_cost.shape)
    weight = 1.0 / (1.0 + length)
    error = (weight * _squared_error(distance, length)).mean()
    next_error = (weight[:, :, None] * _squared_error(next_distance, next_length)).mean()

    is_best = (next_cost <= next_cost.min(2, keepdims=True) + weights.tolerance) & jnp.isfinite(next_cost)
    best = is_best.astype(jnp.float32)
    count = jnp.maximum(best.sum(2), 1.0)
    share = best / count[:, :, None]
    cross_entropy = -(share * jax.nn.log_softmax(-weights.inverse_temperature * next_distance, axis=2)).sum(2)
    entropy = jnp.log(count)
    decided = jnp.isfinite(length) & (length > 0) & is_best.any(2)
    policy = jnp.where(decided, cross_entropy - entropy, 0.0).mean()

    losses = Losses(error + next_error, policy, successor_error(embeddings, inputs, form))
    return losses.distance + weights.policy * policy + weights.successor * losses.successor, losses


def draw_pairs(
    key: PRNGKeyArray, inputs: LossInputs, form: LossForm
) -> tuple[Int32[Array, "scenes states"], Int32[Array, "scenes goals"]]:
    """Draw states and goals of every scene.

    Args:
        key: source of randomness.
        inputs: scenes and goals.
        form: how many to draw. Static.

    Returns:
        Local states, and columns of the goals.
    """
    state_key, goal_key = jax.random.split(key)
    kind_key, goal_key = jax.random.split(goal_key)
    scenes = len(inputs.scenes.count)
    local = jax.random.randint(state_key, (scenes, form.states), 0, inputs.scenes.count[:, None])
    trained = jax.random.bernoulli(kind_key, inputs.weights.target_share, (scenes, form.goals))
    among = jnp.where(trained, inputs.goals.trained[:, None], inputs.goals.count[:, None])
    return local, jax.random.randint(goal_key, (scenes, form.goals), 0, among)


def regression_targets(
    local: Int32[Array, "scenes states"], column: Int32[Array, "scenes goals"], costs: CostsToGo
) -> tuple[
    Float32[Array, "scenes states goals"],
    Float32[Array, "scenes states 4 goals"],
    Float32[Array, "scenes states 4 goals"],
]:
    """Costs to go for drawn states and goals, from the experience graph.

    Args:
        local: drawn states of each scene.
        column: drawn goals of each scene.
        costs: costs to go.

    Returns:
        N(s, g), N(s'_a, g) and C(s'_a, g); infinite where the graph has no path.
    """
    scene = jnp.arange(len(local))[:, None]
    successor = costs.successor[scene, local]
    untried = successor[..., None] == UNTRIED
    at_next = (scene[..., None, None], successor[..., None], column[:, None, None, :])
    length = costs.length[scene[..., None], local[:, :, None], column[:, None, :]]
    next_length, next_cost = (jnp.where(untried, jnp.inf, table[at_next]) for table in (costs.length, costs.cost))
    return length, next_length, next_cost


def successor_error(embeddings: Embeddings, inputs: LossInputs, form: LossForm) -> Float32[Array, ""]:
    """Mean squared distance of successor embeddings from the embeddings of the states that actions led to.

    Args:
        embeddings: embeddings of all states of the world.
        inputs: scenes and observed transitions.
        form: form of the distance. Static.

    Returns:
        The error, over all transitions observed.
    """
    scenes, successor = inputs.scenes, inputs.costs.successor
    valid = (jnp.arange(successor.shape[1]) < scenes.count[:, None])[..., None]
    known = valid & (successor != UNTRIED)
    reached = scenes.state[jnp.arange(len(successor))[:, None, None], jnp.maximum(successor, 0)]
    square = (embeddings.successor[scenes.state] - embeddings.state[reached]) ** 2
    parts = square.reshape(*square.shape[:-1], form.distance.groups, -1).sum(-1).mean(-1)
    return jnp.where(known, parts, 0.0).sum() / jnp.maximum(known.astype(jnp.float32).sum(), 1.0)


def _squared_error(distance: Float32[Array, "*pairs"], target: Float32[Array, "*pairs"]) -> Float32[Array, "*pairs"]:
    return jnp.where(jnp.isfinite(target), distance - target, 0.0) ** 2
