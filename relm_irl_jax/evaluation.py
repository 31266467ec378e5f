"""Evaluation: episodes from random starts, and the paper's three metrics (section 5.4)."""

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int32, Key, PRNGKeyArray

from relm_irl_jax import env
from relm_irl_jax.env import Episode, scene_target_ranges
from relm_irl_jax.episode_runner import run_episodes
from relm_irl_jax.types import Observation, Policy
from relm_irl_jax.world import Targets, World


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Episodes:
    """Finished evaluation episodes; row i belongs to scene i of the world.

    Attributes:
        target: row of `Targets`.
        start: first state.
        length: actions taken.
        shortest: length of a shortest path from the start to the target.
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
        path_length_error: mean of path length − shortest path over all episodes, in actions; the path length of a
            failed episode is the cap (Equation 36).
        spl: mean of success · shortest / max(length, shortest) (Equation 37).
    """

    episodes: int
    success_rate: float
    path_length_error: float
    spl: float


def compute_metrics(episodes: Episodes, scene: int) -> Metrics:
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


def evaluate(
    key: PRNGKeyArray,
    policy: Policy,
    world: World,
    targets: Targets,
    cap: int,
    episodes: int,
    *,
    advance: Callable[[int], None] | None = None,
) -> Episodes:
    """Run episodes in every scene, with uniformly drawn starts and targets.

    Args:
        key: source of all randomness.
        policy: the policy, made for this world and these targets.
        world: the scenes.
        targets: the targets; every scene has at least one.
        cap: number of steps after which an episode counts as failed.
        episodes: number of episodes in each scene.
        advance: called with the number of episodes that have ended since its last call.

    Returns:
        The finished episodes.
    """
    drawn, step_key = draw_episodes(key, targets, world.n_scenes, episodes)
    length, success = run_episodes(step_key, drawn, policy, world, targets, cap=cap, advance=advance)
    shortest = env.shortest_path(drawn, world, targets)
    return jax.tree.map(np.asarray, Episodes(drawn.target, drawn.start, length, shortest, success))


def draw_episodes(key: PRNGKeyArray, targets: Targets, n_scenes: int, episodes: int) -> tuple[Episode, PRNGKeyArray]:
    """Draw starts and targets of evaluation episodes; they are the same for every policy.

    Args:
        key: source of all randomness.
        targets: the targets; every scene has at least one.
        n_scenes: number of scenes.
        episodes: number of episodes in each scene.

    Returns:
        The episodes before their first action, with fields [scenes, episodes], and a key for the actions.
    """
    reset_key, step_key = jax.random.split(key)
    return jax.jit(env.reset_all)(reset_key, targets, scene_target_ranges(targets, n_scenes, episodes)), step_key


def evaluation_key(seed: int) -> PRNGKeyArray:
    """The key of a seed's evaluation, of which all policies' episodes are drawn.

    Args:
        seed: the run's seed.
    """
    return jax.random.fold_in(jax.random.key(seed), 1)


def trace_episodes(
    key: PRNGKeyArray, policy: Policy, world: World, targets: Targets, cap: int
) -> tuple[Int32[np.ndarray, "scenes _"], Int32[np.ndarray, "scenes"]]:
    """Run one episode in each scene and return all its states.

    Args:
        key: source of all randomness.
        policy: the policy, made for this world and these targets.
        world: the scenes.
        targets: the targets; every scene has at least one.
        cap: number of steps.

    Returns:
        World states from the start on, `cap` + 1 for each scene, also those after the target was reached; and the row
        of each scene's target.
    """
    target_range = scene_target_ranges(targets, world.n_scenes, 1)
    reset_key, key = jax.random.split(key)
    first = env.reset_all(reset_key, targets, target_range)
    states = _states(jax.random.split(key, cap), policy, world, targets, first)
    states = np.concatenate([np.asarray(first.state)[None], np.asarray(states)])
    return states[:, :, 0].T, np.asarray(first.target)[:, 0]


@jax.jit
def _states(
    keys: Key[Array, "time"], policy: Policy, world: World, targets: Targets, first: Episode
) -> Int32[Array, "time scenes 1"]:
    """The state after each step, one for each key, without an end at the target."""
    cap = jnp.int32(len(keys))

    def advance(carry, key: PRNGKeyArray):
        episode, memory, collided = carry
        memory, action = policy.act(key, memory, Observation(episode.state, collided), episode.target)
        episode, transition = env.step(episode, action, world, targets, cap)
        return (episode, memory, transition.collided), episode.state

    shape = first.state.shape
    return jax.lax.scan(advance, (first, policy.init(shape), jnp.zeros(shape, bool)), keys)[1]
