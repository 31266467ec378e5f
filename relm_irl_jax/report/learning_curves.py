"""Learning curves over seeds: confidence bands, and the number of training frames until an agent succeeds.

A row of a curve covers the episodes that ended in one chunk of updates. Early rows cover mostly short episodes, since
episodes that reach the cap end later.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from matplotlib.figure import Figure

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import columns_of_rows, read_numbers
from relm_irl_jax.report.figures import method_colour
from relm_irl_jax.report.intervals import mean_interval, mean_intervals
from relm_irl_jax.report.names import as_text, method_name

WINDOW = 5
"""Number of chunks of the running mean."""

SUCCESS_LEVEL = 0.99
"""Success rate at which training counts as successful."""

CURVE_METRICS = {"path_length_error": "PLE in actions", "success_rate": "SR", "spl": "SPL"}
"""Columns of a learning curve that are drawn, with their labels."""


@dataclass(frozen=True)
class TrainingCurve:
    """Metrics during one training, one row for each chunk of updates; NaN for chunks in which no episode ended.

    Attributes:
        frames: training frames at the end of each chunk.
        episodes: number of episodes that ended in the chunk.
        success_rate: share of these episodes that ended at the target.
        path_length_error: mean path length minus shortest path of these episodes, in actions.
        spl: mean success weighted by path length of these episodes.
    """

    frames: Float64[np.ndarray, "chunks"]
    episodes: Float64[np.ndarray, "chunks"]
    success_rate: Float64[np.ndarray, "chunks"]
    path_length_error: Float64[np.ndarray, "chunks"]
    spl: Float64[np.ndarray, "chunks"]


@dataclass(frozen=True)
class ConfidenceBand:
    """A metric during training, over seeds.

    Attributes:
        frames: training frames at the end of each chunk.
        mean: mean over seeds of the running mean; NaN if no episode ended.
        half_width: half of its 95% interval (Student's t); NaN with one seed.
    """

    frames: Float64[np.ndarray, "chunks"]
    mean: Float64[np.ndarray, "chunks"]
    half_width: Float64[np.ndarray, "chunks"]


MethodCurves = Mapping[str, Mapping[int, TrainingCurve]]
"""The curve of each method and seed; all curves of a method have the same frames."""


def load_curve(path: Path) -> TrainingCurve:
    """Read a learning curve.

    Args:
        path: the CSV file.

    Returns:
        The curve.

    Raises:
        InputError: the file is missing or damaged.
    """
    columns = read_numbers(path, [field.name for field in fields(TrainingCurve)])
    if not np.isfinite(columns["frames"]).all():
        raise InputError(f"{path}: column `frames` is not finite; restore the file, or remove it.")
    return TrainingCurve(**columns)


def running_mean(curve: TrainingCurve, metric: str) -> Float64[np.ndarray, "chunks"]:
    """Mean of a metric over the episodes that ended in the last `WINDOW` chunks.

    Args:
        curve: the curve.
        metric: one of `CURVE_METRICS`.

    Returns:
        The running mean; NaN if no episode ended.
    """
    values = getattr(curve, metric)
    known = np.isfinite(values)
    episodes = np.where(known, curve.episodes, 0.0)
    window = np.ones(WINDOW)
    total = np.convolve(np.where(known, values, 0.0) * episodes, window)[: len(values)]
    count = np.convolve(episodes, window)[: len(values)]
    return np.divide(total, count, out=np.full(len(values), np.nan), where=count > 0)


def confidence_band(curves: Sequence[TrainingCurve], metric: str) -> ConfidenceBand:
    """Mean and interval of a metric over the curves of several seeds.

    Args:
        curves: one curve for each seed, all with the same frames.
        metric: one of `CURVE_METRICS`.

    Returns:
        The band; seeds without a running mean at a chunk do not count there.
    """
    mean, half_width = mean_intervals(np.stack([running_mean(curve, metric) for curve in curves]))
    return ConfidenceBand(curves[0].frames, mean, half_width)


def frames_to_success(curve: TrainingCurve) -> float:
    """Training frames from which on the running success rate is at least `SUCCESS_LEVEL`.

    The first frames do not count by themselves: of the episodes that end there, all are short and most succeed.

    Args:
        curve: the curve.

    Returns:
        Frames; NaN if it is below the level in the end, or if there are fewer chunks than a running mean takes.
    """
    if len(curve.frames) < WINDOW:
        return float("nan")
    below = np.flatnonzero(~(running_mean(curve, "success_rate") >= SUCCESS_LEVEL))
    first = below[-1] + 1 if len(below) else 0
    return float(curve.frames[first]) if first < len(curve.frames) else float("nan")


def learning_figure(curves: MethodCurves) -> Figure:
    """Path length error (the paper's Figure 6), success rate and SPL during training.

    Args:
        curves: the learning curves.

    Returns:
        The figure: means over seeds, with bands of 95% intervals if there are several seeds.
    """
    figure = Figure(figsize=(10.5, 3.6), layout="constrained")
    for panel, (metric, label) in zip(figure.subplots(1, len(CURVE_METRICS)), CURVE_METRICS.items(), strict=True):
        for method, by_seed in curves.items():
            band = confidence_band(list(by_seed.values()), metric)
            millions = band.frames / 1e6
            marker = "o" if len(millions) == 1 else None  # one chunk is no line
            panel.plot(
                millions, band.mean, marker=marker, color=method_colour(method), lw=1.3, label=method_name(method)
            )
            low, high = band.mean - band.half_width, band.mean + band.half_width
            panel.fill_between(millions, low, high, color=method_colour(method), alpha=0.18, lw=0)
        panel.set(xlabel="training frames in millions", ylabel=label, xlim=(0, None), ylim=(0, None))
        panel.grid(alpha=0.25)
    figure.axes[0].legend(frameon=False)
    return figure


def band_columns(curves: MethodCurves) -> dict[str, list]:
    """The data of `learning_figure`, one method after the other.

    Args:
        curves: the learning curves.

    Returns:
        Columns for `write_table`.
    """
    columns: dict[str, list] = {"method": [], "frames": []}
    for method, by_seed in curves.items():
        bands = {metric: confidence_band(list(by_seed.values()), metric) for metric in CURVE_METRICS}
        frames = next(iter(bands.values())).frames
        columns["method"] += [method] * len(frames)
        columns["frames"] += frames.tolist()
        for metric, band in bands.items():
            columns.setdefault(metric, []).extend(band.mean.tolist())
            columns.setdefault(f"{metric}_half_width", []).extend(band.half_width.tolist())
    return columns


def success_columns(curves: MethodCurves) -> dict[str, list]:
    """Frames to success of every method and seed.

    Args:
        curves: the learning curves.

    Returns:
        Columns for `write_table`; NaN if the level was not reached.
    """
    rows = [(m, seed, frames_to_success(curve)) for m, by_seed in curves.items() for seed, curve in by_seed.items()]
    return columns_of_rows(("method", "seed", "frames"), rows)


def success_table(curves: MethodCurves) -> str:
    """Frames to success as a table of the report. A mean is only given if all seeds succeed, to avoid selection.

    Args:
        curves: the learning curves.

    Returns:
        A Markdown table.
    """
    lines = [
        f"| Method | Thousands of frames until the success rate stays at {SUCCESS_LEVEL} | Seeds that reach it |",
        "|---|---:|---:|",
    ]
    for method, by_seed in curves.items():
        thousands = np.asarray([frames_to_success(curve) for curve in by_seed.values()]) / 1e3
        reached = int(np.isfinite(thousands).sum())
        shown = f"{mean_interval(thousands.tolist()):,.0f}" if reached == len(by_seed) else "–"
        lines.append(f"| {as_text(method_name(method))} | {shown} | {reached} of {len(by_seed)} |")
    return "\n".join(lines)
