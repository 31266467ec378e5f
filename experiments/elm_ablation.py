"""The paper's ablation of the ELM (Figures 7 to 10) on rewards learned in the built-in rooms.

    .venv/bin/python experiments/elm_ablation.py --out runs/elm-ablation

One target in six is held out with all its pairs, so that accuracy is measured on targets that the ELM was not fitted
on. It is also measured on pairs of unseen scenes, those of Task III, whose true weights are learned with the same φ
from demonstrations that nothing else uses. Every figure lies beside a CSV file of what it shows; bars are 95% intervals
over seeds (Student's t).
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from matplotlib.figure import Figure
from rich.console import Console

from relm_irl_jax.config import Config
from relm_irl_jax.elm.ablation import (
    PAPER_SIZES,
    Pairs,
    accuracy_by_selection,
    accuracy_by_size,
    compare_regularisation,
)
from relm_irl_jax.exits import errors_as_sentences
from relm_irl_jax.files import read_numbers, read_table, write_table
from relm_irl_jax.report.figures import load_press_curve, press_columns, press_figure, save_figure
from relm_irl_jax.report.intervals import mean_interval, mean_intervals
from relm_irl_jax.rewards.demonstrated import DemonstratedReward, learn_demonstrated_rewards
from relm_irl_jax.rewards.learned import learn_demonstrated
from relm_irl_jax.rewards.predicted import pair_data
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.encoding import encode_training, encode_unseen
from relm_irl_jax.studies.settings_file import check_settings
from relm_irl_jax.studies.study import PREDICTION_FIELDS
from relm_irl_jax.tasks import TaskSplit, draw_split

POINTS = 8000
"""Points of Figures 8 and 10, drawn at random from all weights of all test pairs."""


@dataclass(frozen=True)
class Ablation:
    """What to measure and where to write it."""

    out: Path = Path("runs/elm-ablation")
    """Folder for figures and tables."""
    seeds: int = 3
    """Number of seeds of targets, demonstrations and hidden layers; those that the folder holds are not run again."""
    sizes: tuple[int, ...] = PAPER_SIZES
    """Numbers of neurons of Figure 7."""
    config: Config = field(default_factory=Config)
    """Scenes, demonstrations, inverse reinforcement learning, and the ELM."""


@dataclass(frozen=True)
class PairsOfSeed:
    """The pairs of one seed.

    Attributes:
        train: pairs to fit.
        test: pairs of other targets in the same scenes.
        unseen: pairs of other scenes.
    """

    train: Pairs
    test: Pairs
    unseen: Pairs


def learned_pairs(config: Config, scenes: Sequence[Scene], unseen: Sequence[Scene], seed: int) -> PairsOfSeed:
    """Learn rewards, and split their pairs by target.

    Args:
        config: demonstrations, inverse reinforcement learning, and the most pairs.
        scenes: encoded training scenes.
        unseen: encoded scenes of Task III.
        seed: the run's seed.

    Returns:
        The pairs.
    """
    split = draw_split(scenes, unseen, config.tasks, seed)
    learned = learn_demonstrated(scenes, split, config.irl, seed)
    generator = np.random.default_rng([seed, 4])
    rewards = learned.demonstrated
    held_out = set(generator.permutation(len(rewards))[: len(rewards) // 6].tolist())
    train, test = ([reward for i, reward in enumerate(rewards) if (i in held_out) == test] for test in (False, True))
    phi = [learned.basis.phi(scene) for scene in unseen]
    only_similar = TaskSplit(training=split.similar, new=(), uniform=(), similar=())
    elsewhere = learn_demonstrated_rewards(unseen, only_similar, phi, replace(config.irl, demonstrations=None), seed)

    def pairs_of(rewards: Sequence[DemonstratedReward], of_scenes: Sequence[Scene]) -> Pairs:
        data = pair_data(of_scenes, rewards, config.elm.pairs, generator)
        return Pairs(data.inputs, data.weights, data.target)

    return PairsOfSeed(pairs_of(train, scenes), pairs_of(test, scenes), pairs_of(elsewhere, unseen))


def regressor_parameters(settings: Ablation, seed: int) -> dict[str, Any]:
    """Parameters of the regressors of one seed, which all draw the same hidden layer.

    Args:
        settings: the ablation.
        seed: the seed.
    """
    elm = settings.config.elm
    return {"n_hidden": elm.hidden, "activation": elm.activation, "norm": elm.norm, "random_state": seed}


def measure_figures(settings: Ablation, pairs: PairsOfSeed, seed: int, folder: Path) -> None:
    """Fit the ELMs of one seed and write what Figures 7 to 10 show.

    Args:
        settings: the ablation.
        pairs: pairs to fit and to test on.
        seed: the seed.
        folder: folder for the tables; `accuracy.csv` is written last.
    """
    found = compare_regularisation(pairs.train, pairs.test, **regressor_parameters(settings, seed))
    activation = settings.config.elm.activation
    sizes = accuracy_by_size(pairs.train, pairs.test, settings.sizes, activation=activation, random_state=seed)
    write_table(folder / "sizes.csv", {"neurons": sizes.sizes, "test_r2": sizes.test_r2, "train_r2": sizes.train_r2})
    drawn = np.random.default_rng(seed).permutation(found.truth.size)[:POINTS]
    points = {"truth": found.truth, "elm": found.elm, "relm": found.relm}
    write_table(folder / "points.csv", {name: values.ravel()[drawn] for name, values in points.items()})
    write_table(folder / "press.csv", {"mean_squared_error": found.press_curve})
    accuracy = {
        "fitted": len(pairs.train.X),
        "tested": len(pairs.test.X),
        "elm_r2": found.elm_r2,
        "relm_r2": found.relm_r2,
    }
    write_table(folder / "accuracy.csv", {name: [value] for name, value in (accuracy | {"kept": found.kept}).items()})


def measure_selections(settings: Ablation, pairs: PairsOfSeed, seed: int, folder: Path) -> None:
    """Write the accuracy of several ways to select neurons and penalty, for one seed.

    Args:
        settings: the ablation.
        pairs: pairs to fit and to test on.
        seed: the seed.
        folder: folder for the table.
    """
    results = accuracy_by_selection(pairs.train, pairs.test, pairs.unseen, **regressor_parameters(settings, seed))
    rows = [{"choice": name, **asdict(result)} for name, result in results.items()]
    write_table(folder / "choices.csv", {name: [row[name] for row in rows] for name in rows[0]})


MEASUREMENTS: dict[str, Callable[[Ablation, PairsOfSeed, int, Path], None]] = {
    "accuracy.csv": measure_figures,
    "choices.csv": measure_selections,
}
"""What is measured for every seed, by the table whose presence says that it was."""


def read_column(folders: Sequence[Path], table: str, column: str) -> np.ndarray:
    """One column of a table of every seed, one row per seed."""
    return np.stack([read_numbers(folder / table, [column])[column] for folder in folders])


def draw_sizes(folders: Sequence[Path], path: Path) -> None:
    """Figure 7: accuracy against the number of hidden neurons."""
    sizes = read_column(folders[:1], "sizes.csv", "neurons")[0]
    figure = Figure(figsize=(5.6, 3.6), layout="constrained")
    axes = figure.subplots()
    table = {"neurons": sizes}
    for column, label in (("test_r2", "held-out targets"), ("train_r2", "fitted pairs")):
        mean, error = mean_intervals(read_column(folders, "sizes.csv", column))
        axes.errorbar(sizes, mean, np.nan_to_num(error), fmt="o-", ms=3.5, capsize=2, label=label)
        table |= {column: mean, f"{column}_half_width": error}
    axes.set_xscale("symlog", linthresh=100)
    axes.set(xlabel="hidden neurons", ylabel="R²", ylim=(max(-1.0, min(0.0, table["test_r2"].min())) - 0.05, 1.05))
    ticks = [tick for tick in (1, 50, 100, 400, 1950, 8000) if tick <= max(sizes)]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.grid(alpha=0.25)
    axes.legend(frameon=False)
    save_figure(figure, path, table)


def draw_predictions(folders: Sequence[Path], path: Path) -> None:
    """Figures 8 and 10: predicted against true weights of the first seed, with the R² of all seeds."""
    points = {name: read_column(folders[:1], "points.csv", name)[0] for name in ("truth", "elm", "relm")}
    figure = Figure(figsize=(7.4, 3.8), layout="constrained")
    kept = mean_interval(read_column(folders, "accuracy.csv", "kept")[:, 0].tolist())
    titles = {"elm": "ELM (Figure 8)", "relm": f"RELM, {kept:,.0f} neurons (Figure 10)"}
    for axes, (name, title) in zip(figure.subplots(1, 2, sharex=True, sharey=True), titles.items(), strict=True):
        accuracy = mean_interval(read_column(folders, "accuracy.csv", f"{name}_r2")[:, 0].tolist())
        limit = 1.05 * np.abs(points["truth"]).max()
        axes.plot([-limit, limit], [-limit, limit], color="#bbbbbb", lw=1)
        axes.scatter(points["truth"], points[name], s=2, alpha=0.3, rasterized=True)
        axes.set(title=f"{title}\nR² {accuracy}", xlabel="true weight", xlim=(-limit, limit), ylim=(-limit, limit))
        axes.title.set_fontsize(10)
    figure.axes[0].set_ylabel("predicted weight")
    save_figure(figure, path, points)


def summarise_selections(folders: Sequence[Path]) -> dict[str, list]:
    """Means and 95% intervals over seeds for each way to select neurons and penalty, as columns."""
    columns: dict[str, list] = {"choice": read_table(folders[0] / "choices.csv")["choice"]}
    for name in ("accuracy", "accuracy_in_unseen_scenes", "kept", "ridge"):
        mean, half_width = mean_intervals(read_column(folders, "choices.csv", name))
        columns |= {name: mean.tolist(), f"{name}_half_width": half_width.tolist()}
    return columns


def main(settings: Ablation) -> None:
    """Measure what is missing in the folder and draw Figures 7 to 10.

    Args:
        settings: what to measure and where to write it.

    Raises:
        InputError: the folder holds results with other settings.
    """
    out, console = settings.out, Console()
    check_settings(out, settings.config, PREDICTION_FIELDS, sizes=list(settings.sizes))
    folders = [out / f"seed-{seed}" for seed in range(settings.seeds)]
    missing = [[table for table in MEASUREMENTS if not (folder / table).exists()] for folder in folders]
    if any(missing):
        training = encode_training(settings.config)
        unseen = encode_unseen(settings.config, training)
        for seed, tables in enumerate(missing):
            if tables:
                console.print(f"seed {seed}: rewards, then ELMs of {len(settings.sizes)} sizes")
                pairs = learned_pairs(settings.config, training.scenes, unseen, seed)
                for table in tables:
                    MEASUREMENTS[table](settings, pairs, seed, folders[seed])
    draw_sizes(folders, out / "figure-7.png")
    draw_predictions(folders, out / "figure-8-10.png")
    curves = [load_press_curve(folder / "press.csv") for folder in folders]
    save_figure(press_figure(curves), out / "figure-9.png", press_columns(curves))
    accuracy = {name: read_column(folders, "accuracy.csv", name)[:, 0] for name in ("elm_r2", "relm_r2", "kept")}
    write_table(out / "accuracy.csv", {"seed": range(settings.seeds), **accuracy})
    write_table(out / "choices.csv", summarise_selections(folders))
    means = {name: mean_interval(values.tolist()) for name, values in accuracy.items()}
    console.print(
        f"R² on held-out targets: {means['elm_r2']} with all {settings.config.elm.hidden} neurons, "
        f"{means['relm_r2']} with the {means['kept']:,.0f} kept.",
        highlight=False,
    )
    console.print(f"Figures and tables: {out}", highlight=False)


if __name__ == "__main__":
    with errors_as_sentences("elm_ablation"):
        main(tyro.cli(Ablation, description=__doc__))
