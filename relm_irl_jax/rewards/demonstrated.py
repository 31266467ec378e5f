"""Inverse reinforcement learning from demonstrations: one problem for each target, or for each trajectory.

A demonstrated reward pairs the weights w that IRL found for a target with the starts from which demonstrations lead to
it; the extreme learning machine is fitted to exactly these (start, target) → w pairs. Every part of a shortest path is
a shortest path, so the states along the demonstrations serve as further targets at no cost; targets kept for
evaluation never do.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import Trajectory, shortest_path_expert, shortest_path_trajectories, sub_trajectories
from relm_irl_jax.irl import MaxMarginProblem, Solution, learn_weights
from relm_irl_jax.rewards.settings import IrlSettings
from relm_irl_jax.scenes.scene import Scene, successors
from relm_irl_jax.tasks import Target, TaskSplit


@dataclass(frozen=True)
class DemonstratedReward:
    """Weights learned for one target.

    Attributes:
        target: the target; its scene numbers the training scenes.
        starts: states from which demonstrations lead to the target.
        solution: the solved program, with weights w.
        trained: whether the target is a training target; otherwise it is the end of a sub-trajectory.
    """

    target: Target
    starts: Int32[np.ndarray, "starts"]
    solution: Solution
    trained: bool


@dataclass(frozen=True)
class _Question:
    """One problem to solve: a target and the states from which demonstrations lead to it."""

    target: Target
    starts: Int32[np.ndarray, "starts"]
    trained: bool


def demonstrate(scene: Scene, target: Target, count: int, generator: np.random.Generator) -> tuple[Trajectory, ...]:
    """Shortest-path trajectories to a target from distinct random starts.

    Args:
        scene: the target's scene.
        target: the target.
        count: number of trajectories; fewer where fewer states can reach the target.
        generator: source of randomness.

    Returns:
        The trajectories.
    """
    able = np.flatnonzero(scene.shortest_path_distance[:, target.state] > 0)
    starts = generator.choice(able, min(count, len(able)), replace=False)
    return shortest_path_trajectories(scene, target.state, starts.tolist())


def demonstrate_targets(
    scenes: Sequence[Scene], split: TaskSplit, settings: IrlSettings, seed: int
) -> list[tuple[Trajectory, ...]]:
    """All demonstrations of one seed, the same for every method that learns from them.

    Args:
        scenes: training scenes.
        split: the targets; only those of training are demonstrated.
        settings: how many demonstrations.
        seed: the run's seed.

    Returns:
        The trajectories to each training target, in the order of the targets.
    """
    generator = np.random.default_rng([seed, 1])
    return [demonstrate(scenes[t.scene], t, settings.trajectories, generator) for t in split.training]


def learn_demonstrated_rewards(
    scenes: Sequence[Scene],
    split: TaskSplit,
    phi: Sequence[Float64[np.ndarray, "_ d"]],
    settings: IrlSettings,
    seed: int,
) -> tuple[DemonstratedReward, ...]:
    """Demonstrate every training target and solve for its reward weights.

    Args:
        scenes: training scenes.
        split: the targets; those for evaluation are never demonstrated, nor used as ends of sub-trajectories.
        phi: reward features of each scene.
        settings: how many demonstrations, and the program.
        seed: the run's seed.

    Returns:
        The demonstrated rewards, those of training targets first; problems without a decision to learn from are left
        out.

    Raises:
        InputError: a training target's problem has no solution; the message names it and the status.
    """
    questions = _questions(scenes, split, demonstrate_targets(scenes, split, settings, seed), settings)
    next_states = [successors(scene.graph) for scene in scenes]
    problems = [
        MaxMarginProblem(
            phi[question.target.scene],
            next_states[question.target.scene],
            shortest_path_expert(scenes[question.target.scene], question.target.state),
            question.starts,
            name=f"{scenes[question.target.scene].name}: target {question.target.state}",
        )
        for question in questions
    ]
    solutions = learn_weights(problems, settings, settings.processes or None)
    for question, solution in zip(questions, solutions, strict=True):
        if question.trained and not solution.solved:
            raise InputError(
                f"{solution.name}: {settings.method} ended as `{solution.status}` ({solution.message}); "
                "change its settings under irl."
            )
    return tuple(
        DemonstratedReward(question.target, question.starts, solution, question.trained)
        for question, solution in zip(questions, solutions, strict=True)
        if solution.solved
    )


def _questions(
    scenes: Sequence[Scene],
    split: TaskSplit,
    trajectories: Sequence[tuple[Trajectory, ...]],
    settings: IrlSettings,
) -> list[_Question]:
    """The problems to solve, those of training targets first."""
    questions = []
    for target, own in zip(split.training, trajectories, strict=True):
        leading = [trajectory.states[:-1] for trajectory in own]
        pools = [np.unique(np.concatenate(leading))] if settings.pooling == "target" else leading
        questions += [_Question(target, pool, True) for pool in pools]
    for number in range(len(scenes)) if settings.sub_trajectories else ():
        inside = [
            t for target, own in zip(split.training, trajectories, strict=True) if target.scene == number for t in own
        ]
        trained = {target.state for target in split.training if target.scene == number}
        forbidden = split.evaluation_only(number) | trained
        questions += [
            _Question(Target(number, end), starts, False) for end, starts in sub_trajectories(inside, forbidden).items()
        ]
    return questions
