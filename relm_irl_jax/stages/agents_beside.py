"""Other agents in a run's tables: each has a run of its own in a sub-folder, with the same scenes and targets."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from relm_irl_jax.config import BesideName, Config, Task
from relm_irl_jax.results import ResultRow, beside_name, load_results
from relm_irl_jax.rewards.learned import LearnedRewards
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import TaskSplit

LearnRewards = Callable[[Config, Sequence[Scene], TaskSplit, int], LearnedRewards]
"""Learns the rewards of a configuration from encoded training scenes, the targets of all tasks, and a seed."""


def runs_beside(config: Config, folder: RunFolder) -> dict[BesideName, Config]:
    """The configurations of the agents beside a run's own.

    Args:
        config: the run's configuration.
        folder: its folder.

    Returns:
        Each agent's configuration, with its folder.
    """
    return {
        agent: replace(config.of_agent_beside(agent), run=folder.beside(agent).path)
        for agent in dict.fromkeys(config.beside)
    }


def rows_beside(config: Config, folder: RunFolder, task: Task) -> list[ResultRow]:
    """The rows of the agents beside a run's own.

    Args:
        config: the run's configuration.
        folder: its folder.
        task: the task, which has been evaluated in the agents' folders.

    Returns:
        The rows, with a name for each agent in place of a method's.

    Raises:
        InputError: an agent's results are missing or damaged.
    """
    return [
        replace(row, method=beside_name(agent))
        for agent in dict.fromkeys(config.beside)
        for row in load_results(folder.beside(agent), task).rows
        if row.agent == agent
    ]


def learned_once(learn: LearnRewards) -> LearnRewards:
    """Learn the rewards of each seed only once for all agents of a run.

    Args:
        learn: learns rewards.

    Returns:
        A function that learns the same rewards; all calls must have the same configuration but for the agent.
    """
    learned: dict[int, LearnedRewards] = {}

    def learn_or_reuse(config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int) -> LearnedRewards:
        if seed not in learned:
            learned[seed] = learn(config, scenes, split, seed)
        return learned[seed]

    return learn_or_reuse
