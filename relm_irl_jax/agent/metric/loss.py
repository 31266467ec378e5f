"""The loss of the metric agent: distances are to say what the way to a goal costs, choices to follow the least cost.

    loss = mean w(s,g) (D(s,g) − N(s,g))² + mean w(s,g) (D(F(s)_a, g) − N(s'_a, g))²       w = 1 / (1 + N(s,g))
         + c_choice · mean KL( best actions ‖ π(· | s, g) )
         + c_successor · mean ‖F(s)_a − ψ(s'_a)‖²

over pairs of states and goals that the experience graph connects. C is the least cost to go on it by the method's own
reward, N the number of steps of that way, or C itself (`costs`, `metric.counts`). The best actions are those that lead
to the least C, or to little more (`metric.tolerance`); they share the probability.

With `metric.bootstrap`, C and N are temporal-difference targets instead, held fixed: C(s'_a, g) = D(s'_a, g), or 0
where s'_a is g, and C(s, g) = c_g(s) + min_a C(s'_a, g).
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agent.metric.costs import Goals
from relm_irl_jax.agent.metric.experience import UNTRIED
from relm_irl_jax.agent.metric.network import Places, distances
from relm_irl_jax.agent.settings import MetricSettings
from relm_irl_jax.env import Lane
from relm_irl_jax.rewards.model import RewardModel
from relm_irl_jax.world import Targets, World


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Hindsight:
    """What the graph, as it was at some time, says about the goals.

    Attributes:
        following: local state behind each action, or `UNTRIED`.
        reach: C, least cost from each local state to each goal; infinite where the graph knows no way.
        length: N, what the distance between them is to say: the steps of that way, or its cost.
    """

    following: Int32[Array, "scenes locals 4"]
    reach: Float32[Array, "scenes locals goals"]
    length: Float32[Array, "scenes locals goals"]


def no_costs(following: Int32[Array, "scenes locals 4"], goals: Goals) -> Hindsight:
    """Transitions alone, with no way to any goal.

    Args:
        following: local state behind each action, or `UNTRIED`.
        goals: the goals.

    Returns:
        The transitions, every cost infinite.
    """
    nowhere = jnp.full((*following.shape[:2], goals.state.shape[1]), jnp.inf, jnp.float32)
    return Hindsight(following, nowhere, nowhere)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class MetricSetting:
    """What an update looks up and does not change.

    Attributes:
        world: the training scenes.
        targets: the training targets.
        lane: targets that each worker may be sent to; every field is [scenes, batch].
        reward_model: the reward, for the learning curve.
        goals: views that the agent sets itself as targets.
        state: world state of each scene's local states; rows are padded with the scene's first state.
        n_locals: number of states of each scene.
        hindsight: costs to go.
    """

    world: World
    targets: Targets
    lane: Lane
    reward_model: RewardModel
    goals: Goals
    state: Int32[Array, "scenes locals"]
    n_locals: Int32[Array, "scenes"]
    hindsight: Hindsight


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Losses:
    """Parts of the loss.

    Attributes:
        distance: weighted squared error of distances, in squared units of a mean step.
        choice: Kullback-Leibler divergence from the best actions, in nats.
        successor: squared distance of successor embeddings from what was met.
    """

    distance: Float32[Array, ""]
    choice: Float32[Array, ""]
    successor: Float32[Array, ""]


def hindsight_loss(
    key: PRNGKeyArray, places: Places, setting: MetricSetting, settings: MetricSettings
) -> tuple[Float32[Array, ""], Losses]:
    """The loss over drawn states and goals of every scene; pairs that the graph does not connect are left out.

    Args:
        key: source of randomness.
        places: places of all states of the world.
        setting: scenes, goals and costs to go.
        settings: the agent's settings. Static.

    Returns:
        The loss and its parts.
    """
    state_key, goal_key = jax.random.split(key)
    scenes = len(setting.n_locals)
    of_scene = jnp.arange(scenes)[:, None]
    local = jax.random.randint(state_key, (scenes, settings.states), 0, setting.n_locals[:, None])
    kind_key, goal_key = jax.random.split(goal_key)
    trained = jax.random.bernoulli(kind_key, settings.target_share, (scenes, settings.goals))
    among = jnp.where(trained, setting.goals.trained[:, None], setting.goals.count[:, None])
    column = jax.random.randint(goal_key, (scenes, settings.goals), 0, among)
    goal = setting.state[of_scene, jnp.take_along_axis(setting.goals.state, column, 1)]
    at = jax.tree.map(lambda table: table[setting.state[of_scene, local]], places)
    there = places.here[goal]
    wanted, wanted_behind, behind = (
        bootstrapped(local, column, places.here, setting, settings)
        if settings.bootstrap
        else remembered(local, column, setting.hindsight)
    )
    found = distances(at.here, there, settings)
    after = at.after.reshape(scenes, -1, at.after.shape[-1])
    found_behind = distances(after, there, settings).reshape(behind.shape)
    weight = 1 / (1 + wanted)
    squared = lambda found, wanted: jnp.where(jnp.isfinite(wanted), found - wanted, 0.0) ** 2  # noqa: E731
    error = (weight * squared(found, wanted)).mean()
    error_behind = (weight[:, :, None] * squared(found_behind, wanted_behind)).mean()

    best = (behind <= behind.min(2, keepdims=True) + settings.tolerance) & jnp.isfinite(behind)
    share = best / jnp.maximum(best.sum(2, keepdims=True), 1)
    cross = -(share * jax.nn.log_softmax(-settings.sharpness * found_behind, axis=2)).sum(2)
    decided = jnp.isfinite(wanted) & (wanted > 0) & best.any(2)
    choice = jnp.where(decided, cross - jnp.log(jnp.maximum(best.sum(2), 1)), 0.0).mean()

    met = setting.hindsight.following != UNTRIED
    known = (jnp.arange(met.shape[1]) < setting.n_locals[:, None])[..., None] & met
    arrived = setting.state[of_scene[..., None], jnp.maximum(setting.hindsight.following, 0)]
    apart = (places.after[setting.state] - places.here[arrived]) ** 2
    parts = apart.reshape(*apart.shape[:-1], settings.groups, -1).sum(-1).mean(-1)
    successor = jnp.where(known, parts, 0.0).sum() / jnp.maximum(known.sum(), 1)

    losses = Losses(error + error_behind, choice, successor)
    total = losses.distance + settings.choice_weight * choice + settings.successor_weight * successor
    return total, losses


Lessons = tuple[
    Float32[Array, "scenes states goals"],
    Float32[Array, "scenes states 4 goals"],
    Float32[Array, "scenes states 4 goals"],
]
"""What distances are to say from each state and from behind each action, and the cost to go behind each action;
infinite where nothing is known."""


def remembered(
    local: Int32[Array, "scenes states"],
    column: Int32[Array, "scenes goals"],
    hindsight: Hindsight,
) -> Lessons:
    """What the experience graph says about drawn states and goals.

    Args:
        local: drawn states of each scene.
        column: drawn goals of each scene.
        hindsight: transitions and costs to go.

    Returns:
        N(s, g), N(s'_a, g) and C(s'_a, g).
    """
    of_scene = jnp.arange(len(local))[:, None]
    following = hindsight.following[of_scene, local]
    untried = following[..., None] == UNTRIED
    beyond = (of_scene[..., None, None], following[..., None], column[:, None, None, :])
    length = hindsight.length[of_scene[..., None], local[:, :, None], column[:, None, :]]
    length_behind, behind = (
        jnp.where(untried, jnp.inf, known[beyond]) for known in (hindsight.length, hindsight.reach)
    )
    return length, length_behind, behind


def bootstrapped(
    local: Int32[Array, "scenes states"],
    column: Int32[Array, "scenes goals"],
    here: Float32[Array, "all dimension"],
    setting: MetricSetting,
    settings: MetricSettings,
) -> Lessons:
    """What the transitions met and the learned distance say about drawn states and goals.

    Args:
        local: drawn states of each scene.
        column: drawn goals of each scene.
        here: ψ of all states.
        setting: goals and transitions.
        settings: the agent's settings.

    Returns:
        C(s, g), C(s'_a, g) and again C(s'_a, g).
    """
    of_scene, here = jnp.arange(len(local))[:, None], jax.lax.stop_gradient(here)
    following = setting.hindsight.following[of_scene, local]
    goal = jnp.take_along_axis(setting.goals.state, column, 1)
    arrived = here[setting.state[of_scene[..., None], jnp.maximum(following, 0)]]
    there = here[setting.state[of_scene, goal]]
    away = distances(arrived.reshape(len(local), -1, here.shape[-1]), there, settings)
    behind = jnp.where(following[..., None] == goal[:, None, None], 0.0, away.reshape(*following.shape, -1))
    behind = jnp.where(following[..., None] == UNTRIED, jnp.inf, behind)
    cost = setting.goals.cost[of_scene[..., None], column[:, None, :], local[:, :, None]]
    return jnp.where(local[..., None] == goal[:, None], 0.0, cost + behind.min(2)), behind, behind
