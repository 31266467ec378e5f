"""Rewards learned from the demonstrations of one seed: φ, demonstrated weights, and regressors that predict weights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Float32, Float64, Int32

from relm_irl_jax.elm import ELMRegressor
from relm_irl_jax.irl import WeightsOf
from relm_irl_jax.rewards.basis import RewardBasis, fit_basis
from relm_irl_jax.rewards.demonstrated import DemonstratedReward, learn_demonstrated_rewards
from relm_irl_jax.rewards.equation import LinearRewardForm, form_of
from relm_irl_jax.rewards.functions import LinearReward
from relm_irl_jax.rewards.predicted import RewardPredictor, fit_regressor, pair_data
from relm_irl_jax.rewards.settings import ElmSettings, IrlSettings
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.tasks import Target, TaskSplit
from relm_irl_jax.world import scene_offsets


@dataclass(frozen=True)
class LearnedRewards:
    """Everything learned from the demonstrations of one seed.

    Attributes:
        basis: the reward features, as a function of a scene.
        phi: reward features of each training scene.
        demonstrated: weights of demonstrated targets.
        regressors: fitted regressor of each method that predicts weights.
        form: bounds of the rewards.
    """

    basis: RewardBasis
    phi: tuple[Float64[np.ndarray, "_ d"], ...]
    demonstrated: tuple[DemonstratedReward, ...]
    regressors: Mapping[str, ELMRegressor]
    form: LinearRewardForm


def learn_rewards(
    scenes: Sequence[Scene],
    split: TaskSplit,
    irl: IrlSettings,
    elm: ElmSettings,
    seed: int,
    *,
    weights_of: WeightsOf | None = None,
) -> LearnedRewards:
    """Learn rewards from demonstrations, and fit the regressors that predict weights for other pairs of views.

    Args:
        scenes: encoded training scenes.
        split: the targets of all tasks; only training targets are demonstrated.
        irl: demonstrations and inverse reinforcement learning.
        elm: the regressors.
        seed: the run's seed.
        weights_of: a user's own source of weights, instead of the IRL method.

    Returns:
        The learned rewards.

    Raises:
        InputError: the settings do not suit the scenes, or a problem has no solution.
    """
    learned = learn_demonstrated(scenes, split, irl, seed, weights_of=weights_of)
    return replace(learned, regressors=fit_regressors(scenes, learned.demonstrated, elm, seed))


def learn_demonstrated(
    scenes: Sequence[Scene],
    split: TaskSplit,
    settings: IrlSettings,
    seed: int,
    *,
    weights_of: WeightsOf | None = None,
) -> LearnedRewards:
    """Learn rewards from demonstrations alone.

    Args:
        scenes: encoded training scenes.
        split: the targets of all tasks; only training targets are demonstrated.
        settings: demonstrations and inverse reinforcement learning.
        seed: the run's seed.
        weights_of: see `learn_rewards`.

    Returns:
        The learned rewards, without regressors.

    Raises:
        InputError: the settings do not suit the scenes, or a problem has no solution.
    """
    basis = fit_basis(scenes, settings.dimension)
    phi = tuple(basis.phi(scene) for scene in scenes)
    demonstrated = learn_demonstrated_rewards(scenes, split, phi, settings, seed, weights_of=weights_of)
    return LearnedRewards(basis, phi, demonstrated, {}, form_of(settings))


def fit_regressors(
    scenes: Sequence[Scene], demonstrated: Sequence[DemonstratedReward], settings: ElmSettings, seed: int
) -> dict[str, ELMRegressor]:
    """Fit the regressors of ELM-IRL and RELM-IRL.

    Args:
        scenes: encoded training scenes.
        demonstrated: the demonstrated rewards.
        settings: the regressors' settings.
        seed: the run's seed.

    Returns:
        The fitted regressor of each method.
    """
    data = pair_data(scenes, demonstrated, settings.pairs, np.random.default_rng([seed, 2]))
    return {
        "elm-irl": fit_regressor(data, settings, seed, regularised=False),
        "relm-irl": fit_regressor(data, settings, seed, regularised=True),
    }


def demonstrated_reward(scenes: Sequence[Scene], targets: Sequence[Target], learned: LearnedRewards) -> LinearReward:
    """The reward of the IRL baseline: weights of the target's own demonstrations.

    If every trajectory has its own weights, the reward of an episode uses those of the trajectory nearest to its start.

    Args:
        scenes: training scenes.
        targets: training targets in the order of `relm_irl_jax.world.Targets`.
        learned: the learned rewards.

    Returns:
        The reward function.
    """
    trained = [demonstrated for demonstrated in learned.demonstrated if demonstrated.trained]
    row = np.zeros((len(targets), max(scene.n_states for scene in scenes)), np.int32)
    for number, target in enumerate(targets):
        to_target = [i for i, demonstrated in enumerate(trained) if demonstrated.target == target]
        distance = scenes[target.scene].shortest_path_distance
        to_starts = [distance[:, trained[i].starts] for i in to_target]
        distance_to_trajectory = np.stack([np.where(d < 0, len(d), d).min(1) for d in to_starts])
        row[number, : len(distance)] = np.asarray(to_target)[distance_to_trajectory.argmin(0)]
    weights = np.stack([demonstrated.weights for demonstrated in trained])
    return _linear_reward(weights, row, learned.phi, learned.form)


def predicted_reward(
    scenes: Sequence[Scene], targets: Sequence[Target], predictor: RewardPredictor, *, from_current_view: bool
) -> LinearReward:
    """The reward of ELM-IRL and RELM-IRL: weights predicted for every (start, target) pair, without an expert.

    Args:
        scenes: scenes of the world.
        targets: targets in the order of `relm_irl_jax.world.Targets`.
        predictor: predicts weights in these scenes.
        from_current_view: whether the weights are predicted from the current view instead of the start's.

    Returns:
        The reward function.
    """
    row = np.zeros((len(targets), max(scene.n_states for scene in scenes)), np.int32)
    weights, first = [], 0
    for number, target in enumerate(targets):
        weights.append(predictor.weights_to(target).astype(np.float32))  # a table for each target, of all its states
        size = len(weights[-1])
        row[number, :size] = first + np.arange(size)
        first += size
    return _linear_reward(
        np.concatenate(weights), row, predictor.phi, predictor.form, from_current_view=from_current_view
    )


def predicted_observations(
    scenes: Sequence[Scene], targets: Sequence[Target], predictor: RewardPredictor
) -> Float32[np.ndarray, "targets states"]:
    """The predicted rewards that a policy observes as an input (the paper's Figure 2).

    Args:
        scenes: scenes of the world.
        targets: targets in the order of `relm_irl_jax.world.Targets`.
        predictor: predicts rewards in these scenes.

    Returns:
        r(s, g) / r_max with weights predicted from the view of s, in [-1, 0], or in [-1, 1] in the free form; 0 for
        states outside the target's scene.
    """
    offsets = scene_offsets(scenes)
    observed = np.zeros((len(targets), sum(scene.n_states for scene in scenes)), np.float32)
    for row, target in enumerate(targets):
        reward = predictor.rewards_to(target) / predictor.form.r_max
        observed[row, offsets[target.scene] :][: len(reward)] = reward
    return observed


def _linear_reward(
    weights: Float[np.ndarray, "rows d"],
    row: Int32[np.ndarray, "targets locals"],
    phi: Sequence[Float64[np.ndarray, "_ d"]],
    form: LinearRewardForm,
    *,
    from_current_view: bool = False,
) -> LinearReward:
    # Padded to the largest number of rows of any method, so that all methods and seeds share one compiled training.
    padding = max(row.size - len(weights), 0)
    return LinearReward(
        weights=jnp.asarray(np.pad(weights, ((0, padding), (0, 0))), jnp.float32),
        row=jnp.asarray(row),
        phi=jnp.asarray(np.concatenate(list(phi)), jnp.float32),
        form=LinearRewardForm(jnp.float32(form.r_max), jnp.float32(form.minimum_cost), form.relative),
        from_current_view=from_current_view,
    )
