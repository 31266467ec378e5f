"""Paths of a trained agent's episodes, for the report and for animations."""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Int32

from relm_irl_jax.config import Config, Method, Task
from relm_irl_jax.evaluation import trace_episodes
from relm_irl_jax.experts import follow_expert, shortest_path_expert
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.saved_episodes import SavedEpisode, save_episodes
from relm_irl_jax.saved_poses import poses_of
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.selection import scene_to_show
from relm_irl_jax.stages.encoding import EncodedScenes
from relm_irl_jax.stages.evaluation import load_policy
from relm_irl_jax.stages.worlds import EvaluationTask, evaluation_task
from relm_irl_jax.types import Policy
from relm_irl_jax.world import Targets, World, scene_offsets


@dataclass(frozen=True)
class EpisodePath:
    """The path of one episode.

    Attributes:
        states: states of the scene, from the start to the last one.
        target: the target's state.
        shortest: length of a shortest path from the start to the target.
    """

    states: Int32[np.ndarray, "path"]
    target: int
    shortest: int

    @property
    def success(self) -> bool:
        """Whether the path ends at the target."""
        return int(self.states[-1]) == self.target


def episode_paths(key: jax.Array, policy: Policy, task: EvaluationTask, cap: int) -> list[EpisodePath]:
    """Run one episode in each scene.

    Args:
        key: source of all randomness.
        policy: the policy, made for this task.
        task: scenes and targets.
        cap: number of steps after which an episode is truncated.

    Returns:
        One path for each scene.
    """
    states, row = trace_episodes(key, policy, task.world, task.targets, cap)
    target_state, offsets = np.asarray(task.targets.state), scene_offsets(task.scenes)
    paths = []
    for number, scene in enumerate(task.scenes):
        reached = np.flatnonzero(states[number] == target_state[row[number]])
        last = int(reached[0]) if len(reached) else cap
        local = (states[number, : last + 1] - offsets[number]).astype(np.int32)
        target = int(target_state[row[number]]) - offsets[number]
        paths.append(EpisodePath(local, target, int(scene.shortest_path_distance[local[0], target])))
    return paths


def path_from(key: jax.Array, policy: Policy, world: World, targets: Targets, start: int, cap: int) -> EpisodePath:
    """Run an episode to the only target of a world of one scene.

    Args:
        key: source of all randomness.
        policy: the policy, made for this world and target.
        world: the scene.
        targets: the target.
        start: the first state.
        cap: number of steps after which the episode is truncated.

    Returns:
        The path.
    """
    # Targets that can be reached from this start alone: every episode begins there.
    only = replace(targets, start=jnp.full_like(targets.start, start), n_starts=jnp.ones_like(targets.n_starts))
    states = trace_episodes(key, policy, world, only, cap)[0][0]
    target = int(targets.state[0])
    reached = np.flatnonzero(states == target)
    last = int(reached[0]) if len(reached) else cap
    return EpisodePath(states[: last + 1].astype(np.int32), target, int(targets.distance[0, start]))


@dataclass(frozen=True)
class AgentChoice:
    """A trained agent and a task.

    Attributes:
        method: the method that trained it.
        task: `I`, `II` or `III`.
        seed: the seed that trained it.
    """

    method: Method
    task: Task
    seed: int = 0


@dataclass(frozen=True)
class PlayedTask:
    """One episode in each scene of a task.

    Attributes:
        task: scenes and targets.
        policy: the policy that acted.
        paths: for each scene, the scene without its views and the path.
    """

    task: EvaluationTask
    policy: Policy
    paths: list[tuple[Scene, EpisodePath]]


def play_task(
    config: Config, folder: RunFolder, training: EncodedScenes, choice: AgentChoice, episode: int
) -> PlayedTask:
    """Run one episode in each scene of a task.

    Args:
        config: the configuration as run.
        folder: the run folder.
        training: the training scenes.
        choice: the agent and the task.
        episode: number of the episode, which determines start, target and actions.

    Returns:
        The episodes.
    """
    task = evaluation_task(config, training, choice.task, choice.seed)
    policy = load_policy(config, folder, choice.method, choice.seed, task)
    key = jax.random.fold_in(jax.random.key(choice.seed), episode)
    paths = episode_paths(key, policy, task, config.tasks.cap)
    return PlayedTask(task, policy, list(zip(task.scenes, paths, strict=True)))


def first_of_each_room_type(played: PlayedTask) -> list[int]:
    """Numbers of the scenes that the report shows.

    Args:
        played: one episode in each scene.
    """
    first: dict[str, int] = {}
    for number, (scene, _) in enumerate(played.paths):
        first.setdefault(scene.room_type, number)
    return list(first.values())


def save_shown_episodes(config: Config, folder: RunFolder, choice: AgentChoice, played: PlayedTask) -> None:
    """Save the episode in one scene of each room type, for the report.

    Args:
        config: the configuration as run.
        folder: the run folder.
        choice: the agent and the task.
        played: its episodes.
    """
    category = {(target.scene, target.state): target.category for target in played.task.chosen}
    shown: list[SavedEpisode] = []
    for number in first_of_each_room_type(played):
        scene, path = played.paths[number]
        episode = SavedEpisode(
            poses=poses_of(scene),
            method=choice.method,
            seed=choice.seed,
            target=path.target,
            category=category[number, path.target],
            path=path.states,
            shortest_path=follow_expert(scene, shortest_path_expert(scene, path.target), int(path.states[0])).states,
            target_view=scene_to_show(config.scenes, config.scene, scene.name).views[path.target],
        )
        shown.append(episode)
    save_episodes(folder.episodes(choice.task), shown)
