"""Second stage: rewards are learned from demonstrations and saved in the run folder with their quality."""

from collections.abc import Sequence

import numpy as np

from relm_irl_jax.config import Config, Method
from relm_irl_jax.elm import ELMRegressor, load_elm, save_elm
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import load_arrays, save_arrays, write_table
from relm_irl_jax.irl import WeightsOf
from relm_irl_jax.progress import console
from relm_irl_jax.results import PREDICTED, RewardQualityRow, save_reward_quality
from relm_irl_jax.rewards.basis import RewardBasis
from relm_irl_jax.rewards.demonstrated import DemonstratedReward, describe_recorded
from relm_irl_jax.rewards.equation import form_of, linear_reward
from relm_irl_jax.rewards.learned import LearnedRewards, learn_rewards
from relm_irl_jax.rewards.predicted import RewardPredictor
from relm_irl_jax.rewards.quality import RewardQuality, predicted_reward_quality, reward_quality
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.saved_maps import StateMap, save_map
from relm_irl_jax.saved_poses import poses_of
from relm_irl_jax.scenes.scene import Scene, first_of_each_type
from relm_irl_jax.tasks import Target, TaskSplit


def learn(
    config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int, *, weights_of: WeightsOf | None = None
) -> LearnedRewards:
    """Learn the rewards of one seed.

    Args:
        config: the configuration.
        scenes: encoded training scenes.
        split: the targets of all tasks.
        seed: the run's seed.
        weights_of: a user's own source of weights, instead of the configuration's method.

    Returns:
        The learned rewards.
    """
    announce_recorded(config, scenes, split, seed)
    return learn_rewards(scenes, split, config.irl, config.elm, seed, weights_of=weights_of)


def announce_recorded(config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int) -> None:
    """Print on standard error what recorded demonstrations are used for, if there are some.

    Args:
        config: the configuration.
        scenes: training scenes.
        split: the targets of all tasks.
        seed: the run's seed.
    """
    if config.irl.demonstrations is not None:
        used = describe_recorded(scenes, split, config.irl.demonstrations)
        console.print(f"Seed {seed}: {used}", highlight=False, soft_wrap=True)


def save_rewards(
    scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards, seed: int, folder: RunFolder, *, maps: bool
) -> None:
    """Save learned rewards and their quality in the run folder, and for the first seed also maps.

    Args:
        scenes: encoded training scenes.
        split: the targets of all tasks.
        learned: the learned rewards.
        seed: the run's seed.
        folder: the run folder.
        maps: whether to save maps.
    """
    save_arrays(
        folder.rewards(seed, "demonstrated.safetensors"),
        {
            "mean": learned.basis.mean,
            "components": learned.basis.components,
            "weights": np.stack([reward.weights for reward in learned.demonstrated]),
            "starts": np.concatenate([reward.starts for reward in learned.demonstrated]),
            "start_count": np.asarray([len(reward.starts) for reward in learned.demonstrated]),
            "scene": np.asarray([reward.target.scene for reward in learned.demonstrated]),
            "target": np.asarray([reward.target.state for reward in learned.demonstrated]),
            "trained": np.asarray([reward.trained for reward in learned.demonstrated]),
        },
    )
    for method, regressor in learned.regressors.items():
        save_elm(regressor, folder.rewards(seed, f"{method}.safetensors"))
    regularised = learned.regressors["relm-irl"]
    if regularised.press_curve_ is not None:
        neurons = np.arange(1, len(regularised.press_curve_) + 1)
        curve = {"neurons": neurons, "mean_squared_error": regularised.press_curve_}
        write_table(folder.rewards(seed, "press.csv"), curve)
    if maps and seed == 0:
        _save_maps(scenes, split, learned, folder)
    # The last file: where it is, the others are.
    save_reward_quality(folder.rewards(seed, "quality.csv"), reward_quality_rows(scenes, split, learned, seed))


def load_rewards(
    config: Config, folder: RunFolder, scenes: Sequence[Scene], split: TaskSplit, seed: int
) -> LearnedRewards | None:
    """Read the learned rewards of a seed, which an interrupted run has left.

    Args:
        config: the configuration as run.
        folder: the run folder.
        scenes: encoded training scenes.
        split: the targets of all tasks.
        seed: the run's seed.

    Returns:
        The same as was learned; None if the files are not all there and whole, so that they must be learned again.
    """
    if not folder.rewards(seed, "quality.csv").is_file():
        return None
    try:
        arrays = load_arrays(folder.rewards(seed, "demonstrated.safetensors"))
        regressors: dict[str, ELMRegressor] = {
            method: load_elm(folder.rewards(seed, f"{method}.safetensors")) for method in PREDICTED
        }
        basis = RewardBasis(arrays["mean"], arrays["components"])
        ends = np.cumsum(arrays["start_count"])
        columns = zip(
            arrays["scene"].tolist(),
            arrays["target"].tolist(),
            np.split(arrays["starts"], ends[:-1]),
            arrays["weights"],
            arrays["trained"].tolist(),
            strict=True,
        )
        chosen = {(target.scene, target.state): target for target in split.training}
        demonstrated = tuple(
            DemonstratedReward(chosen[scene, state] if trained else Target(scene, state), starts, weights, trained)
            for scene, state, starts, weights, trained in columns
        )
        phi = tuple(basis.phi(scene) for scene in scenes)
    except (InputError, KeyError, ValueError, IndexError, TypeError):
        return None
    return LearnedRewards(basis, phi, demonstrated, regressors, form_of(config.irl))


def make_predictor(learned: LearnedRewards, method: Method, scenes: Sequence[Scene]) -> RewardPredictor | None:
    """Make the predictor of a method's rewards in the training scenes.

    Args:
        learned: the learned rewards.
        method: the method.
        scenes: encoded training scenes.

    Returns:
        The predictor; None for methods that predict no reward.
    """
    if method not in learned.regressors:
        return None
    return RewardPredictor(scenes, learned.phi, learned.regressors[method], learned.form)


def load_predictor(
    config: Config, folder: RunFolder, method: Method, seed: int, scenes: Sequence[Scene]
) -> RewardPredictor | None:
    """Load the predictor of a method's rewards, for any scenes, from the run folder.

    Args:
        config: the configuration as run.
        folder: the run folder.
        method: the method.
        seed: the run's seed.
        scenes: encoded scenes.

    Returns:
        The predictor; None for methods that predict no reward.

    Raises:
        InputError: a file is missing or damaged.
    """
    if method not in PREDICTED:
        return None
    path = folder.rewards(seed, "demonstrated.safetensors")
    arrays = load_arrays(path)
    if not {"mean", "components"} <= set(arrays):
        raise InputError(f"{path}: `mean` or `components` is missing; remove the folder {path.parent} and train again.")
    basis = RewardBasis(arrays["mean"], arrays["components"])
    regressor = load_elm(folder.rewards(seed, f"{method}.safetensors"))
    return RewardPredictor(scenes, [basis.phi(scene) for scene in scenes], regressor, form_of(config.irl))


def reward_quality_rows(
    scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards, seed: int
) -> list[RewardQualityRow]:
    """Quality of every method's reward, for trained and for new targets.

    Args:
        scenes: encoded training scenes.
        split: the targets of all tasks.
        learned: the learned rewards.
        seed: the run's seed.

    Returns:
        The rows.
    """
    by_method: dict[tuple[str, str], list[RewardQuality]] = {
        ("irl", "trained"): [
            reward_quality(
                scenes[reward.target.scene],
                reward.target.state,
                learned.phi[reward.target.scene],
                reward.weights,
                learned.form,
            )
            for reward in learned.demonstrated
            if reward.trained
        ]
    }
    groups = {"trained": split.training, "new": split.new, "uniform": split.uniform}
    for method, regressor in learned.regressors.items():
        predictor = RewardPredictor(scenes, learned.phi, regressor, learned.form)
        for name, targets in groups.items():
            generator = np.random.default_rng([seed, 3])
            by_method[method, name] = predicted_reward_quality(scenes, targets, predictor, generator)
    return [
        RewardQualityRow(
            method=method,
            targets=name,  # pyrefly: ignore
            median_rank=float(np.median([quality.rank for quality in qualities])),
            median_rank_share=round(float(np.median([quality.rank / quality.states for quality in qualities])), 4),
            mean_order=round(float(np.nanmean([quality.order for quality in qualities])), 4),
        )
        for (method, name), qualities in by_method.items()
    ]


def _save_maps(scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards, folder: RunFolder) -> None:
    """Save maps of all learned rewards in one room of each type, for a trained and for a new target."""
    demonstrated = {reward.target: reward.weights for reward in learned.demonstrated if reward.trained}
    predictors = {method: make_predictor(learned, method, scenes) for method in PREDICTED}
    for room_type, number in first_of_each_type(scenes).items():
        for name, targets in (("trained", split.training), ("new", split.new)):
            target = next(target for target in targets if target.scene == number)
            start = int(scenes[number].shortest_path_distance[:, target.state].argmax())
            weights = {"irl": demonstrated[target]} if target in demonstrated else {}
            for method, predictor in predictors.items():
                assert predictor is not None
                weights[method] = predictor.weights(number, np.asarray([start]), np.asarray([target.state]))[0]
            state_map = StateMap(
                poses=poses_of(scenes[number]),
                seed=0,
                target=target.state,
                category=target.category,
                values={method: _rewards_of_states(learned, target, w) for method, w in weights.items()},
                start=start,
                limits=(-float(learned.form.r_max), 0.0 if learned.form.relative else float(learned.form.r_max)),
            )
            save_map(folder.reward_map(name, room_type), state_map)


def _rewards_of_states(learned: LearnedRewards, target: Target, weights: np.ndarray) -> np.ndarray:
    """The reward that an agent receives for arriving in each state of the target's scene."""
    phi = learned.phi[target.scene]
    return linear_reward(weights, phi, phi[target.state], np.arange(len(phi)) == target.state, learned.form)
