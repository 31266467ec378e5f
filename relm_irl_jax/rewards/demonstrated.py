"""Inverse reinforcement learning from demonstrations: one problem for each target, or for each trajectory.

A demonstrated reward consists of the weights w that IRL learned for a target, and of the starts of the demonstrations.
The extreme learning machine is fitted to these (start, target) → w pairs. Every part of a shortest path is a shortest
path, so the states along the demonstrations can serve as further targets. Evaluation targets never do.
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

EXPERTS_IN_MEMORY = 30_000_000
"""Most states, over all problems, whose expert is in memory at once: an expert takes 16 bytes a state."""


@dataclass(frozen=True)
class DemonstratedReward:
    """Weights learned for one target.

    Attributes:
        target: the target, in a training scene.
        starts: states from which demonstrations lead to the target.
        solution: the solved problem, with weights w.
        trained: whether the target is a training target; otherwise it is the end of a sub-trajectory.
    """

    target: Target
    starts: Int32[np.ndarray, "starts"]
    solution: Solution
    trained: bool


@dataclass(frozen=True)
class _TargetStarts:
    """Data of one problem: a target and the states from which demonstrations lead to it."""

    target: Target
    starts: Int32[np.ndarray, "starts"]
    trained: bool


def demonstrate(scene: Scene, target: Target, count: int, generator: np.random.Generator) -> tuple[Trajectory, ...]:
    """Shortest-path trajectories to a target from distinct random starts.

    Args:
        scene: the target's scene.
        target: the target.
        count: number of trajectories; fewer if fewer states can reach the target.
        generator: source of randomness.

    Returns:
        The trajectories.
    """
    possible = np.flatnonzero(scene.shortest_path_distance[:, target.state] > 0)
    starts = generator.choice(possible, min(count, len(possible)), replace=False)
    return shortest_path_trajectories(scene, target.state, starts.tolist())


def demonstrate_targets(
    scenes: Sequence[Scene], split: TaskSplit, settings: IrlSettings, seed: int
) -> list[tuple[Trajectory, ...]]:
    """All demonstrations of one seed; they are the same for every method that learns from them.

    Args:
        scenes: training scenes.
        split: the targets; only training targets are demonstrated.
        settings: number of demonstrations.
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
        split: the targets; evaluation targets are neither demonstrated nor used as ends of sub-trajectories.
        phi: reward features of each scene.
        settings: number of demonstrations, and the IRL method.
        seed: the run's seed.

    Returns:
        The demonstrated rewards, those of training targets first; sub-trajectories whose problem has no solution are
        left out.

    Raises:
        InputError: the problem of a training target has no solution.
    """
    to_solve = _problems_to_solve(scenes, split, demonstrate_targets(scenes, split, settings, seed), settings)
    next_states = [successors(scene.graph) for scene in scenes]

    def problem(item: _TargetStarts) -> MaxMarginProblem:
        number = item.target.scene
        expert = shortest_path_expert(scenes[number], item.target.state)
        name = f"{scenes[number].name}: target {item.target.state}"
        return MaxMarginProblem(phi[number], next_states[number], expert, item.starts, name=name)

    in_part = max(1, EXPERTS_IN_MEMORY // max(scene.n_states for scene in scenes))
    parts = [to_solve[first : first + in_part] for first in range(0, len(to_solve), in_part)]
    solutions = []
    for number, part in enumerate(parts, start=1):
        description = "inverse RL" if len(parts) == 1 else f"inverse RL, part {number}/{len(parts)}"
        solutions += learn_weights([problem(item) for item in part], settings, settings.processes or None, description)
    for item, solution in zip(to_solve, solutions, strict=True):
        if item.trained and not solution.solved:
            raise InputError(
                f"{solution.name}: {settings.method} ended as `{solution.status}` ({solution.message}); "
                "change its settings under irl."
            )
    return tuple(
        DemonstratedReward(item.target, item.starts, solution, item.trained)
        for item, solution in zip(to_solve, solutions, strict=True)
        if solution.solved
    )


def _problems_to_solve(
    scenes: Sequence[Scene],
    split: TaskSplit,
    trajectories: Sequence[tuple[Trajectory, ...]],
    settings: IrlSettings,
) -> list[_TargetStarts]:
    """The problems to solve, those of training targets first."""
    to_solve = []
    for target, to_target in zip(split.training, trajectories, strict=True):
        starts = [trajectory.states[:-1] for trajectory in to_target]
        pools = [np.unique(np.concatenate(starts))] if settings.pooling == "target" else starts
        to_solve += [_TargetStarts(target, pool, True) for pool in pools]
    for number in range(len(scenes)) if settings.sub_trajectories else ():
        in_scene = [
            trajectory
            for target, to_target in zip(split.training, trajectories, strict=True)
            if target.scene == number
            for trajectory in to_target
        ]
        trained = {target.state for target in split.training if target.scene == number}
        excluded = split.evaluation_only(number) | trained
        to_solve += [
            _TargetStarts(Target(number, end), starts, False)
            for end, starts in sub_trajectories(in_scene, excluded).items()
        ]
    return to_solve
