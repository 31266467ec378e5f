"""Evaluation: episodes from random starts, and the paper's three metrics (section 5.4)."""

from dataclasses import dataclass, field
from typing import Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax import env
from relm_irl_jax.agent.learning import Parameters
from relm_irl_jax.agent.metric.network import MetricNetwork, Places, distance, places_of
from relm_irl_jax.agent.rollout import sample_action
from relm_irl_jax.agent.settings import MetricSettings
from relm_irl_jax.agent.siamese.frames import forward, tabulate
from relm_irl_jax.agent.siamese.network import SiameseActorCritic, Tables
from relm_irl_jax.agent.siamese.pairs import Outputs, Pairs, outputs_of, pairs_of
from relm_irl_jax.env import Lane, scene_lanes
from relm_irl_jax.scenes.scene import ACTIONS
from relm_irl_jax.world import Targets, World


class Policy(Protocol):
    """What evaluation needs of an agent: a pytree that chooses actions for all workers at once."""

    @property
    def history(self) -> int:
        """Number of last states whose views the agent sees."""
        ...

    def __call__(
        self, key: PRNGKeyArray, views: Int32[Array, "scenes batch history"], target: Int32[Array, "scenes batch"]
    ) -> Int32[Array, "scenes batch"]:
        """Return one action a worker; row i of the arrays belongs to scene i of the world, states come latest first."""
        ...


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class RandomPolicy:
    """The Random baseline: every action with the same probability (section 5.3)."""

    @property
    def history(self) -> int:
        """One view."""
        return 1

    def __call__(
        self, key: PRNGKeyArray, views: Int32[Array, "scenes batch 1"], target: Int32[Array, "scenes batch"]
    ) -> Int32[Array, "scenes batch"]:
        """Return one action a worker."""
        return jax.random.randint(key, target.shape, 0, len(ACTIONS))


def _chosen(key: PRNGKeyArray, logits: Float32[Array, "*batch 4"], greedy: bool) -> Int32[Array, "*batch"]:
    """The most probable actions, or actions drawn from the policy."""
    return jnp.argmax(logits, -1).astype(jnp.int32) if greedy else sample_action(key, logits)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class NetworkPolicy:
    """A trained network that sees several views, its tables computed for the scenes and targets at hand.

    Attributes:
        parameters: the network's parameters.
        tables: what is computed once for every state and every target.
        head: head that serves each scene.
        network: the network. Static.
        greedy: take the most probable action instead of drawing from the policy. Static.
    """

    parameters: Parameters
    tables: Tables
    head: Int32[Array, "scenes"]
    network: SiameseActorCritic = field(metadata={"static": True})
    greedy: bool = field(default=False, metadata={"static": True})

    @property
    def history(self) -> int:
        """Number of last states whose views the network sees."""
        return self.network.history

    def __call__(
        self, key: PRNGKeyArray, views: Int32[Array, "scenes batch history"], target: Int32[Array, "scenes batch"]
    ) -> Int32[Array, "scenes batch"]:
        """Return one action a worker."""
        logits = forward(self.network, self.parameters, self.tables, views, target, self.head).logits
        return _chosen(key, logits, self.greedy)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class PairPolicy:
    """A trained network that sees one view, its policy computed for every state and target at hand.

    Attributes:
        outputs: policy and value of every pair.
        pairs: the pairs.
        world: the scenes.
        greedy: take the most probable action instead of drawing from the policy. Static.
    """

    outputs: Outputs
    pairs: Pairs
    world: World
    greedy: bool = field(default=False, metadata={"static": True})

    @property
    def history(self) -> int:
        """One view."""
        return 1

    def __call__(
        self, key: PRNGKeyArray, views: Int32[Array, "scenes batch 1"], target: Int32[Array, "scenes batch"]
    ) -> Int32[Array, "scenes batch"]:
        """Return one action a worker."""
        logits = self.outputs.logits[self.pairs.number(self.world, views[..., 0], target)]
        return _chosen(key, logits, self.greedy)


def network_policy(
    network: SiameseActorCritic,
    parameters: Parameters,
    world: World,
    targets: Targets,
    *,
    greedy: bool = False,
) -> NetworkPolicy | PairPolicy:
    """Prepare a trained network for evaluation.

    Args:
        network: the network.
        parameters: its parameters.
        world: the scenes of the evaluation.
        targets: the targets of the evaluation.
        greedy: take the most probable action instead of drawing from the policy.

    Returns:
        The policy.
    """
    if network.history == 1:
        pairs = pairs_of(world, targets, network.n_heads)
        outputs: Outputs = jax.jit(outputs_of, static_argnums=0)(network, parameters, world, targets, pairs)
        return PairPolicy(outputs, pairs, world, greedy)
    tables = tabulate(network, parameters, world.features, targets.state, None, targets.predicted)
    first_state = jnp.searchsorted(world.scene, jnp.arange(_n_scenes(world)))
    return NetworkPolicy(parameters, tables, world.head[first_state], network, greedy)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class MetricPolicy:
    """A trained metric agent, the places of the scenes and targets at hand computed.

    Attributes:
        places: places of every state.
        wanted: place of every target.
        settings: form of the distance, and how sharply it is followed. Static.
        greedy: take the most probable action instead of drawing from the policy. Static.
    """

    places: Places
    wanted: Float32[Array, "targets dimension"]
    settings: MetricSettings = field(metadata={"static": True})
    greedy: bool = field(default=False, metadata={"static": True})

    @property
    def history(self) -> int:
        """One view."""
        return 1

    def __call__(
        self, key: PRNGKeyArray, views: Int32[Array, "scenes batch 1"], target: Int32[Array, "scenes batch"]
    ) -> Int32[Array, "scenes batch"]:
        """Return one action a worker."""
        steps = distance(self.places.after[views[..., 0]], self.wanted[target][..., None, :], self.settings)
        return _chosen(key, -self.settings.acting_sharpness * steps, self.greedy)


def metric_policy(
    network: MetricNetwork,
    parameters: Parameters,
    world: World,
    targets: Targets,
    settings: MetricSettings,
    *,
    greedy: bool = False,
) -> MetricPolicy:
    """Prepare a trained metric agent for evaluation.

    Args:
        network: the network.
        parameters: its parameters.
        world: the scenes of the evaluation.
        targets: the targets of the evaluation.
        settings: the agent's settings.
        greedy: take the most probable action instead of drawing from the policy.

    Returns:
        The policy.
    """
    places: Places = jax.jit(places_of, static_argnums=0)(network, parameters, world.features)
    return MetricPolicy(places, places.here[targets.state], settings, greedy)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Episodes:
    """Finished evaluation episodes; row i belongs to scene i of the world.

    Attributes:
        target: row of `Targets`.
        start: first state.
        length: actions taken.
        shortest: least number of actions that would have reached the target.
        success: whether the target was reached within the cap.
    """

    target: Int32[Array | np.ndarray, "scenes episodes"]
    start: Int32[Array | np.ndarray, "scenes episodes"]
    length: Int32[Array | np.ndarray, "scenes episodes"]
    shortest: Int32[Array | np.ndarray, "scenes episodes"]
    success: Bool[Array | np.ndarray, "scenes episodes"]


@dataclass(frozen=True)
class Metrics:
    """The paper's metrics over a set of episodes.

    Attributes:
        episodes: number of episodes.
        success_rate: successes / episodes (Equation 35).
        path_length_error: mean of path length − shortest path over all episodes, a failure counting the cap as its
            length (Equation 36), in actions.
        spl: mean of success · shortest / max(length, shortest) (Equation 37).
    """

    episodes: int
    success_rate: float
    path_length_error: float
    spl: float


def metrics(episodes: Episodes, scene: int) -> Metrics:
    """Compute the metrics of one scene.

    Args:
        episodes: evaluated episodes.
        scene: number of the scene.

    Returns:
        The metrics.
    """
    length, shortest, success = episodes.length[scene], episodes.shortest[scene], episodes.success[scene]
    return Metrics(
        episodes=len(length),
        success_rate=float(success.mean()),
        path_length_error=float((length - shortest).mean()),
        spl=float((success * shortest / np.maximum(length, shortest)).mean()),
    )


def evaluate(key: PRNGKeyArray, policy: Policy, world: World, targets: Targets, cap: int, episodes: int) -> Episodes:
    """Run episodes in every scene, start and target drawn uniformly.

    Args:
        key: source of all randomness.
        policy: the agent.
        world: the scenes.
        targets: the targets; every scene has at least one.
        cap: number of steps after which an episode counts as failed.
        episodes: number of episodes in each scene.

    Returns:
        One finished episode a worker.
    """
    lane = scene_lanes(targets, _n_scenes(world), episodes)
    return jax.tree.map(np.asarray, _run(key, policy, world, targets, lane, jnp.int32(cap)))


@jax.jit
def _run(
    key: PRNGKeyArray, policy: Policy, world: World, targets: Targets, lane: Lane, cap: Int32[Array, ""]
) -> Episodes:
    """Step all workers until each has finished its one episode; a finished worker stands still."""
    over_workers = lambda function: jax.vmap(jax.vmap(function))  # noqa: E731
    reset_key, step_key = jax.random.split(key)
    first = env.reset_all(reset_key, targets, lane, policy.history)

    def advance(carry):
        episode, success, done, time = carry
        action = policy(jax.random.fold_in(step_key, time), episode.views, episode.target)
        after, transition = over_workers(lambda e, a: env.step(e, a, world, targets, cap))(episode, action)
        kept = env.select(done, episode, after)
        success = jnp.where(done, success, transition.terminated)
        return kept, success, done | transition.terminated | transition.truncated, time + 1

    nothing = jnp.zeros(lane.first.shape, bool)
    episode, success, _, _ = jax.lax.while_loop(
        lambda carry: ~carry[2].all(), advance, (first, nothing, nothing, jnp.int32(0))
    )
    shortest = over_workers(lambda e: env.shortest(e, world, targets))(episode)
    return Episodes(episode.target, episode.start, episode.steps, shortest, success)


def _n_scenes(world: World) -> int:
    """Number of scenes of a world."""
    return int(world.scene[-1]) + 1
