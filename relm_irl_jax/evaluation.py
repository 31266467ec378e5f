"""Evaluation: episodes from random starts, and the paper's three metrics (section 5.4)."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int32, Key, PRNGKeyArray

from relm_irl_jax import env
from relm_irl_jax.env import Episode, scene_target_ranges
from relm_irl_jax.types import Memory, Observation, Policy
from relm_irl_jax.world import Targets, World

MEMORY_BYTES = 2**26
"""Most memory that policies may keep of episodes that run side by side."""

PARTS = 2
"""Parts into which episodes that do not all run side by side are divided, whatever the machine: results depend on it
where a policy draws its actions."""

STEPS_PER_CALL = 10
"""Steps of one call of the compiled program, after which progress is reported."""


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
    lanes = lanes_within_memory(policy, world.n_scenes, episodes)
    drawn, step_key = draw_episodes(key, targets, world.n_scenes, episodes)
    situation = (step_key, policy, world, targets, jnp.int32(cap))
    if lanes == episodes:
        length, success = _run(drawn, lanes, situation, advance)
    else:
        length, success = _run_in_parts(drawn, lanes, situation, advance)
    shortest = env.shortest_path(drawn, world, targets)
    return jax.tree.map(np.asarray, Episodes(drawn.target, drawn.start, length, shortest, success))


_Situation = tuple[PRNGKeyArray, Policy, World, Targets, Int32[Array, ""]]
_Outcome = tuple[Int32[np.ndarray, "scenes episodes"], Bool[np.ndarray, "scenes episodes"]]


def _run(
    drawn: Episode,
    lanes: int,
    situation: _Situation,
    advance: Callable[[int], None] | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> _Outcome:
    """Run the drawn episodes to their ends, or until it is stopped; their lengths and successes."""
    key, policy, world, targets, cap = situation
    progress = _start(policy, drawn, lanes=lanes)
    ended = 0
    while ended < drawn.target.size and not stopped():
        progress = _continue(key, progress, drawn, policy, world, targets, cap=cap)
        now = int((progress.length > 0).sum())
        if advance is not None:
            advance(now - ended)
        ended = now
    return np.asarray(progress.length), np.asarray(progress.success)


def _run_in_parts(drawn: Episode, lanes: int, situation: _Situation, advance: Callable[[int], None] | None) -> _Outcome:
    """Run the episodes in `PARTS` parts of each scene, each in a thread: the step of one takes one core at a time."""
    episodes = drawn.target.shape[1]
    size, stop = -(-episodes // PARTS), threading.Event()
    begins = [min(part * size, episodes - size) for part in range(PARTS)]  # the last one overlaps, to be of equal size
    with ThreadPoolExecutor(PARTS) as threads:
        running = [
            threads.submit(
                _run,
                jax.tree.map(lambda x, begin=begin: x[:, begin : begin + size], drawn),
                max(1, lanes // PARTS),
                situation,
                advance,
                stop.is_set,
            )
            for begin in begins
        ]
        try:
            parts = [part.result() for part in running]
        finally:
            stop.set()
    length, success = np.zeros(drawn.target.shape, np.int32), np.zeros(drawn.target.shape, bool)
    for begin, part in zip(begins, parts, strict=True):
        length[:, begin : begin + size], success[:, begin : begin + size] = part
    return length, success


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


def lanes_within_memory(policy: Policy, n_scenes: int, episodes: int) -> int:
    """Number of episodes of each scene that run at a time, so that the policy's memories fit into `MEMORY_BYTES`.

    Args:
        policy: the policy.
        n_scenes: number of scenes.
        episodes: number of episodes in each scene.

    Returns:
        At least 1, at most `episodes`.
    """
    memory = jax.eval_shape(lambda: jax.tree.leaves(policy.init((n_scenes, 1))))
    size = sum(leaf.size * leaf.dtype.itemsize for leaf in memory)
    return max(1, min(episodes, MEMORY_BYTES // max(size, 1)))


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class _Progress:
    """Episodes under way, a few of each scene in lanes side by side, and the outcomes of those that ended.

    Attributes:
        number: number of each lane's episode among those of its scene; that of no episode when none is left.
        begun: episodes of each scene that have begun.
        episode: each lane's episode.
        memory: what the policy remembers of it.
        collided: whether its last action collided.
        length: actions of each episode that ended; 0 for the others.
        success: whether it reached its target.
        time: steps taken by all lanes.
    """

    number: Int32[Array, "scenes lanes"]
    begun: Int32[Array, "scenes"]
    episode: Episode
    memory: Memory
    collided: Bool[Array, "scenes lanes"]
    length: Int32[Array, "scenes episodes"]
    success: Bool[Array, "scenes episodes"]
    time: Int32[Array, ""]


@partial(jax.jit, static_argnames="lanes")
def _start(policy: Policy, drawn: Episode, *, lanes: int) -> _Progress:
    """The first episodes of each scene, before their first action."""
    shape = (drawn.target.shape[0], lanes)
    return _Progress(
        number=jnp.broadcast_to(jnp.arange(lanes, dtype=jnp.int32), shape),
        begun=jnp.full(shape[:1], lanes, jnp.int32),
        episode=jax.tree.map(lambda x: x[:, :lanes], drawn),
        memory=policy.init(shape),
        collided=jnp.zeros(shape, bool),
        length=jnp.zeros(drawn.target.shape, jnp.int32),
        success=jnp.zeros(drawn.target.shape, bool),
        time=jnp.int32(0),
    )


@partial(jax.jit, donate_argnums=1)
def _continue(
    key: PRNGKeyArray,
    progress: _Progress,
    drawn: Episode,
    policy: Policy,
    world: World,
    targets: Targets,
    *,
    cap: Int32[Array, ""],
) -> _Progress:
    """Take `STEPS_PER_CALL` steps with every lane, or fewer if all episodes end.

    A lane whose episode ends begins the next one of its scene; if none is left, its episode no longer changes.
    """
    n_episodes = drawn.target.shape[1]
    scene = jnp.arange(drawn.target.shape[0])[:, None]
    until = progress.time + STEPS_PER_CALL

    def advance(now: _Progress) -> _Progress:
        live = now.number < n_episodes
        observation = Observation(now.episode.state, now.collided, live)
        step_key = jax.random.fold_in(key, now.time)
        memory, action = policy.act(step_key, now.memory, observation, now.episode.target)
        episode, transition = env.step(now.episode, action, world, targets, cap)
        episode = env.select(live, episode, now.episode)
        ends = live & (transition.terminated | transition.truncated)
        row = jnp.where(ends, now.number, n_episodes)  # out of bounds: dropped
        length = now.length.at[scene, row].set(episode.steps, mode="drop")
        success = now.success.at[scene, row].set(transition.terminated, mode="drop")
        # Episodes begin in their order, in the lanes that are free.
        following = now.begun[:, None] + jnp.cumsum(ends, 1, dtype=jnp.int32) - 1
        number = jnp.where(ends, jnp.minimum(following, n_episodes), now.number)
        begun, collided = now.begun + ends.sum(1, dtype=jnp.int32), transition.collided & ~ends
        if now.number.shape[1] < n_episodes:
            chosen = jnp.minimum(number, n_episodes - 1)
            episode = env.select(ends, jax.tree.map(lambda x: x[scene, chosen], drawn), episode)
            memory = env.select(ends, policy.init(number.shape), memory)
        return _Progress(number, begun, episode, memory, collided, length, success, now.time + 1)

    return jax.lax.while_loop(lambda now: (now.number < n_episodes).any() & (now.time < until), advance, progress)


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
