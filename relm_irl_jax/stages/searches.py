"""What an agent that searches believed along an episode, laid over the true room."""

from collections.abc import Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Int32, PRNGKeyArray

from relm_irl_jax.config import Config
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.saved_poses import poses_of
from relm_irl_jax.saved_searches import SavedSearch, save_searches
from relm_irl_jax.scenes.scene import GRID_STEP, Scene
from relm_irl_jax.scenes.selection import scene_to_show
from relm_irl_jax.stages.episodes import AgentChoice, EpisodePath, PlayedTask, first_of_each_room_type
from relm_irl_jax.types import Belief, Memory, Observation, SearchingPolicy
from relm_irl_jax.world import scene_offsets

MOMENTS = 5
"""Moments of an episode that the report shows."""


def shown_moments(path: EpisodePath) -> list[int]:
    """Moments of an episode for the report, evenly spaced; at the last one the agent is about to arrive.

    Args:
        path: the episode's path.

    Returns:
        Numbers of steps taken, ascending.
    """
    last = max(len(path.states) - 2, 0)
    return sorted(set(np.linspace(0, last, MOMENTS).round().astype(int).tolist()))


def beliefs_along(
    policy: SearchingPolicy, states: Int32[np.ndarray, "path"], target: int, scene: int, scenes: int, key: PRNGKeyArray
) -> list[Belief]:
    """Show a path to an agent, and ask at each state but the last one what it believes.

    Args:
        policy: the policy.
        states: states of the world, which the policy's own actions led to.
        target: row of the target.
        scene: number of the scene.
        scenes: number of scenes of the world.
        key: source of the policy's randomness.

    Returns:
        One belief for each state but the last one, without batch axes.
    """
    running, rows = jnp.zeros((scenes, 1), bool).at[scene].set(True), jnp.full((scenes, 1), target, jnp.int32)
    memory, beliefs = policy.init((scenes, 1)), []
    for number, state in enumerate(states[:-1].tolist()):
        collided = number > 0 and state == int(states[number - 1])
        observation = Observation(jnp.full((scenes, 1), state, jnp.int32), jnp.full((scenes, 1), collided), running)
        memory, belief = _step(policy, key, memory, observation, rows)
        beliefs.append(jax.tree.map(lambda x: np.asarray(x[scene, 0]), belief))
    return beliefs


@jax.jit
def _step(
    policy: SearchingPolicy,
    key: PRNGKeyArray,
    memory: Memory,
    observation: Observation,
    target: Int32[jax.Array, "scenes 1"],
) -> tuple[Memory, Belief]:
    memory, _ = policy.act(key, memory, observation, target)
    return memory, policy.belief(memory, target)


def search_over_room(
    scene: Scene,
    path: EpisodePath,
    beliefs: Sequence[Belief],
    moments: Sequence[int],
    *,
    method: str,
    seed: int,
    category: str,
) -> SavedSearch:
    """Lay beliefs over the true room: turn and shift the agent's frame so that it stands where it does.

    Args:
        scene: the scene with its views.
        path: the episode.
        beliefs: the belief at each state of the path but the last one.
        moments: indices of the beliefs to keep.
        method: the method that trained the agent.
        seed: seed of the training.
        category: category of the object that the target shows.

    Returns:
        The search.
    """
    first, state = beliefs[0], int(path.states[0])
    heading, z, x = (int(number) for number in np.asarray(first.pose))
    turns = (round(float(scene.rotation[state]) / 90) - heading) % 4
    ahead, right = ((0, 1), (1, 0), (0, -1), (-1, 0))[turns], ((1, 0), (0, -1), (-1, 0), (0, 1))[turns]
    origin = scene.location[state] - GRID_STEP * (z * np.array(ahead) + x * np.array(right))
    chosen = [beliefs[moment] for moment in moments]
    turned = lambda square: np.rot90(square, turns, (-2, -1)).astype(np.float32)  # noqa: E731
    return SavedSearch(
        poses=poses_of(scene),
        method=method,
        seed=seed,
        target=path.target,
        category=category,
        path=path.states,
        steps=np.asarray(moments, np.int32),
        origin=np.asarray(origin, np.float64),
        probability=np.stack([np.roll(turned(np.asarray(b.probability)), turns, 0) for b in chosen]),
        free=np.stack([turned(np.asarray(b.free)) for b in chosen]),
        coverage=np.stack([turned(np.asarray(b.coverage)) for b in chosen]),
        views=scene.views[path.states[list(moments)]],
        target_view=scene.views[path.target],
    )


def save_shown_searches(config: Config, folder: RunFolder, choice: AgentChoice, played: PlayedTask) -> None:
    """Save what the agent believed along the episodes that the report shows, if it is one that searches.

    Args:
        config: the configuration.
        folder: the run folder.
        choice: the agent and the task.
        played: its episodes.
    """
    if not isinstance(played.policy, SearchingPolicy):
        return
    offsets, targets = scene_offsets(played.task.scenes), np.asarray(played.task.targets.state)
    searches = []
    for number in first_of_each_room_type(played):
        scene, path = played.paths[number]
        if len(path.states) < 2:
            continue
        row = int(np.flatnonzero(targets == path.target + offsets[number])[0])
        beliefs = beliefs_along(
            played.policy, path.states + offsets[number], row, number, len(offsets), jax.random.key(choice.seed)
        )
        search = search_over_room(
            scene_to_show(config.scenes, config.scene, scene.name),
            path,
            beliefs,
            shown_moments(path),
            method=choice.method,
            seed=choice.seed,
            category=played.task.chosen[row].category,
        )
        searches.append(replace(search, views=search.views[:, ::4, ::4]))  # smaller files
    save_searches(folder.searches(choice.task), searches)
