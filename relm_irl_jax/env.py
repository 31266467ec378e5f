"""The navigation environment: pure functions on integer tables.

The Markov decision process of one worker:

- *State*: a pose (place and heading) in one scene. The scenes of a `World` are numbered consecutively, so a state is
  one integer.
- *Observation*: the view of the current state, and whether the last action was a collision.
- *Actions*: the four of `relm_irl_jax.scenes.scene.ACTIONS`; an action that collides leaves the state unchanged.
- *Episode*: the target is drawn uniformly; the start is drawn uniformly from the other states that can reach it. The
  episode is *terminated* when the state is the target, and *truncated* after `cap` steps; if both happen in one step,
  it is terminated.
- *Reward*: not part of the environment; see `relm_irl_jax.rewards`.

`reset` works on one worker (`reset_all` is its vmapped form); `step` also takes episodes with leading batch axes. All
arguments are traced; only shapes are static.
"""

from dataclasses import dataclass
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int32, PRNGKeyArray

from relm_irl_jax.world import Targets, World

Tree = TypeVar("Tree")


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TargetRange:
    """The consecutive rows of `Targets` from which a worker's episodes draw their target.

    Attributes:
        first: the first row.
        count: number of rows, at least 1.
    """

    first: Int32[Array, "*batch"]
    count: Int32[Array, "*batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Episode:
    """A running episode of one worker.

    Attributes:
        state: current state in the world.
        target: row of `Targets`.
        start: first state of the episode.
        steps: actions taken so far.
    """

    state: Int32[Array, "*batch"]
    target: Int32[Array, "*batch"]
    start: Int32[Array, "*batch"]
    steps: Int32[Array, "*batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Transition:
    """One environment step, as reward functions and agents receive it.

    Attributes:
        state: state before the action.
        action: number of the action.
        next_state: state after the action.
        target: row of `Targets`.
        start: first state of the episode.
        terminated: the next state is the target.
        truncated: the step cap is reached and the next state is not the target.
        collided: the action left the state unchanged.
    """

    state: Int32[Array, "*batch"]
    action: Int32[Array, "*batch"]
    next_state: Int32[Array, "*batch"]
    target: Int32[Array, "*batch"]
    start: Int32[Array, "*batch"]
    terminated: Bool[Array, "*batch"]
    truncated: Bool[Array, "*batch"]
    collided: Bool[Array, "*batch"]


def scene_target_ranges(targets: Targets, n_scenes: int, episodes: int) -> TargetRange:
    """Assign episodes to scenes: each episode draws from all targets of its scene.

    Args:
        targets: the targets, in the order of their scenes.
        n_scenes: number of scenes.
        episodes: number of episodes in each scene.

    Returns:
        One range for each episode; fields are [scenes, episodes].
    """
    numbers = np.arange(n_scenes)
    scene = np.asarray(targets.scene)
    first, count = np.searchsorted(scene, numbers), np.bincount(scene, minlength=n_scenes)
    return TargetRange(*(jnp.asarray(np.repeat(values[:, None], episodes, 1), jnp.int32) for values in (first, count)))


def reset(key: PRNGKeyArray, targets: Targets, target_range: TargetRange) -> Episode:
    """Start an episode: draw a target, then a start.

    One uniform number gives both: the integer part of its product with the number of targets is the row, and the
    fractional part gives the start. With 23 random bits, the relative error of the probability of a (target, start)
    pair is at most `targets · starts / 2**23`, 0.3% for the largest built-in scenes.

    Args:
        key: source of randomness.
        targets: the targets.
        target_range: rows from which the target is drawn.

    Returns:
        The episode before its first action.
    """
    position = jax.random.uniform(key) * target_range.count.astype(jnp.float32)
    row = jnp.minimum(position.astype(jnp.int32), target_range.count - 1)
    target = target_range.first + row
    n_starts = targets.n_starts[target]
    column = ((position - row.astype(jnp.float32)) * n_starts.astype(jnp.float32)).astype(jnp.int32)
    start = targets.start[target, jnp.minimum(column, n_starts - 1)]
    return Episode(state=start, target=target, start=start, steps=jnp.int32(0))


def reset_all(key: PRNGKeyArray, targets: Targets, target_range: TargetRange) -> Episode:
    """Start an episode for each of many workers.

    Args:
        key: source of randomness.
        targets: the targets.
        target_range: rows from which each worker draws; fields are [groups, batch].

    Returns:
        The episodes; fields are [groups, batch].
    """
    keys = jax.random.split(key, target_range.first.shape)
    return jax.vmap(jax.vmap(lambda k, rows: reset(k, targets, rows)))(keys, target_range)


def step(
    episode: Episode, action: Int32[Array, "*batch"], world: World, targets: Targets, cap: Int32[Array, ""]
) -> tuple[Episode, Transition]:
    """Take one action, for one worker or for a batch.

    Args:
        episode: the episode before the action.
        action: number of the action, 0 to 3; same axes as the episode.
        world: the scenes.
        targets: the targets.
        cap: number of steps after which an episode is truncated.

    Returns:
        The episode after the action, and the transition. The caller resets the episode after a terminated or truncated
        transition; the transition's `next_state` then still serves for bootstrapping.
    """
    next_state = world.successor[episode.state, action]
    steps = episode.steps + 1
    terminated = next_state == targets.state[episode.target]
    transition = Transition(
        state=episode.state,
        action=action,
        next_state=next_state,
        target=episode.target,
        start=episode.start,
        terminated=terminated,
        truncated=(steps >= cap) & ~terminated,
        collided=next_state == episode.state,
    )
    return Episode(next_state, episode.target, episode.start, steps), transition


def select(condition: Bool[Array, "*batch"], if_true: Tree, if_false: Tree) -> Tree:
    """`jnp.where` for pytrees of arrays whose leading axes are those of the workers.

    Args:
        condition: one value for each worker.
        if_true: a pytree.
        if_false: a pytree with the same structure and shapes.

    Returns:
        For each worker, the entries of one of the two.
    """

    def where(x: Array, y: Array) -> Array:
        return jnp.where(condition.reshape(condition.shape + (1,) * (x.ndim - condition.ndim)), x, y)

    return jax.tree.map(where, if_true, if_false)


def shortest_path(episode: Episode, world: World, targets: Targets) -> Int32[Array, "*batch"]:
    """Smallest number of actions from the episode's start to its target.

    Args:
        episode: the episode.
        world: the scenes.
        targets: the targets.

    Returns:
        The distance in actions.
    """
    return targets.distance[episode.target, world.local[episode.start]]
