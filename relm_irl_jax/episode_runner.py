"""Running drawn episodes to their ends: a few of each scene side by side, the next ones in the lanes that become free.

Where a policy is deterministic, episodes of equal start and target have equal outcomes, and one of them is run for all.
"""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, Int32, PRNGKeyArray

from relm_irl_jax import env
from relm_irl_jax.env import Episode
from relm_irl_jax.types import Memory, Observation, Policy, is_deterministic
from relm_irl_jax.world import Targets, World

MEMORY_BYTES = 2**26
"""Most memory that policies may keep of episodes that run side by side."""

PARTS = 2
"""Parts into which episodes that do not all run side by side are divided, whatever the machine: results depend on it
where a policy draws its actions."""

STEPS_PER_CALL = 10
"""Steps of one call of the compiled program, after which progress is reported."""

Outcome = tuple[Int32[np.ndarray, "scenes episodes"], Bool[np.ndarray, "scenes episodes"]]
"""Length of each episode, and whether it reached its target."""


class Cases(NamedTuple):
    """Episodes that are run, and the drawn episodes whose outcomes are theirs.

    Attributes:
        episode: the episodes; each row is padded at its end.
        count: number of episodes of each scene.
        of: number of the episode that has each drawn episode's outcome.
        times: number of drawn episodes that have each episode's outcome; 0 in the padding.
    """

    episode: Episode
    count: Int32[np.ndarray, "scenes"]
    of: Int[np.ndarray, "scenes drawn"]
    times: Int[np.ndarray, "scenes episodes"]


def run_episodes(
    key: PRNGKeyArray,
    drawn: Episode,
    policy: Policy,
    world: World,
    targets: Targets,
    *,
    cap: int,
    advance: Callable[[int], None] | None = None,
) -> Outcome:
    """Run episodes to their ends.

    Args:
        key: source of the actions' randomness.
        drawn: the episodes before their first action; fields are [scenes, episodes].
        policy: the policy, made for this world and these targets.
        world: the scenes.
        targets: the targets.
        cap: number of steps after which an episode counts as failed.
        advance: called with the number of episodes that have ended since its last call.

    Returns:
        Lengths and successes of the drawn episodes.
    """
    cases = distinct_cases(drawn) if is_deterministic(policy) else all_cases(drawn)
    situation = _Situation(key, policy, world, targets, jnp.int32(cap))
    lanes = lanes_within_memory(policy, *cases.times.shape)
    report = advance or (lambda ended: None)
    if lanes == cases.times.shape[1]:
        length, success = _run(cases, lanes, situation, report)
    else:
        length, success = _run_in_parts(cases, lanes, situation, report)
    return np.take_along_axis(length, cases.of, 1), np.take_along_axis(success, cases.of, 1)


def all_cases(drawn: Episode) -> Cases:
    """Every drawn episode is a case of its own.

    Args:
        drawn: the drawn episodes; fields are [scenes, episodes].

    Returns:
        The cases.
    """
    scenes, episodes = drawn.target.shape
    of = np.broadcast_to(np.arange(episodes), (scenes, episodes))
    return Cases(drawn, np.full(scenes, episodes, np.int32), of, np.ones((scenes, episodes), int))


def distinct_cases(drawn: Episode) -> Cases:
    """Episodes of equal start and target are one case.

    Args:
        drawn: the drawn episodes before their first action; fields are [scenes, episodes].

    Returns:
        The cases, those of each scene in the order in which they were drawn first.
    """
    start, target = np.asarray(drawn.start), np.asarray(drawn.target)
    scenes, episodes = target.shape
    first, of, times = (np.zeros((scenes, episodes), int) for _ in range(3))
    count = np.zeros(scenes, np.int32)
    for scene in range(scenes):
        pairs = np.stack([start[scene], target[scene]], 1)
        _, index, inverse, repeats = np.unique(
            pairs, axis=0, return_index=True, return_inverse=True, return_counts=True
        )
        order = np.argsort(index)
        count[scene] = len(order)
        first[scene, : len(order)], times[scene, : len(order)] = index[order], repeats[order]
        of[scene] = np.argsort(order)[inverse.reshape(-1)]
    first, times = first[:, : count.max()], times[:, : count.max()]
    return Cases(jax.tree.map(lambda x: jnp.take_along_axis(x, first, 1), drawn), count, of, times)


def lanes_within_memory(policy: Policy, n_scenes: int, episodes: int) -> int:
    """Number of episodes of each scene that run at a time, so that the policy's memories fit into `MEMORY_BYTES`.

    Args:
        policy: the policy.
        n_scenes: number of scenes.
        episodes: number of episodes in each scene.

    Returns:
        At least 1, at most `episodes`.
    """
    leaves = jax.eval_shape(lambda: jax.tree.leaves(policy.init((n_scenes, 1))))
    size = sum(leaf.size * leaf.dtype.itemsize for leaf in leaves)
    return max(1, min(episodes, MEMORY_BYTES // max(size, 1)))


class _Situation(NamedTuple):
    """What the episodes of a part have in common."""

    key: PRNGKeyArray
    policy: Policy
    world: World
    targets: Targets
    cap: Int32[Array, ""]


def _run(
    cases: Cases,
    lanes: int,
    situation: _Situation,
    advance: Callable[[int], None],
    stopped: Callable[[], bool] = lambda: False,
) -> Outcome:
    """Run cases to their ends, or until it is stopped."""
    progress = _start(situation.policy, cases.episode, lanes=lanes)
    count = jnp.asarray(cases.count)
    ended, total = 0, int(cases.times.sum())
    while ended < total and not stopped():
        progress = _continue(progress, cases.episode, count, situation)
        now = int(cases.times[np.asarray(progress.length) > 0].sum())
        advance(now - ended)
        ended = now
    return np.asarray(progress.length), np.asarray(progress.success)


def _run_in_parts(cases: Cases, lanes: int, situation: _Situation, advance: Callable[[int], None]) -> Outcome:
    """Run every `PARTS`-th case of each scene in a thread of its own: the step of one takes one core at a time."""
    size, stop = -(-cases.times.shape[1] // PARTS), threading.Event()

    def part_of(part: int) -> Cases:
        missing = size - len(range(part, cases.times.shape[1], PARTS))
        padded = lambda x: jnp.pad(x[:, part::PARTS], [(0, 0), (0, missing)])  # noqa: E731
        count = (cases.count - part + PARTS - 1) // PARTS
        return Cases(jax.tree.map(padded, cases.episode), count, cases.of, np.asarray(padded(cases.times)))

    length, success = np.zeros(cases.times.shape, np.int32), np.zeros(cases.times.shape, bool)
    with ThreadPoolExecutor(PARTS) as threads:
        running = [
            threads.submit(_run, part_of(part), max(1, lanes // PARTS), situation, advance, stop.is_set)
            for part in range(PARTS)
        ]
        try:
            for part, outcome in enumerate(running):
                for whole, of_part in zip((length, success), outcome.result(), strict=True):
                    whole[:, part::PARTS] = of_part[:, : len(range(part, whole.shape[1], PARTS))]
        finally:
            stop.set()
    return length, success


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class _Progress:
    """Episodes under way, a few of each scene in lanes side by side, and the outcomes of those that ended.

    Attributes:
        number: number of each lane's episode among those of its scene; the scene's count when none is left.
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


@partial(jax.jit, donate_argnums=0)
def _continue(progress: _Progress, drawn: Episode, count: Int32[Array, "scenes"], situation: _Situation) -> _Progress:
    """Take `STEPS_PER_CALL` steps with every lane, or fewer if all episodes end.

    A lane whose episode ends begins the next one of its scene; if none is left, its episode no longer changes.
    """
    key, policy, world, targets, cap = situation
    n_episodes = drawn.target.shape[1]
    last = count[:, None]
    scene = jnp.arange(drawn.target.shape[0])[:, None]
    until = progress.time + STEPS_PER_CALL

    def advance(now: _Progress) -> _Progress:
        live = now.number < last
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
        number = jnp.where(ends, jnp.minimum(following, last), now.number)
        begun, collided = now.begun + ends.sum(1, dtype=jnp.int32), transition.collided & ~ends
        if now.number.shape[1] < n_episodes:
            chosen = jnp.minimum(number, n_episodes - 1)
            episode = env.select(ends, jax.tree.map(lambda x: x[scene, chosen], drawn), episode)
            memory = env.select(ends, policy.init(number.shape), memory)
        return _Progress(number, begun, episode, memory, collided, length, success, now.time + 1)

    return jax.lax.while_loop(lambda now: (now.number < last).any() & (now.time < until), advance, progress)
