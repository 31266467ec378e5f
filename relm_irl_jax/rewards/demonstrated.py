"""Inverse reinforcement learning from demonstrations: one problem for each target, or for each trajectory.

A demonstrated reward consists of the weights w that IRL learned for a target, and of the starts of the demonstrations.
The extreme learning machine is fitted to these (start, target) → w pairs. Every part of a shortest path is a shortest
path, so the states along the demonstrations can serve as further targets. Evaluation targets never do.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int32

from relm_irl_jax.demonstrations import expert_from_demonstrations, load_demonstrations_by_scene
from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import (
    Expert,
    Trajectory,
    shortest_path_expert,
    shortest_path_trajectories,
    sub_trajectories,
)
from relm_irl_jax.irl import MaxMarginProblem, WeightsOf, learn_weights, learn_weights_by
from relm_irl_jax.progress import console
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
        weights: the weights w that solve the problem.
        trained: whether the target is a training target; otherwise it is the end of a sub-trajectory.
    """

    target: Target
    starts: Int32[np.ndarray, "starts"]
    weights: Float64[np.ndarray, "d"]
    trained: bool


@dataclass(frozen=True)
class _TargetStarts:
    """Data of one problem: a target, the states from which demonstrations lead to it, and recorded demonstrations."""

    target: Target
    starts: Int32[np.ndarray, "starts"]
    trained: bool
    recorded: tuple[Trajectory, ...] = ()

    def expert(self, scene: Scene) -> Expert:
        """The expert that takes the recorded actions, or a shortest path."""
        if self.recorded:
            return expert_from_demonstrations(scene, self.recorded)
        return shortest_path_expert(scene, self.target.state)


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
    shown = [demonstrate(scenes[t.scene], t, settings.trajectories, generator) for t in split.training]
    recorded = recorded_demonstrations(scenes, split, settings.demonstrations)
    return [recorded.get(target, of_target) for target, of_target in zip(split.training, shown, strict=True)]


def recorded_demonstrations(
    scenes: Sequence[Scene], split: TaskSplit, path: Path | None
) -> dict[Target, tuple[Trajectory, ...]]:
    """Recorded demonstrations that lead to training targets; all others, above all those to evaluation targets, are
    left out.

    Args:
        scenes: training scenes.
        split: the targets.
        path: the file; None for no recorded demonstrations.

    Returns:
        The demonstrations of each training target that has some.

    Raises:
        InputError: the file cannot be used, or no demonstration in it leads to a training target.
    """
    if path is None:
        return {}
    loaded = load_demonstrations_by_scene(path, scenes)
    recorded = {target: tuple(t for t in loaded[target.scene] if t.target == target.state) for target in split.training}
    recorded = {target: trajectories for target, trajectories in recorded.items() if trajectories}
    if not recorded:
        first = split.training[0]
        raise InputError(
            f"{path}: no demonstration leads to a training target, such as state {first.state} of "
            f"{scenes[first.scene].name}; `relm-irl demonstrations` writes the expert's, which name all targets."
        )
    return recorded


def describe_recorded(scenes: Sequence[Scene], split: TaskSplit, path: Path) -> str:
    """One sentence on what a file of demonstrations is used for.

    Args:
        scenes: training scenes.
        split: the targets.
        path: the file.

    Returns:
        The sentence, with numbers of demonstrations and of targets.

    Raises:
        InputError: see `recorded_demonstrations`.
    """
    recorded = recorded_demonstrations(scenes, split, path)
    total = sum(map(len, load_demonstrations_by_scene(path, scenes)))
    used, without = sum(map(len, recorded.values())), len(split.training) - len(recorded)
    return (
        f"{path}: {used} of {total} demonstrations lead to {len(recorded)} of {len(split.training)} training targets "
        f"and are used; the shortest-path expert demonstrates the other {without} targets."
    )


def learn_demonstrated_rewards(
    scenes: Sequence[Scene],
    split: TaskSplit,
    phi: Sequence[Float64[np.ndarray, "_ d"]],
    settings: IrlSettings,
    seed: int,
    *,
    weights_of: WeightsOf | None = None,
) -> tuple[DemonstratedReward, ...]:
    """Demonstrate every training target and solve for its reward weights.

    Args:
        scenes: training scenes.
        split: the targets; evaluation targets are neither demonstrated nor used as ends of sub-trajectories.
        phi: reward features of each scene.
        settings: number of demonstrations, and the IRL method.
        seed: the run's seed.
        weights_of: a user's own source of weights, instead of the IRL method.

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
        expert = item.expert(scenes[number])
        name = f"{scenes[number].name}: target {item.target.state}"
        return MaxMarginProblem(phi[number], next_states[number], expert, item.starts, name=name)

    in_part = max(1, EXPERTS_IN_MEMORY // max(scene.n_states for scene in scenes))
    parts = [to_solve[first : first + in_part] for first in range(0, len(to_solve), in_part)]
    solutions, began = [], time.monotonic()
    for number, part in enumerate(parts, start=1):
        if weights_of is not None:
            solutions += learn_weights_by(weights_of, [problem(item) for item in part], settings)
            continue
        description = "inverse RL" if len(parts) == 1 else f"inverse RL, part {number}/{len(parts)}"
        solutions += learn_weights([problem(item) for item in part], settings, settings.processes or None, description)
        if number < len(parts):
            left = (time.monotonic() - began) * (len(to_solve) / len(solutions) - 1) / 60
            console.print(
                f"inverse RL: {len(solutions):,} of {len(to_solve):,} problems are solved, the others take about "
                f"{left:.0f} min more; fewer trajectories (--irl.trajectories) are fewer problems."
            )
    for item, solution in zip(to_solve, solutions, strict=True):
        if item.trained and not solution.solved:
            raise InputError(
                f"{solution.name}: {settings.method} ended as `{solution.status}` ({solution.message}); "
                "change its settings under irl."
            )
    return tuple(
        DemonstratedReward(item.target, item.starts, solution.w, item.trained)
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
    recorded = recorded_demonstrations(scenes, split, settings.demonstrations)
    to_solve = []
    for target, to_target in zip(split.training, trajectories, strict=True):
        pooled = settings.pooling == "target"
        for group in [to_target] if pooled else [(trajectory,) for trajectory in to_target]:
            states = np.concatenate([trajectory.states[:-1] for trajectory in group])
            states = np.unique(states) if pooled else states
            starts = states[states != target.state].astype(np.int32)
            to_solve.append(_TargetStarts(target, starts, True, group if target in recorded else ()))
    for number in range(len(scenes)) if settings.sub_trajectories else ():
        in_scene = [
            (trajectory, target in recorded)
            for target, to_target in zip(split.training, trajectories, strict=True)
            if target.scene == number
            for trajectory in to_target
        ]
        trained = {target.state for target in split.training if target.scene == number}
        excluded = split.evaluation_only(number) | trained
        parts = _recorded_parts([trajectory for trajectory, is_recorded in in_scene if is_recorded])
        to_solve += [
            _TargetStarts(Target(number, end), starts, False, parts.get(end, ()))
            for end, starts in sub_trajectories([trajectory for trajectory, _ in in_scene], excluded).items()
        ]
    return to_solve


def _recorded_parts(trajectories: Sequence[Trajectory]) -> dict[int, tuple[Trajectory, ...]]:
    """Parts of recorded demonstrations up to the first visit of each of their states."""
    parts: dict[int, tuple[Trajectory, ...]] = {}
    for trajectory in trajectories:
        states = trajectory.states.tolist()
        for end in set(states) - {states[0]}:
            until = states.index(end)
            part = Trajectory(trajectory.states[: until + 1], trajectory.actions[:until], end)
            parts[end] = (*parts.get(end, ()), part)
    return parts
