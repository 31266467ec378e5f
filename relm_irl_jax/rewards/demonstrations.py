"""Demonstrations to reward weights: shortest-path walks to the training targets, one IRL problem per target or walk.

Each record pairs the weights w that IRL found for a target with the starts from which demonstrations lead to it; the
extreme learning machine is fitted on exactly these (start, target) → w pairs. Every sub-walk of a shortest path is a
shortest path, so the states along the demonstrations serve as further targets at no cost; targets kept for evaluation
never do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float32, Float64, Int32
from pydantic import Field, NonNegativeInt, PositiveInt
from pydantic.dataclasses import dataclass as settings_dataclass

from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import Trajectory, shortest_path_expert, shortest_path_trajectories, sub_trajectories
from relm_irl_jax.irl import IrlMethodSettings, MaxMarginProblem, MaxMarginSettings, Solution, learn_weights
from relm_irl_jax.irl.apprenticeship import ApprenticeshipSettings
from relm_irl_jax.irl.max_entropy import MaxEntropySettings
from relm_irl_jax.irl.max_margin_planning import MaxMarginPlanningSettings
from relm_irl_jax.irl.methods import Method
from relm_irl_jax.scenes.scene import Scene, successors
from relm_irl_jax.tasks import Target, TaskSplit


@settings_dataclass(frozen=True)
class IrlSettings:
    """Demonstrations and the inverse reinforcement learning from them."""

    trajectories: PositiveInt = 16
    """Expert trajectories for each training target, from distinct random starts."""
    pooling: Literal["target", "trajectory"] = "target"
    """One problem for all trajectories of a target, or one for each trajectory."""
    dimension: NonNegativeInt = 64
    """Principal components of the view features that make φ; 0 keeps all of them."""
    sub_walks: bool = True
    """Let states along the demonstrations serve as further targets for the extreme learning machine."""
    method: Method = "max-margin"
    """Where w comes from: `max-margin` (the paper's), `apprenticeship` (Abbeel and Ng), `max-margin-planning`
    (Ratliff) or `max-entropy` (Ziebart)."""
    program: MaxMarginSettings = MaxMarginSettings(regularisation=10.0, compare_with_lp=False)
    """The maximum-margin program; its form, discount and r_max hold for all methods. λ = 10 keeps 94% of the linear
    program's objective, and weights predicted for new targets rank them far higher than with a smaller λ."""
    apprenticeship: ApprenticeshipSettings = ApprenticeshipSettings()
    """Apprenticeship learning."""
    planning: MaxMarginPlanningSettings = MaxMarginPlanningSettings()
    """Maximum-margin planning."""
    maxent: MaxEntropySettings = MaxEntropySettings()
    """Maximum-entropy IRL."""
    least_cost: Annotated[float, Field(ge=0, le=1)] = 0.6
    """Least cost of a step in the learned reward, as a share of r_max; with 0, states of no cost invite to stay. Ways
    that are best under predicted rewards are longer than the shortest by 0.9% with 0.3 and by 0.1% with 0.6, and the
    metric agent's SPL on new targets is .72 and .80 (RELM-IRL, 1.2M frames)."""
    processes: Annotated[int, Field(ge=0)] = 0
    """Processes that solve problems side by side; 0 takes one a core."""


@dataclass(frozen=True)
class RewardBasis:
    """φ(s) = (x(s) − mean) components: principal components of the training scenes' view features x.

    One factor scales all of them, so that ‖φ(s)‖² has mean d over the training scenes: the regulariser of the
    program then does not depend on the units of x.

    Attributes:
        mean: mean view.
        components: loadings, the scale included.
    """

    mean: Float64[np.ndarray, "feature"]
    components: Float64[np.ndarray, "feature d"]

    def __call__(self, features: Float32[np.ndarray, "states feature"]) -> Float64[np.ndarray, "states d"]:
        """Return φ of view features."""
        return (features - self.mean) @ self.components


@dataclass(frozen=True)
class DemonstratedReward:
    """Weights learned for one target.

    Attributes:
        target: the target; its scene numbers the training scenes.
        starts: states from which demonstrations lead to the target.
        solution: the solved program, with weights w.
        trained: whether the target is a training target; otherwise it ends a sub-walk.
    """

    target: Target
    starts: Int32[np.ndarray, "starts"]
    solution: Solution
    trained: bool


def fit_basis(scenes: Sequence[Scene], dimension: int) -> RewardBasis:
    """Fit φ on the views of the training scenes.

    Args:
        scenes: encoded training scenes.
        dimension: number of principal components; 0 for all that the views span.

    Returns:
        The basis.

    Raises:
        InputError: more components are asked for than the views span.
    """
    features = np.concatenate([np.asarray(scene.encoded, np.float64) for scene in scenes])
    mean = features.mean(0)
    variance, directions = np.linalg.eigh((features - mean).T @ (features - mean) / len(features))
    spanned = int((variance > variance[-1] * 1e-12).sum())
    if dimension > spanned:
        raise InputError(f"irl.dimension: {dimension} asked for, the training views span {spanned}; ask for fewer.")
    kept = slice(-1, -(dimension or spanned) - 1, -1)
    scale = np.sqrt((dimension or spanned) / variance[kept].sum())
    return RewardBasis(mean, directions[:, kept] * scale)


def demonstrate(scene: Scene, target: Target, count: int, generator: np.random.Generator) -> tuple[Trajectory, ...]:
    """Walk the shortest-path expert to a target from distinct random starts.

    Args:
        scene: the target's scene.
        target: the target.
        count: number of walks; fewer where fewer states can reach the target.
        generator: source of randomness.

    Returns:
        The walks.
    """
    able = np.flatnonzero(scene.shortest_path_distance[:, target.state] > 0)
    return shortest_path_trajectories(scene, target.state, generator.choice(able, min(count, len(able)), replace=False))


def demonstrations_of(
    scenes: Sequence[Scene], split: TaskSplit, settings: IrlSettings, seed: int
) -> list[tuple[Trajectory, ...]]:
    """All demonstrations of one seed, the same for every method that learns from them.

    Args:
        scenes: encoded training scenes.
        split: the targets; only those of training are demonstrated.
        settings: how many demonstrations.
        seed: the run's seed.

    Returns:
        The walks to each training target, in the order of the targets.
    """
    generator = np.random.default_rng([seed, 1])
    return [demonstrate(scenes[t.scene], t, settings.trajectories, generator) for t in split.training]


def learn_rewards(
    scenes: Sequence[Scene], split: TaskSplit, basis: RewardBasis, settings: IrlSettings, seed: int
) -> list[DemonstratedReward]:
    """Demonstrate every training target and solve for its reward weights.

    Args:
        scenes: encoded training scenes.
        split: the targets; those for evaluation are never demonstrated, nor used as ends of sub-walks.
        basis: φ.
        settings: how many demonstrations, and the program.
        seed: the run's seed.

    Returns:
        One record for each solved problem, those of training targets first; problems without a decision to learn
        from are left out.

    Raises:
        InputError: a training target's problem has no solution; the message names it and the status.
    """
    walks = demonstrations_of(scenes, split, settings, seed)
    asked: list[tuple[Target, np.ndarray, bool]] = []
    for target, trajectories in zip(split.training, walks, strict=True):
        leading = [trajectory.states[:-1] for trajectory in trajectories]
        pools = [np.unique(np.concatenate(leading))] if settings.pooling == "target" else leading
        asked += [(target, pool, True) for pool in pools]
    if settings.sub_walks:
        for number in range(len(scenes)):
            inside = [
                walk for t, group in zip(split.training, walks, strict=True) if t.scene == number for walk in group
            ]
            trained = {target.state for target in split.training if target.scene == number}
            forbidden = split.evaluation_only(number) | trained
            asked += [
                (Target(number, end), starts, False) for end, starts in sub_trajectories(inside, forbidden).items()
            ]
    features = [basis(scene.encoded) for scene in scenes]
    following = [successors(scene.graph) for scene in scenes]
    problems = [
        MaxMarginProblem(
            features[target.scene],
            following[target.scene],
            shortest_path_expert(scenes[target.scene], target.state),
            states,
            name=f"{scenes[target.scene].name}: target {target.state}",
        )
        for target, states, _ in asked
    ]
    source = IrlMethodSettings(
        settings.method, settings.program, settings.apprenticeship, settings.planning, settings.maxent
    )
    solutions = learn_weights(problems, source, settings.processes or None)
    for (_, _, trained), solution in zip(asked, solutions, strict=True):
        if trained and not solution.solved:
            raise InputError(
                f"{solution.name}: {settings.method} ended as `{solution.status}` ({solution.message}); "
                "change its settings under irl."
            )
    return [
        DemonstratedReward(target, states, solution, trained)
        for (target, states, trained), solution in zip(asked, solutions, strict=True)
        if solution.solved
    ]
