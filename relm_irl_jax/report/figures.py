"""Figures of a run: learning curves, bars of a metric, the PRESS curve; each is saved with its table."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from relm_irl_jax.files import write_bytes
from relm_irl_jax.report.curves import Curve, band
from relm_irl_jax.report.tables import METHOD_NAMES, Cell, summarise
from relm_irl_jax.runs import write_table

FIGURE_DPI = 150
"""Dots an inch of the PNG files."""

COLOURS = {
    "random": "#7f7f7f",
    "bc": "#2ca02c",
    "rl": "#222222",
    "irl": "#1f6fd6",
    "elm-irl": "#e08a1e",
    "relm-irl": "#d62728",
}
"""One colour a method; black, blue and red as in the paper's Figure 6."""


def save_figure(figure: Figure, path: Path, table: Mapping[str, Sequence | np.ndarray]) -> None:
    """Write a figure as PNG, and what it shows as CSV beside it.

    Args:
        figure: the figure.
        path: the PNG file; the table's name differs in its ending alone.
        table: the values drawn, as named columns of equal length.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=FIGURE_DPI, format="png")
    write_table(path.with_suffix(".csv"), table)
    write_bytes(path, buffer.getvalue())


CURVE_METRICS = {"path_length_error": "PLE in actions", "success_rate": "SR", "spl": "SPL"}
"""Columns of a learning curve that are drawn, with their labels."""


def learning_curves(curves: Mapping[str, Sequence[Curve]], metrics: Sequence[str] = tuple(CURVE_METRICS)) -> Figure:
    """Path length error, success rate and SPL during training (the paper's Figure 6 shows the first).

    Args:
        curves: for each method, the learning curve of each seed, as columns of text.
        metrics: columns to draw, one panel each.

    Returns:
        The figure: means over seeds, and bands of 95% intervals where there are several.
    """
    figure = Figure(figsize=(0.6 + 3.5 * len(metrics), 3.6), layout="constrained")
    panels = figure.subplots(1, len(metrics), squeeze=False)[0]
    for panel, metric in zip(panels, metrics, strict=True):
        for method, seeds in curves.items():
            drawn = band(seeds, metric)
            frames = drawn.frames / 1e6
            panel.plot(frames, drawn.mean, color=COLOURS[method], lw=1.3, label=METHOD_NAMES[method])
            low, high = drawn.mean - drawn.half_width, drawn.mean + drawn.half_width
            panel.fill_between(frames, low, high, color=COLOURS[method], alpha=0.18, lw=0)
        panel.set(xlabel="training frames in millions", ylabel=CURVE_METRICS[metric], xlim=(0, None), ylim=(0, None))
        panel.grid(alpha=0.25)
    panels[0].legend(frameon=False)
    if len(metrics) > 1:
        figure.suptitle("Episodes that ended during training, on the training targets", fontsize=10)
    return figure


def bar_figure(cells: Mapping[str, Sequence[Cell]], columns: Sequence[str], label: str) -> Figure:
    """Methods side by side with error bars, one group a room type (the paper's Figure 11).

    Args:
        cells: for each method, one cell a column.
        columns: what the groups are called.
        label: name of the vertical axis.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(5.6, 3.4), layout="constrained")
    panel = figure.subplots()
    width = 0.8 / len(cells)
    for number, (method, own) in enumerate(cells.items()):
        place = np.arange(len(columns)) + (number - (len(cells) - 1) / 2) * width
        error = [0.0 if np.isnan(cell.half_width) else cell.half_width for cell in own]
        means = [cell.mean for cell in own]
        panel.bar(place, means, 0.92 * width, yerr=error, capsize=3, color=COLOURS[method], label=METHOD_NAMES[method])
    panel.set_xticks(np.arange(len(columns)), columns)
    panel.set(ylabel=label, ylim=(0, None))
    panel.legend(frameon=False)
    return figure


def press_figure(curves: Sequence[Float[np.ndarray, "neurons"]]) -> Figure:
    """Leave-one-out error against the number of neurons, its minimum marked (the paper's Figure 9).

    Args:
        curves: mean squared leave-one-out error of each prefix of the ordered neurons, one curve a seed.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(6, 3.6), layout="constrained")
    panel = figure.subplots()
    chosen = [press_minimum(curve) for curve in curves]
    for curve, best in zip(curves, chosen, strict=True):
        panel.plot(
            np.arange(1, len(curve) + 1), curve, color=COLOURS["relm-irl"], lw=1.3, alpha=max(0.4, 1 / len(curves))
        )
        panel.plot(best, curve[best - 1], "o", color="black", markersize=4)
    kept = summarise([float(best) for best in chosen])
    panel.set_title(f"{kept.mean:.0f}{'' if np.isnan(kept.half_width) else f' ± {kept.half_width:.0f}'} neurons kept")
    panel.title.set_fontsize(10)
    finite = np.concatenate([curve[np.isfinite(curve)] for curve in curves])
    panel.set(xlabel="neurons in MRSR order", ylabel="mean squared leave-one-out error", xlim=(0, None), yscale="log")
    panel.set_ylim(finite.min() * 0.9, min(finite.max(), finite.min() * 100) * 1.1)
    panel.grid(alpha=0.25)
    return figure


def press_minimum(curve: Float[np.ndarray, "neurons"]) -> int:
    """Number of neurons with the least leave-one-out error."""
    return int(np.nanargmin(curve)) + 1


def press_columns(curves: Sequence[Float[np.ndarray, "neurons"]]) -> dict[str, np.ndarray]:
    """What `press_figure` shows, as a table.

    Args:
        curves: one a seed.

    Returns:
        Columns: seed, number of neurons, error, and whether it is the seed's least.
    """
    count = [np.arange(1, len(curve) + 1) for curve in curves]
    return {
        "seed": np.repeat(np.arange(len(curves)), [len(curve) for curve in curves]),
        "neurons": np.concatenate(count),
        "mean_squared_error": np.concatenate(curves),
        "minimum": np.concatenate([n == press_minimum(c) for n, c in zip(count, curves, strict=True)]),
    }
