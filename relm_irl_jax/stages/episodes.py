"""Paths of a trained agent's episodes, for the report and for animations."""

from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Int32

from relm_irl_jax.config import Config, Method, Task
from relm_irl_jax.evaluation import trace_episodes
from relm_irl_jax.experts import follow_expert, shortest_path_expert
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.saved_maps import SavedEpisode, poses_of, save_episodes
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.selection import scene_to_show
from relm_irl_jax.stages.encoding import EncodedScenes
from relm_irl_jax.stages.evaluation import load_policy
from relm_irl_jax.stages.worlds import EvaluationTask, evaluation_task
from relm_irl_jax.types import Policy
from relm_irl_jax.world import scene_offsets


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


def paths_of_agent(
    config: Config, folder: RunFolder, training: EncodedScenes, choice: AgentChoice, episode: int
) -> tuple[EvaluationTask, list[tuple[Scene, EpisodePath]]]:
    """Run one episode in each scene of a task.

    Args:
        config: the configuration as run.
        folder: the run folder.
        training: the training scenes.
        choice: the agent and the task.
        episode: number of the episode, which determines start, target and actions.

    Returns:
        The task, and for each scene the scene without its views and the path.
    """
    task = evaluation_task(config, training, choice.task, choice.seed)
    policy = load_policy(config, folder, choice.method, choice.seed, task)
    key = jax.random.fold_in(jax.random.key(choice.seed), episode)
    paths = episode_paths(key, policy, task, config.tasks.cap)
    return task, list(zip(task.scenes, paths, strict=True))


def save_shown_episodes(config: Config, folder: RunFolder, training: EncodedScenes, choice: AgentChoice) -> None:
    """Save the first episode in one scene of each room type, for the report.

    Args:
        config: the configuration as run.
        folder: the run folder.
        training: the training scenes.
        choice: the agent and the task.
    """
    task, paths = paths_of_agent(config, folder, training, choice, 0)
    category = {(target.scene, target.state): target.category for target in task.chosen}
    shown: dict[str, SavedEpisode] = {}
    for number, (scene, path) in enumerate(paths):
        if scene.room_type in shown:
            continue
        shown[scene.room_type] = SavedEpisode(
            poses=poses_of(scene),
            method=choice.method,
            seed=choice.seed,
            target=path.target,
            category=category[number, path.target],
            path=path.states,
            shortest_path=follow_expert(scene, shortest_path_expert(scene, path.target), int(path.states[0])).states,
            target_view=scene_to_show(config.scenes, config.scene, scene.name).views[path.target],
        )
    save_episodes(folder.episodes(choice.task), list(shown.values()))
