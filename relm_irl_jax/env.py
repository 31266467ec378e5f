"""The navigation environment: pure functions over a few integer tables.

The decision process, for one worker:

- *State*: a pose of one scene. Scenes are laid end to end in a `World`, so a state is one integer.
- *Observation*: the views of the last states, as many as `reset` is asked for; the start's own, repeated, where the
  episode is younger.
- *Actions*: the four of `relm_irl_jax.scenes.scene.ACTIONS`; an action that collides leaves the state unchanged.
- *Episode*: starts at a uniformly drawn state that can reach a uniformly drawn target and differs from it. It is
  *terminated* when the state is the target and *truncated* after `cap` steps; a step that does both terminates.
- *Reward*: not part of the environment; see `relm_irl_jax.rewards.model`.

`reset` and `step` work on one worker and are vmapped by their callers. Everything they take is traced; shapes are
the only static part.
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
class Lane:
    """The consecutive rows of `Targets` among which a worker's episodes are drawn.

    Attributes:
        first: the first row.
        count: number of rows, at least 1.
    """

    first: Int32[Array, ""]
    count: Int32[Array, ""]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Episode:
    """Where a worker stands.

    Attributes:
        state: current state in the world.
        target: row of `Targets`.
        start: state at which the episode began.
        steps: actions taken so far.
        earlier: states before the current one, the latest first; one less than the views of an observation, and None
            where that leaves none.
    """

    state: Int32[Array, ""]
    target: Int32[Array, ""]
    start: Int32[Array, ""]
    steps: Int32[Array, ""]
    earlier: Int32[Array, "earlier"] | None = None

    @property
    def views(self) -> Int32[Array, "history"]:
        """States whose views are observed, the latest first."""
        return last_states(self.state, self.earlier)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Transition:
    """One step, as reward models and learners see it.

    Attributes:
        state: state before the action.
        action: number of the action.
        next_state: state after the action.
        target: row of `Targets`.
        start: state at which the episode began.
        terminated: the next state is the target.
        truncated: the step cap is reached and the next state is not the target.
        collided: the action left the state unchanged.
    """

    state: Int32[Array, ""]
    action: Int32[Array, ""]
    next_state: Int32[Array, ""]
    target: Int32[Array, ""]
    start: Int32[Array, ""]
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""]
    collided: Bool[Array, ""]


def scene_lanes(targets: Targets, n_scenes: int, episodes: int) -> Lane:
    """Lanes that tie episodes to scenes: each may be sent to every target of its scene.

    Args:
        targets: the targets, in the order of their scenes.
        n_scenes: number of scenes.
        episodes: number of episodes in each scene.

    Returns:
        One lane an episode; fields are [scenes, episodes].
    """
    numbers = np.arange(n_scenes)
    scene = np.asarray(targets.scene)
    spread = lambda values: jnp.asarray(np.repeat(values[:, None], episodes, 1), jnp.int32)  # noqa: E731
    return Lane(
        first=spread(np.searchsorted(scene, numbers)),
        count=spread(np.bincount(scene, minlength=n_scenes)),
    )


def reset(key: PRNGKeyArray, targets: Targets, lane: Lane, history: int = 1) -> Episode:
    """Begin an episode at a fresh target and a fresh start.

    One uniform number decides both: its product with the number of targets gives the row, what remains behind the
    point gives the start. With 23 random bits the probability of a (target, start) pair is off by at most
    `targets · starts / 2**23` of itself, 0.3% for the largest built-in scenes.

    Args:
        key: source of randomness.
        targets: the targets.
        lane: rows that may be drawn.
        history: views of an observation. Static.

    Returns:
        The episode before its first action.
    """
    position = jax.random.uniform(key) * lane.count.astype(jnp.float32)
    row = jnp.minimum(position.astype(jnp.int32), lane.count - 1)
    target = lane.first + row
    n_starts = targets.n_starts[target]
    column = ((position - row.astype(jnp.float32)) * n_starts.astype(jnp.float32)).astype(jnp.int32)
    start = targets.start[target, jnp.minimum(column, n_starts - 1)]
    earlier = jnp.full(history - 1, start) if history > 1 else None
    return Episode(state=start, target=target, start=start, steps=jnp.int32(0), earlier=earlier)


def reset_all(key: PRNGKeyArray, targets: Targets, lane: Lane, history: int = 1) -> Episode:
    """Begin an episode for each of many workers.

    Args:
        key: source of randomness.
        targets: the targets.
        lane: rows that each worker may draw; fields are [groups, batch].
        history: views of an observation. Static.

    Returns:
        The episodes; fields are [groups, batch].
    """
    keys = jax.random.split(key, lane.first.shape)
    return jax.vmap(jax.vmap(lambda k, row: reset(k, targets, row, history)))(keys, lane)


def step(
    episode: Episode, action: Int32[Array, ""], world: World, targets: Targets, cap: Int32[Array, ""]
) -> tuple[Episode, Transition]:
    """Take one action.

    Args:
        episode: where the worker stands.
        action: number of the action, 0 to 3.
        world: the scenes.
        targets: the targets.
        cap: number of steps after which an episode is truncated.

    Returns:
        The episode after the action and the transition. After a terminated or truncated transition the caller
        calls `reset`; the next state stays available in the transition, for bootstrapping.
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
    earlier = None if episode.earlier is None else episode.views[:-1]
    return Episode(next_state, episode.target, episode.start, steps, earlier), transition


def last_states(
    state: Int32[Array, "*batch"], earlier: Int32[Array, "*batch earlier"] | None
) -> Int32[Array, "*batch history"]:
    """States in one array, the latest first.

    Args:
        state: the last states.
        earlier: those before them, the latest first, if any.

    Returns:
        All of them.
    """
    now = state[..., None]
    return now if earlier is None else jnp.concatenate([now, earlier], -1)


def select(chosen: Bool[Array, "*batch"], these: Tree, those: Tree) -> Tree:
    """Take each worker's record from one of two structures.

    Args:
        chosen: whether to take the first one's.
        these: a structure whose arrays begin with the workers' axes.
        those: another one of the same shapes.

    Returns:
        The records taken.
    """

    def pick(this: Array, other: Array) -> Array:
        return jnp.where(chosen.reshape(chosen.shape + (1,) * (this.ndim - chosen.ndim)), this, other)

    return jax.tree.map(pick, these, those)


def shortest(episode: Episode, world: World, targets: Targets) -> Int32[Array, ""]:
    """Least number of actions from the episode's start to its target.

    Args:
        episode: the episode.
        world: the scenes.
        targets: the targets.

    Returns:
        The distance in actions.
    """
    return targets.distance[episode.target, world.local[episode.start]]
