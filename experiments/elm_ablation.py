"""The paper's ablation of the ELM (Figures 7 to 10) on rewards learned in the built-in rooms.

    .venv/bin/python experiments/elm_ablation.py --out runs/elm-ablation

One target in six is held out with all its pairs, so that accuracy is measured on targets that the regressor never saw.
Everything drawn is kept as CSV beside the figure; bars are 95% intervals over seeds (Student's t).
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tyro
from matplotlib.figure import Figure
from relm_irl_jax.rewards.prediction import PairData, pair_data
from relm_irl_jax.stages.learning import learn_demonstrated
from rich.console import Console

from relm_irl_jax.config import Config, config_from_dict, config_to_dict
from relm_irl_jax.elm.ablation import (
    PAPER_SIZES,
    accuracy_by_choice,
    accuracy_by_size,
    before_and_after,
    leave_one_out_curve,
)
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import read_numbers, read_table, write_json, write_table
from relm_irl_jax.report.figures import load_press_curve, press_columns, press_figure, save_figure
from relm_irl_jax.report.intervals import mean_interval, mean_intervals
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.stages.encoding import encode_training
from relm_irl_jax.tasks import draw_split

DRAWN = 8000
"""Points of Figures 8 and 10, drawn at random from all weights of all test pairs."""


@dataclass(frozen=True)
class Ablation:
    """What to draw and where."""

    out: Path = Path("runs/elm-ablation")
    """Folder for figures and tables."""
    seeds: int = 3
    """Number of seeds of targets, demonstrations and hidden layers; those that the folder holds are not run again."""
    sizes: tuple[int, ...] = PAPER_SIZES
    """Numbers of neurons of Figure 7."""
    config: Config = field(default_factory=Config)
    """Scenes, demonstrations, inverse reinforcement learning, and the regressor."""


def held_out_pairs(config: Config, scenes: Sequence[Scene], seed: int) -> tuple[PairData, PairData]:
    """Learn rewards and split their pairs by target.

    Args:
        config: demonstrations, inverse reinforcement learning, and the most pairs.
        scenes: encoded training scenes.
        seed: the run's seed.

    Returns:
        Pairs to fit on, and pairs of other targets to test on.
    """
    split = draw_split(scenes, (), config.tasks, seed)
    _, records = learn_demonstrated(config, scenes, split, seed)
    generator = np.random.default_rng([seed, 4])
    test = set(generator.permutation(len(records))[: len(records) // 6].tolist())
    groups = [[r for i, r in enumerate(records) if (i in test) == wanted] for wanted in (False, True)]
    fitted, tested = (pair_data(scenes, group, config.elm.pairs, generator) for group in groups)
    return fitted, tested


def compare_choices(settings: Ablation, fitted: PairData, tested: PairData, seed: int, folder: Path) -> None:
    """Keep what several ways to choose neurons and penalty are worth for one seed.

    Args:
        settings: the ablation.
        fitted: pairs to fit on.
        tested: pairs of other targets.
        seed: the seed.
        folder: folder for the table.
    """
    elm = settings.config.elm
    parameters = {"n_hidden": elm.hidden, "activation": elm.activation, "norm": elm.norm, "random_state": seed}
    data = (fitted.inputs, fitted.weights, tested.inputs, tested.weights, fitted.target)
    choices = accuracy_by_choice(*data, **parameters)
    columns = {
        field: [getattr(choice, field) for choice in choices.values()] for field in ("accuracy", "kept", "ridge")
    }
    write_table(folder / "choices.csv", {"choice": list(choices), **columns})


def measure(settings: Ablation, fitted: PairData, tested: PairData, seed: int, folder: Path) -> None:
    """Fit the regressors of one seed and keep what the figures show.

    Args:
        settings: the ablation.
        fitted: pairs to fit on.
        tested: pairs of other targets.
        seed: the seed.
        folder: folder for the tables; the last one written says that all are there.
    """
    data = (fitted.inputs, fitted.weights, tested.inputs, tested.weights)
    elm = settings.config.elm
    hidden = elm.hidden
    predictions, model = before_and_after(
        *data, n_hidden=hidden, activation=elm.activation, norm=elm.norm, random_state=seed
    )
    curve = leave_one_out_curve(model)
    sizes = accuracy_by_size(*data, sizes=settings.sizes, activation=elm.activation, random_state=seed)
    write_table(folder / "sizes.csv", {"neurons": sizes.sizes, "test_r2": sizes.test, "train_r2": sizes.train})
    drawn = np.random.default_rng(seed).permutation(predictions.truth.size)[:DRAWN]
    points = {"truth": predictions.truth, "elm": predictions.plain, "relm": predictions.regularised}
    write_table(folder / "points.csv", {name: values.ravel()[drawn] for name, values in points.items()})
    write_table(folder / "press.csv", {"mean_squared_error": curve.error})
    accuracy = {"fitted": [len(fitted.inputs)], "tested": [len(tested.inputs)], "elm_r2": [predictions.plain_accuracy]}
    accuracy |= {"relm_r2": [predictions.regularised_accuracy], "kept": [predictions.kept]}
    write_table(folder / "accuracy.csv", accuracy)


JOBS = {measure: "accuracy.csv", compare_choices: "choices.csv"}
"""What is measured for every seed, and the table that says that it was."""


def numbers(folders: Sequence[Path], table: str, column: str) -> np.ndarray:
    """One column of a table of every seed, one row a seed."""
    return np.stack([read_numbers(folder / table, [column])[column] for folder in folders])


def draw_sizes(folders: Sequence[Path], path: Path) -> None:
    """Figure 7: accuracy against hidden neurons."""
    sizes = numbers(folders[:1], "sizes.csv", "neurons")[0]
    figure = Figure(figsize=(5.6, 3.6), layout="constrained")
    axes = figure.subplots()
    table = {"neurons": sizes}
    for column, label in (("test_r2", "held-out targets"), ("train_r2", "fitted pairs")):
        mean, error = mean_intervals(numbers(folders, "sizes.csv", column))
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
    points = {name: numbers(folders[:1], "points.csv", name)[0] for name in ("truth", "elm", "relm")}
    figure = Figure(figsize=(7.4, 3.8), layout="constrained")
    kept = mean_interval(numbers(folders, "accuracy.csv", "kept")[:, 0].tolist())
    for axes, name, title in zip(
        figure.subplots(1, 2, sharex=True, sharey=True),
        ("elm", "relm"),
        ("ELM (Figure 8)", f"RELM, {kept:,.0f} neurons (Figure 10)"),
        strict=True,
    ):
        accuracy = mean_interval(numbers(folders, "accuracy.csv", f"{name}_r2")[:, 0].tolist())
        limit = 1.05 * np.abs(points["truth"]).max()
        axes.plot([-limit, limit], [-limit, limit], color="#bbbbbb", lw=1)
        axes.scatter(points["truth"], points[name], s=2, alpha=0.3, rasterized=True)
        axes.set(title=f"{title}\nR² {accuracy}", xlabel="true weight", xlim=(-limit, limit), ylim=(-limit, limit))
        axes.title.set_fontsize(10)
    figure.axes[0].set_ylabel("predicted weight")
    save_figure(figure, path, points)


def choice_columns(folders: Sequence[Path]) -> dict[str, list]:
    """Means and 95% intervals over seeds of what every way to choose neurons is worth."""
    columns: dict[str, list] = {"choice": read_table(folders[0] / "choices.csv")["choice"]}
    for name in ("accuracy", "kept", "ridge"):
        mean, half_width = mean_intervals(numbers(folders, "choices.csv", name))
        columns |= {name: mean.tolist(), f"{name}_half_width": half_width.tolist()}
    return columns


def _with_defaults(kept: dict) -> dict:
    """Settings as they were kept, with fields that were added since at their defaults."""
    return {**kept, "config": config_to_dict(config_from_dict(kept["config"], "settings.json"))}


def main(settings: Ablation) -> None:
    """Draw Figures 7 to 10.

    Args:
        settings: what and where.

    Raises:
        InputError: the folder holds another ablation.
    """
    out, console = settings.out, Console()
    asked = {"sizes": list(settings.sizes), "config": config_to_dict(settings.config)}
    kept = out / "settings.json"
    if kept.exists() and _with_defaults(json.loads(kept.read_text())) != asked:
        raise InputError(f"out: {out} holds an ablation with other settings; give another folder, or remove it.")
    write_json(kept, asked)
    folders = [out / f"seed-{seed}" for seed in range(settings.seeds)]
    missing = {
        seed: [job for job, table in JOBS.items() if not (folder / table).exists()]
        for seed, folder in enumerate(folders)
    }
    if any(missing.values()):
        scenes = encode_training(settings.config).scenes
    for seed, jobs in missing.items():
        if jobs:
            console.print(f"seed {seed}: rewards, then regressors of {len(settings.sizes)} sizes")
            pairs = held_out_pairs(settings.config, scenes, seed)
            for job in jobs:
                job(settings, *pairs, seed, folders[seed])
    draw_sizes(folders, out / "figure-7.png")
    draw_predictions(folders, out / "figure-8-10.png")
    curves = [load_press_curve(folder / "press.csv") for folder in folders]
    save_figure(press_figure(curves), out / "figure-9.png", press_columns(curves))
    accuracy = {name: numbers(folders, "accuracy.csv", name)[:, 0] for name in ("elm_r2", "relm_r2", "kept")}
    write_table(out / "accuracy.csv", {"seed": range(settings.seeds), **accuracy})
    write_table(out / "choices.csv", choice_columns(folders))
    means = {name: mean_interval(values.tolist()) for name, values in accuracy.items()}
    console.print(
        f"R² on held-out targets: {means['elm_r2']} with all {settings.config.elm.hidden} neurons, "
        f"{means['relm_r2']} with the {means['kept']:,.0f} kept.",
        highlight=False,
    )
    console.print(f"Figures and tables: {out}", highlight=False)


if __name__ == "__main__":
    main(tyro.cli(Ablation, description=__doc__))
