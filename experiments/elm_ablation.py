"""The paper's ablation of the ELM (Figures 7 to 10) on rewards learned in the built-in rooms.

    .venv/bin/python experiments/elm_ablation.py --out runs/elm-ablation

One target in six is held out with all its pairs, so that accuracy is measured on targets that the machine never saw.
Everything drawn is kept as CSV beside the figure.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tyro
from matplotlib.figure import Figure
from rich.console import Console

from relm_irl_jax.config import Config
from relm_irl_jax.elm.ablation import (
    PAPER_SIZES,
    Predictions,
    SizeCurve,
    accuracy_by_size,
    before_and_after,
    leave_one_out_curve,
)
from relm_irl_jax.report.figures import press_figure, save_figure
from relm_irl_jax.rewards.demonstrations import fit_basis, learn_rewards
from relm_irl_jax.rewards.prediction import PairData, pair_data
from relm_irl_jax.runs import write_table
from relm_irl_jax.stages.encoding import encode_training
from relm_irl_jax.tasks import draw_split


@dataclass(frozen=True)
class Ablation:
    """What to draw and where."""

    out: Path = Path("runs/elm-ablation")
    """Folder for figures and tables."""
    seed: int = 0
    """Seed of targets, demonstrations and hidden layers."""
    hidden: int = 1950
    """Neurons before selection."""
    sizes: tuple[int, ...] = PAPER_SIZES
    """Numbers of neurons of Figure 7."""
    config: Config = field(default_factory=Config)
    """Scenes, demonstrations and inverse reinforcement learning."""


def held_out_pairs(config: Config, seed: int) -> tuple[PairData, PairData]:
    """Learn rewards and split their pairs by target.

    Args:
        config: scenes, demonstrations, inverse reinforcement learning, and the most pairs.
        seed: the run's seed.

    Returns:
        Pairs to fit on, and pairs of other targets to test on.
    """
    scenes = encode_training(config).scenes
    split = draw_split(scenes, (), config.tasks, seed)
    basis = fit_basis(scenes, config.irl.dimension)
    records = learn_rewards(scenes, split, basis, config.irl, seed)
    generator = np.random.default_rng([seed, 4])
    test = set(generator.permutation(len(records))[: len(records) // 6].tolist())
    groups = [[r for i, r in enumerate(records) if (i in test) == wanted] for wanted in (False, True)]
    fitted, tested = (pair_data(scenes, group, config.elm.pairs, generator) for group in groups)
    return fitted, tested


def size_figure(curve: SizeCurve) -> Figure:
    """Figure 7: accuracy against hidden neurons."""
    figure = Figure(figsize=(5.2, 3.4), layout="constrained")
    axes = figure.subplots()
    axes.plot(curve.sizes, curve.test, "o-", label="held-out targets")
    axes.plot(curve.sizes, curve.train, "o-", label="fitted pairs", alpha=0.5)
    axes.set(xlabel="hidden neurons", ylabel="R²", ylim=(min(0.0, max(-1.0, curve.test.min())) - 0.05, 1.05))
    axes.legend(frameon=False)
    return figure


def prediction_figure(predictions: Predictions) -> Figure:
    """Figures 8 and 10: predicted against true weights, before and after regularisation."""
    figure = Figure(figsize=(7.4, 3.6), layout="constrained")
    for axes, values, title in zip(
        figure.subplots(1, 2, sharex=True, sharey=True),
        (predictions.plain, predictions.regularised),
        (
            f"ELM, R² {predictions.plain_accuracy:.2f}",
            f"RELM, {predictions.kept} neurons, R² {predictions.regularised_accuracy:.2f}",
        ),
        strict=True,
    ):
        limit = 1.05 * np.abs(predictions.truth).max()
        axes.plot([-limit, limit], [-limit, limit], color="#bbbbbb", lw=1)
        axes.scatter(predictions.truth.ravel()[::7], values.ravel()[::7], s=2, alpha=0.3, rasterized=True)
        axes.set(title=title, xlabel="true weight", xlim=(-limit, limit), ylim=(-limit, limit))
    figure.axes[0].set_ylabel("predicted weight")
    return figure


def main(settings: Ablation) -> None:
    """Draw Figures 7 to 10.

    Args:
        settings: what and where.
    """
    console = Console()
    fitted, tested = held_out_pairs(settings.config, settings.seed)
    data = (fitted.inputs, fitted.weights, tested.inputs, tested.weights)
    console.print(f"{len(fitted.inputs)} pairs fitted, {len(tested.inputs)} pairs of other targets tested")
    predictions, model = before_and_after(*data, n_hidden=settings.hidden, random_state=settings.seed)
    curve = leave_one_out_curve(model)
    sizes = accuracy_by_size(*data, sizes=settings.sizes, random_state=settings.seed)
    out = settings.out
    write_table(out / "figure-7.csv", {"neurons": sizes.sizes, "test_r2": sizes.test, "train_r2": sizes.train})
    write_table(
        out / "figure-8-10.csv",
        {
            "truth": predictions.truth.ravel(),
            "elm": predictions.plain.ravel(),
            "relm": predictions.regularised.ravel(),
        },
    )
    write_table(
        out / "figure-9.csv", {"neurons": np.arange(1, len(curve.error) + 1), "mean_squared_error": curve.error}
    )
    save_figure(size_figure(sizes), out / "figure-7.png")
    save_figure(prediction_figure(predictions), out / "figure-8-10.png")
    save_figure(press_figure(curve.error, curve.best), out / "figure-9.png")
    best = int(np.argmax(sizes.test))
    console.print(
        f"R² on held-out targets: {predictions.plain_accuracy:.3f} with all {settings.hidden} neurons, "
        f"{predictions.regularised_accuracy:.3f} with the {predictions.kept} kept; without selection the best is "
        f"{sizes.test[best]:.3f}, at {sizes.sizes[best]} neurons."
    )
    console.print(f"Figures and tables: {out}", highlight=False)


if __name__ == "__main__":
    main(tyro.cli(Ablation, description=__doc__))
