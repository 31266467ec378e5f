"""Learning curves over seeds: confidence bands, and the training frames until an agent succeeds.

A row of a curve counts the episodes that ended in one chunk of updates. Early rows count mostly short episodes, since
those that run into the cap end later.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from matplotlib.figure import Figure

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import read_numbers
from relm_irl_jax.report.figures import method_colour
from relm_irl_jax.report.intervals import mean_interval, mean_intervals
from relm_irl_jax.report.names import method_name

WINDOW = 5
"""Chunks over which the running mean is taken."""

SUCCESS_LEVEL = 0.99
"""Success rate at which training counts as successful."""

METRICS = {"path_length_error": "PLE in actions", "success_rate": "SR", "spl": "SPL"}
"""Columns of a learning curve that are drawn, with their labels."""


@dataclass(frozen=True)
class TrainingCurve:
    """Metrics of the episodes that ended during one training, one row a chunk of updates.

    Attributes:
        frames: training frames at the end of each chunk.
        episodes: number of episodes that ended in it.
        success_rate: share of them that ended at the target; NaN where none ended, as below.
        path_length_error: mean of actions taken minus actions of a shortest path.
        spl: mean success weighted by path length.
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
        mean: mean over seeds of the running mean; NaN where no episode ended.
        half_width: half of its 95% interval (Student's t); NaN with one seed.
    """

    frames: Float64[np.ndarray, "chunks"]
    mean: Float64[np.ndarray, "chunks"]
    half_width: Float64[np.ndarray, "chunks"]


MethodCurves = Mapping[str, Mapping[int, TrainingCurve]]
"""The curve of each method and seed; those of a method have the same frames."""


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
        metric: one of `METRICS`.

    Returns:
        The running mean; NaN where no episode ended.
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
        curves: one a seed, all over the same frames.
        metric: one of `METRICS`.

    Returns:
        The band; seeds in which no episode ended near a chunk do not count there.
    """
    mean, half_width = mean_intervals(np.stack([running_mean(curve, metric) for curve in curves]))
    return ConfidenceBand(curves[0].frames, mean, half_width)


def frames_to_success(curve: TrainingCurve) -> float:
    """Training frames until the running success rate first reaches `SUCCESS_LEVEL`.

    Args:
        curve: the curve.

    Returns:
        Frames; NaN where it never does.
    """
    reached = np.flatnonzero(running_mean(curve, "success_rate") >= SUCCESS_LEVEL)
    return float(curve.frames[reached[0]]) if len(reached) else float("nan")


def learning_figure(curves: MethodCurves) -> Figure:
    """Path length error (the paper's Figure 6), success rate and SPL during training.

    Args:
        curves: the learning curves.

    Returns:
        The figure: means over seeds, and bands of 95% intervals where there are several.
    """
    figure = Figure(figsize=(10.5, 3.6), layout="constrained")
    for panel, (metric, label) in zip(figure.subplots(1, len(METRICS)), METRICS.items(), strict=True):
        for method, own in curves.items():
            band = confidence_band(list(own.values()), metric)
            millions = band.frames / 1e6
            panel.plot(millions, band.mean, color=method_colour(method), lw=1.3, label=method_name(method))
            low, high = band.mean - band.half_width, band.mean + band.half_width
            panel.fill_between(millions, low, high, color=method_colour(method), alpha=0.18, lw=0)
        panel.set(xlabel="training frames in millions", ylabel=label, xlim=(0, None), ylim=(0, None))
        panel.grid(alpha=0.25)
    figure.axes[0].legend(frameon=False)
    return figure


def band_columns(curves: MethodCurves) -> dict[str, list]:
    """What `learning_figure` shows, methods beneath each other.

    Args:
        curves: the learning curves.

    Returns:
        Columns for `write_table`.
    """
    columns: dict[str, list] = {"method": [], "frames": []}
    for method, own in curves.items():
        bands = {metric: confidence_band(list(own.values()), metric) for metric in METRICS}
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
        Columns for `write_table`; NaN where the level was not reached.
    """
    rows = [(m, seed, frames_to_success(curve)) for m, own in curves.items() for seed, curve in own.items()]
    return dict(zip(("method", "seed", "frames"), map(list, zip(*rows, strict=True)), strict=True))


def success_table(curves: MethodCurves) -> str:
    """Frames to success for the report. A mean is given only where every seed succeeds, so that none is picked.

    Args:
        curves: the learning curves.

    Returns:
        A Markdown table.
    """
    lines = [
        f"| Method | Thousands of frames until a success rate of {SUCCESS_LEVEL} | Seeds that reach it |",
        "|---|---:|---:|",
    ]
    for method, own in curves.items():
        thousands = np.asarray([frames_to_success(curve) for curve in own.values()]) / 1e3
        reached = int(np.isfinite(thousands).sum())
        shown = f"{mean_interval(thousands.tolist()):,.0f}" if reached == len(own) else "–"
        lines.append(f"| {method_name(method)} | {shown} | {reached} of {len(own)} |")
    return "\n".join(lines)
