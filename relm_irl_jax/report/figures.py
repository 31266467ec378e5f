"""Figures of a run (bars of a metric, the PRESS curve), and saving of figures with their data."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64
from matplotlib.figure import Figure
from matplotlib.text import Text

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import read_numbers, write_bytes, write_table
from relm_irl_jax.report.intervals import MeanInterval, mean_interval
from relm_irl_jax.report.names import method_name

FIGURE_DPI = 150
"""Resolution of the PNG files, in dots per inch."""

COLOURS = {
    "random": "#7f7f7f",
    "bc": "#2ca02c",
    "rl": "#222222",
    "constant": "#17a2a2",
    "irl": "#1f6fd6",
    "elm-irl": "#e08a1e",
    "relm-irl": "#d62728",
}
"""Colour of each method; black, blue and red as in the paper's Figure 6."""

OTHER_COLOUR = "#8c3fc0"
"""Colour of all other methods."""


@dataclass(frozen=True)
class DrawnFigure:
    """A figure of the report.

    Attributes:
        path: the PNG file.
        title: short title, which serves as alternative text.
        caption: caption with method, scene and target.
    """

    path: Path
    title: str
    caption: str


def method_colour(method: str) -> str:
    """The colour of a method."""
    return COLOURS.get(method, OTHER_COLOUR)


def save_figure(figure: Figure, path: Path, table: Mapping[str, Any]) -> None:
    """Write a figure as PNG, and its data as CSV in the same folder.

    Args:
        figure: the figure.
        path: the PNG file; the CSV file has the same name with another suffix.
        table: the data of the figure, as named columns of equal length.
    """
    png = as_png(figure)
    write_table(path.with_suffix(".csv"), table)
    write_bytes(path, png)


def as_png(figure: Figure) -> bytes:
    """Draw a figure as PNG.

    Args:
        figure: the figure.

    Returns:
        The content of the file.
    """
    # Names are text: a dollar sign in one begins no formula. Labels of logarithmic axes are made later.
    for text in figure.findobj(Text):
        if isinstance(text, Text) and "$" in text.get_text():
            text.set_parse_math(False)
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=FIGURE_DPI, format="png")
    return buffer.getvalue()


def bar_figure(bars: Mapping[str, Sequence[MeanInterval]], columns: Sequence[str], label: str) -> Figure:
    """Bars with error bars for each method, in one group for each room type (the paper's Figure 11).

    Args:
        bars: for each method, one value for each group.
        columns: names of the groups.
        label: label of the vertical axis.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(5.6, 3.4), layout="constrained")
    panel = figure.subplots()
    width = 0.8 / len(bars)
    for number, (method, values) in enumerate(bars.items()):
        position = np.arange(len(columns)) + (number - (len(bars) - 1) / 2) * width
        means = [value.mean for value in values]
        error = [value.half_width for value in values]
        name = method_name(method)
        panel.bar(position, means, 0.92 * width, yerr=error, capsize=3, color=method_colour(method), label=name)
    panel.set_xticks(np.arange(len(columns)), columns, parse_math=False)
    panel.set(ylabel=label, ylim=(0, None))
    figure.legend(loc="outside upper center", ncols=len(bars), frameon=False)
    return figure


def load_press_curve(path: Path) -> Float64[np.ndarray, "neurons"]:
    """Read a PRESS curve.

    Args:
        path: the CSV file.

    Returns:
        Mean squared leave-one-out error of each prefix of the ordered neurons; not finite if it is undefined.

    Raises:
        InputError: the file is missing or damaged, or no error is finite.
    """
    error = read_numbers(path, ["mean_squared_error"])["mean_squared_error"]
    if not np.isfinite(error).any():
        raise InputError(
            f"{path}: column `mean_squared_error` contains no finite number; restore the file, or remove it."
        )
    return error


def press_figure(curves: Sequence[Float64[np.ndarray, "_"]]) -> Figure:
    """Leave-one-out error against the number of neurons, with its minimum marked (the paper's Figure 9).

    Args:
        curves: mean squared leave-one-out error of each prefix of the ordered neurons, one curve for each seed.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(6, 3.6), layout="constrained")
    panel = figure.subplots()
    for curve in curves:
        best, neurons = press_minimum(curve), np.arange(1, len(curve) + 1)
        panel.plot(neurons, curve, color=method_colour("relm-irl"), lw=1.3, alpha=max(0.4, 1 / len(curves)))
        panel.plot(best, curve[best - 1], "o", color="black", markersize=4)
    kept = mean_interval([float(press_minimum(curve)) for curve in curves])
    panel.set_title(f"{kept:.0f} neurons kept", fontsize=10)
    finite = np.concatenate([curve[np.isfinite(curve)] for curve in curves])
    panel.set(xlabel="neurons in MRSR order", ylabel="mean squared leave-one-out error", xlim=(0, None), yscale="log")
    panel.set_ylim(finite.min() * 0.9, min(finite.max(), finite.min() * 100) * 1.1)
    panel.grid(alpha=0.25)
    return figure


def press_minimum(curve: Float64[np.ndarray, "neurons"]) -> int:
    """Number of neurons with the smallest leave-one-out error.

    Args:
        curve: the errors, at least one of them finite.

    Returns:
        The number.
    """
    return int(np.argmin(np.where(np.isfinite(curve), curve, np.inf))) + 1


def press_columns(curves: Sequence[Float64[np.ndarray, "_"]]) -> dict[str, np.ndarray]:
    """The data of `press_figure`, as a table.

    Args:
        curves: one curve for each seed.

    Returns:
        Columns: seed, number of neurons, error, and whether the error is the minimum of the seed.
    """
    count = [np.arange(1, len(curve) + 1) for curve in curves]
    return {
        "seed": np.repeat(np.arange(len(curves)), [len(curve) for curve in curves]),
        "neurons": np.concatenate(count),
        "mean_squared_error": np.concatenate(curves),
        "minimum": np.concatenate([n == press_minimum(c) for n, c in zip(count, curves, strict=True)]),
    }
