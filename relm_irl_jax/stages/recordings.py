"""Demonstrations of a run as files: those of the expert, which its rewards were learned from, or a trained agent's."""

import jax
import numpy as np
from jaxtyping import Int32

from relm_irl_jax.config import Config
from relm_irl_jax.experts import Trajectory
from relm_irl_jax.rewards.demonstrated import demonstrate_targets
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.scene import Scene, successors
from relm_irl_jax.stages.encoding import EncodedScenes
from relm_irl_jax.stages.episodes import AgentChoice, episode_paths
from relm_irl_jax.stages.evaluation import load_policy
from relm_irl_jax.stages.worlds import evaluation_task
from relm_irl_jax.tasks import draw_split

Recordings = dict[str, list[Trajectory]]
"""Demonstrations by the name of their scene."""


def expert_recordings(config: Config, training: EncodedScenes, seed: int) -> Recordings:
    """The demonstrations that a run's rewards are learned from.

    Args:
        config: the configuration as run.
        training: the training scenes.
        seed: the run's seed.

    Returns:
        Demonstrations of every training target.
    """
    split = draw_split(training.scenes, (), config.tasks, seed)
    recordings: Recordings = {}
    shown = demonstrate_targets(training.scenes, split, config.irl, seed)
    for target, trajectories in zip(split.training, shown, strict=True):
        recordings.setdefault(training.scenes[target.scene].name, []).extend(trajectories)
    return recordings


def agent_recordings(
    config: Config, folder: RunFolder, training: EncodedScenes, choice: AgentChoice, episodes: int
) -> Recordings:
    """Episodes of a trained agent that reach their target.

    Args:
        config: the configuration as run.
        folder: the run folder.
        training: the training scenes.
        choice: the agent and the task.
        episodes: episodes in each scene; those that do not reach their target are left out.

    Returns:
        The demonstrations.

    Raises:
        InputError: the agent's file is missing or damaged.
    """
    task = evaluation_task(config, training, choice.task, choice.seed)
    policy = load_policy(config, folder, choice.method, choice.seed, task)
    recordings: Recordings = {scene.name: [] for scene in task.scenes}
    for episode in range(episodes):
        key = jax.random.fold_in(jax.random.key(choice.seed), episode)
        for scene, path in zip(task.scenes, episode_paths(key, policy, task, config.tasks.cap), strict=True):
            if path.success:
                recordings[scene.name].append(trajectory_of(scene, path.states))
    return recordings


def trajectory_of(scene: Scene, states: Int32[np.ndarray, "path"]) -> Trajectory:
    """A path with its actions; where several actions lead to the same state, the first.

    Args:
        scene: the scene.
        states: states of the scene, each of which an action leads to from the one before; the last one is the target.

    Returns:
        The demonstration.
    """
    leads = successors(scene.graph)[states[:-1]] == states[1:, None]
    return Trajectory(states=states, actions=leads.argmax(1).astype(np.int32), target=int(states[-1]))
