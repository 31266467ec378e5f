"""Second stage: rewards learned from demonstrations, and the machines that predict them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relm_irl_jax.config import Config, Method
from relm_irl_jax.elm import ELMRegressor, save_elm
from relm_irl_jax.irl import reward
from relm_irl_jax.report.figures import save_figure
from relm_irl_jax.report.maps import map_table, reward_maps
from relm_irl_jax.report.tables import METHOD_NAMES
from relm_irl_jax.rewards.demonstrations import DemonstratedReward, RewardBasis, fit_basis, learn_rewards
from relm_irl_jax.rewards.prediction import fit_machine, pair_data, pair_inputs
from relm_irl_jax.rewards.quality import judge, judge_predictions
from relm_irl_jax.runs import RunFolder, load_arrays, save_arrays, write_table
from relm_irl_jax.scenes.scene import Scene, first_of_each_type
from relm_irl_jax.tasks import TaskSplit

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
        maps: whether to draw rewards over rooms, for the first seed.
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
        _map_rewards(scenes, split, learned, folder)


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


def _map_rewards(scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards, folder: RunFolder) -> None:
    """Map r(s) of every learned reward over one room of each type, for a trained and for a new target."""
    demonstrated = {record.target: record.solution.w for record in learned.records if record.trained}
    for room_type, number in first_of_each_type(scenes).items():
        scene = scenes[number]
        for name, targets in (("trained", split.training), ("new", split.new)):
            target = next(target for target in targets if target.scene == number)
            start = int(scene.shortest_path_distance[:, target.state].argmax())
            pair = pair_inputs(scene.encoded[[start]], scene.encoded[[target.state]])
            weights = {"IRL": demonstrated[target]} if target in demonstrated else {}
            weights |= {METHOD_NAMES[m]: machine_.predict(pair)[0] for m, machine_ in learned.machines.items()}
            phi = learned.basis(scene.encoded)
            values = {title: reward(phi, target.state, w) for title, w in weights.items()}
            path = folder.file("figures", f"reward-{name}-{room_type}.png")
            save_figure(reward_maps(scene, target.state, start, values), path, map_table(scene, values))


def _judge_rewards(
    scenes: Sequence[Scene], split: TaskSplit, learned: LearnedRewards, seed: int, folder: RunFolder
) -> None:
    """Write rank and order of every method's reward, on trained and on new targets."""
    judged = {
        ("irl", "trained"): [
            judge(scenes[record.target.scene], record.target.state, learned.basis, record.solution.w)
            for record in learned.records
            if record.trained
        ]
    }
    groups = {"trained": split.training, "new": split.new, "uniform": split.uniform}
    for method, machine_ in learned.machines.items():
        for name, targets in groups.items():
            generator = np.random.default_rng([seed, 3])
            predict = lambda first, wanted, m=machine_: m.predict(pair_inputs(first, wanted))  # noqa: E731
            judged[method, name] = judge_predictions(scenes, targets, learned.basis, predict, generator)
    table = {"method": [], "targets": [], "median_rank": [], "median_rank_share": [], "mean_order": []}
    for (method, name), judgements in judged.items():
        table["method"].append(method)
        table["targets"].append(name)
        table["median_rank"].append(np.median([j.rank for j in judgements]))
        table["median_rank_share"].append(round(np.median([j.rank / j.states for j in judgements]), 4))
        table["mean_order"].append(round(float(np.nanmean([j.order for j in judgements])), 4))
    write_table(folder.rewards(seed, "quality.csv"), table)
