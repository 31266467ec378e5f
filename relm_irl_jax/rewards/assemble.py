"""Reward models of the methods, as the tables that training looks up."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float32
from pydantic.dataclasses import dataclass as settings_dataclass

from relm_irl_jax.elm import ELMRegressor
from relm_irl_jax.rewards.demonstrations import DemonstratedReward, IrlSettings, RewardBasis
from relm_irl_jax.rewards.model import LinearReward, ManualReward
from relm_irl_jax.rewards.prediction import ElmSettings, ScenePredictor
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import Target
from relm_irl_jax.world import scene_offsets


@settings_dataclass(frozen=True)
class ManualSettings:
    """The hand-made reward of the RL baseline."""

    target: float = 10.0
    """Reward for reaching the target."""
    collision: float = -0.1
    """Reward for an action that collides."""
    step: float = -0.01
    """Reward for any other action."""


def manual_reward(settings: ManualSettings) -> ManualReward:
    """The reward of the RL baseline.

    Args:
        settings: its three values.

    Returns:
        The reward model.
    """
    return ManualReward(jnp.float32(settings.target), jnp.float32(settings.collision), jnp.float32(settings.step))


def demonstrated_reward(
    scenes: Sequence[Scene],
    targets: Sequence[Target],
    records: Sequence[DemonstratedReward],
    basis: RewardBasis,
    settings: IrlSettings,
) -> LinearReward:
    """The reward of the IRL baseline: weights of the target's own demonstrations.

    Where every trajectory has weights of its own, an episode is paid by those of the trajectory that passes nearest
    to its start.

    Args:
        scenes: training scenes.
        targets: training targets in the order of `relm_irl_jax.world.Targets`.
        records: demonstrated rewards.
        basis: φ.
        settings: the inverse reinforcement learning's settings.

    Returns:
        The reward model.
    """
    trained = [record for record in records if record.trained]
    row = np.zeros((len(targets), max(scene.n_states for scene in scenes)), np.int32)
    for number, target in enumerate(targets):
        own = [i for i, record in enumerate(trained) if record.target == target]
        distance = scenes[target.scene].shortest_path_distance
        reach = np.where(distance < 0, len(distance), distance)
        to_walk = np.stack([reach[:, trained[i].starts].min(1) for i in own])
        row[number, : len(distance)] = np.asarray(own)[to_walk.argmin(0)]
    return _linear(np.stack([record.solution.w for record in trained]), row, scenes, basis, settings)


def predicted_reward(
    scenes: Sequence[Scene],
    targets: Sequence[Target],
    machine: ELMRegressor,
    basis: RewardBasis,
    settings: IrlSettings,
    elm: ElmSettings,
) -> LinearReward:
    """The reward of ELM-IRL and RELM-IRL: weights predicted for every (start, target) pair, without an expert.

    Args:
        scenes: scenes of the world.
        targets: targets in the order of `relm_irl_jax.world.Targets`.
        machine: the fitted machine.
        basis: φ.
        settings: the inverse reinforcement learning's settings.
        elm: the machine's settings.

    Returns:
        The reward model.
    """
    sizes = [scenes[target.scene].n_states for target in targets]
    row = np.zeros((len(targets), max(scene.n_states for scene in scenes)), np.int32)
    predictors = [ScenePredictor(scene.encoded, machine) for scene in scenes]
    weights, first = [], 0
    for number, (target, size) in enumerate(zip(targets, sizes, strict=True)):
        weights.append(predictors[target.scene].weights_to(target.state))
        row[number, :size] = first + np.arange(size)
        first += size
    return _linear(np.concatenate(weights), row, scenes, basis, settings, follow=elm.follow)


def predicted_inputs(
    scenes: Sequence[Scene],
    targets: Sequence[Target],
    machine: ELMRegressor,
    basis: RewardBasis,
    settings: IrlSettings,
) -> Float32[np.ndarray, "targets states"]:
    """The predicted reward as something that the agent sees.

    Args:
        scenes: scenes of the world.
        targets: targets in the order of `relm_irl_jax.world.Targets`.
        machine: the fitted machine.
        basis: φ.
        settings: the inverse reinforcement learning's settings.

    Returns:
        r̂(s, g) / r_max, clipped to [-1, 0], or to [-1, 1] in the free form; 0 in other scenes than the target's.
    """
    offsets = scene_offsets(scenes)
    seen = np.zeros((len(targets), sum(scene.n_states for scene in scenes)), np.float32)
    form, r_max = settings.program.form, settings.program.r_max
    predictors = [(ScenePredictor(scene.encoded, machine), basis(scene.encoded)) for scene in scenes]
    for row, target in enumerate(targets):
        predictor, phi = predictors[target.scene]
        reward, first = predictor.rewards_to(target.state, phi, form) / r_max, offsets[target.scene]
        seen[row, first : first + len(phi)] = np.clip(reward, -1, 0 if form == "cost" else 1)
    return seen


def _linear(
    weights: np.ndarray,
    row: np.ndarray,
    scenes: Sequence[Scene],
    basis: RewardBasis,
    settings: IrlSettings,
    *,
    follow: bool = False,
) -> LinearReward:
    # Padded to the most rows that a method may need: one compiled training serves all methods and seeds.
    padding = max(row.size - len(weights), 0)
    return LinearReward(
        weights=jnp.asarray(np.pad(weights, ((0, padding), (0, 0))), jnp.float32),
        row=jnp.asarray(row),
        features=jnp.asarray(np.concatenate([basis(scene.encoded) for scene in scenes]), jnp.float32),
        r_max=jnp.float32(settings.program.r_max),
        least_cost=jnp.float32(settings.least_cost * settings.program.r_max),
        cost_form=settings.program.form == "cost",
        follow=follow,
    )
