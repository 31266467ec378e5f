"""Second stage: rewards learned from demonstrations, and the machines that predict them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relm_irl_jax.config import Config, Method
from relm_irl_jax.elm import ELMRegressor, save_elm
from relm_irl_jax.files import load_arrays, save_arrays, write_table
from relm_irl_jax.irl import reward
from relm_irl_jax.results import RewardQualityRow, TargetGroup, save_reward_quality
from relm_irl_jax.rewards.demonstrations import DemonstratedReward, RewardBasis, fit_basis, learn_rewards
from relm_irl_jax.rewards.prediction import fit_machine, pair_data, pair_inputs
from relm_irl_jax.rewards.quality import RewardQuality, judge, judge_predictions
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.saved_maps import StateMap, poses_of, save_map
from relm_irl_jax.scenes.scene import Scene, first_of_each_type
from relm_irl_jax.tasks import Target, TaskSplit

PREDICTED: tuple[Method, ...] = ("elm-irl", "relm-irl")
"""Methods whose reward a machine predicts."""


@dataclass(frozen=True)
class LearnedRewards:
    """What the demonstrations of one seed taught.

    Attributes:
        basis: φ.
        records: demonstrated rewards.
        machines: the fitted machine of each method that predicts rewards.
    """

    basis: RewardBasis
    records: list[DemonstratedReward]
    machines: dict[Method, ELMRegressor]


def learn_demonstrated(
    config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int
) -> tuple[RewardBasis, list[DemonstratedReward]]:
    """Learn rewards from demonstrations.

    Args:
        config: the configuration; `irl` says how.
        scenes: encoded training scenes.
        split: the targets of all tasks.
        seed: the run's seed.

    Returns:
        φ, and the demonstrated rewards.
    """
    basis = fit_basis(scenes, config.irl.dimension)
    return basis, learn_rewards(scenes, split, basis, config.irl, seed)


def fit_machines(
    config: Config, scenes: Sequence[Scene], records: Sequence[DemonstratedReward], seed: int
) -> dict[Method, ELMRegressor]:
    """Fit the machines that predict rewards for pairs of views that nobody demonstrated.

    Args:
        config: the configuration; `elm` says how.
        scenes: encoded training scenes.
        records: the demonstrated rewards.
        seed: the run's seed.

    Returns:
        The machine of each method that predicts rewards.
    """
    data = pair_data(scenes, records, config.elm.pairs, np.random.default_rng([seed, 2]))
    return {
        "elm-irl": fit_machine(data, config.elm, seed, regularised=False),
        "relm-irl": fit_machine(data, config.elm, seed, regularised=True),
    }


def learn(config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int) -> LearnedRewards:
    """Learn rewards from demonstrations and fit the machines that predict them.

    Args:
        config: the configuration.
        scenes: encoded training scenes.
        split: the targets of all tasks.
        seed: the run's seed.

    Returns:
        The learned rewards.
    """
    basis, records = learn_demonstrated(config, scenes, split, seed)
    return LearnedRewards(basis, records, fit_machines(config, scenes, records, seed))


def keep_rewards(
    scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards, seed: int, folder: RunFolder, *, maps: bool
) -> None:
    """Keep learned rewards in the run folder, and how good they are.

    Args:
        scenes: encoded training scenes.
        split: the targets of all tasks.
        learned: the learned rewards.
        seed: the run's seed.
        folder: the run folder.
        maps: whether to save maps of rewards over rooms, for the first seed.
    """
    basis, records = learned.basis, learned.records
    save_arrays(
        folder.rewards(seed, "demonstrated.safetensors"),
        {
            "mean": basis.mean,
            "components": basis.components,
            "weights": np.stack([record.solution.w for record in records]),
            "scene": np.asarray([record.target.scene for record in records]),
            "target": np.asarray([record.target.state for record in records]),
            "trained": np.asarray([record.trained for record in records]),
        },
    )
    for method, machine_ in learned.machines.items():
        save_elm(machine_, folder.rewards(seed, f"{method}.safetensors"))
    regularised = learned.machines["relm-irl"]
    if regularised.press_curve_ is not None:
        neurons = np.arange(1, len(regularised.press_curve_) + 1)
        curve = {"neurons": neurons, "mean_squared_error": regularised.press_curve_}
        write_table(folder.rewards(seed, "press.csv"), curve)
    _judge_rewards(scenes, split, learned, seed, folder)
    if maps and seed == 0:
        _save_reward_maps(scenes, split, learned, folder)


def load_basis(path: Path) -> RewardBasis:
    """Read φ as `keep_rewards` left it.

    Args:
        path: the file of demonstrated rewards.

    Returns:
        φ.

    Raises:
        InputError: the file cannot be read.
    """
    arrays = load_arrays(path)
    return RewardBasis(arrays["mean"], arrays["components"])


def _save_reward_maps(scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards, folder: RunFolder) -> None:
    """Save r(s) of every learned reward over one room of each type, for a trained and for a new target."""
    demonstrated = {record.target: record.solution.w for record in learned.records if record.trained}
    for room_type, number in first_of_each_type(scenes).items():
        scene = scenes[number]
        for name, targets in (("trained", split.training), ("new", split.new)):
            target = next(target for target in targets if target.scene == number)
            start = int(scene.shortest_path_distance[:, target.state].argmax())
            pair = pair_inputs(scene.encoded[[start]], scene.encoded[[target.state]])
            weights = {"irl": demonstrated[target]} if target in demonstrated else {}
            weights |= {method: machine_.predict(pair)[0] for method, machine_ in learned.machines.items()}
            phi = learned.basis(scene.encoded)
            saved = StateMap(
                poses=poses_of(scene),
                seed=0,
                target=target.state,
                category=target.category,
                values={method: reward(phi, target.state, w) for method, w in weights.items()},
                start=start,
                limits=(-1.0, 0.0),
            )
            save_map(folder.reward_map(name, room_type), saved)


def _judge_rewards(
    scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards, seed: int, folder: RunFolder
) -> None:
    """Write rank and order of every method's reward, on trained and on new targets."""
    judged: dict[tuple[Method, TargetGroup], list[RewardQuality]] = {
        ("irl", "trained"): [
            judge(scenes[record.target.scene], record.target.state, learned.basis, record.solution.w)
            for record in learned.records
            if record.trained
        ]
    }
    groups: dict[TargetGroup, Sequence[Target]] = {
        "trained": split.training,
        "new": split.new,
        "uniform": split.uniform,
    }
    for method, machine_ in learned.machines.items():
        for name, targets in groups.items():
            generator = np.random.default_rng([seed, 3])
            predict = lambda first, wanted, m=machine_: m.predict(pair_inputs(first, wanted))  # noqa: E731
            judged[method, name] = judge_predictions(scenes, targets, learned.basis, predict, generator)
    rows = [
        RewardQualityRow(
            method=method,
            targets=name,
            median_rank=float(np.median([j.rank for j in judgements])),
            median_rank_share=round(float(np.median([j.rank / j.states for j in judgements])), 4),
            mean_order=round(float(np.nanmean([j.order for j in judgements])), 4),
        )
        for (method, name), judgements in judged.items()
    ]
    save_reward_quality(folder.rewards(seed, "quality.csv"), rows)
