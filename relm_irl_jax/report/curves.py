"""Learning curves over seeds: bands, and how long it took to succeed.

Rows of a curve count the episodes that ended in a chunk of updates. Early on these are mostly episodes that a short or
lucky way ended; those that run into the cap end later.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import t as student

from relm_irl_jax.report.tables import METHOD_NAMES, Cell, summarise

Curve = Mapping[str, Sequence[str]]
"""Columns of a learning curve, as text."""

WINDOW = 5
"""Chunks of a running mean."""

LEVEL = 0.99
"""Success rate that counts as learned."""


@dataclass(frozen=True)
class Band:
    """A metric during training, over seeds.

    Attributes:
        frames: training frames at the end of each chunk.
        mean: mean over seeds of the running mean; NaN where no episode ended.
        half_width: half of its 95% interval (Student's t); NaN with one seed.
    """

    frames: Float[np.ndarray, "chunks"]
    mean: Float[np.ndarray, "chunks"]
    half_width: Float[np.ndarray, "chunks"]


def band(curves: Sequence[Curve], metric: str) -> Band:
    """Mean and interval of a metric over the curves of several seeds.

    Args:
        curves: one a seed, all over the same frames.
        metric: name of a column.

    Returns:
        The band; seeds in which no episode ended near a chunk do not count there.
    """
    values = np.stack([running_mean(curve, metric) for curve in curves])
    known = np.isfinite(values).sum(0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.nansum(values, 0) / known
        spread = np.sqrt(np.nansum((values - mean) ** 2, 0) / (known - 1))
        half_width = np.where(known > 1, student.ppf(0.975, np.maximum(known - 1, 1)) * spread / np.sqrt(known), np.nan)
    return Band(np.asarray(curves[0]["frames"], float), mean, half_width)


def running_mean(curve: Curve, metric: str) -> Float[np.ndarray, "chunks"]:
    """Mean of a metric over the episodes that ended in the last `WINDOW` chunks.

    Args:
        curve: the curve.
        metric: name of a column.

    Returns:
        The running mean; NaN where no episode ended.
    """
    values, episodes = (np.asarray(curve[name], float) for name in (metric, "episodes"))
    window = np.ones(WINDOW)
    known = np.isfinite(values)
    total = np.convolve(np.where(known, values, 0.0) * np.where(known, episodes, 0.0), window)[: len(values)]
    count = np.convolve(np.where(known, episodes, 0.0), window)[: len(values)]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(count > 0, total / count, np.nan)


def frames_to_success(curve: Curve) -> float:
    """Training frames until the running success rate first reaches `LEVEL`.

    Args:
        curve: the curve.

    Returns:
        Frames; NaN where it never does.
    """
    reached = np.flatnonzero(running_mean(curve, "success_rate") >= LEVEL)
    return float(curve["frames"][reached[0]]) if len(reached) else float("nan")


def band_columns(curves: Mapping[str, Sequence[Curve]], metrics: Sequence[str]) -> dict[str, list]:
    """Bands as columns, methods beneath each other.

    Args:
        curves: the curves of each method's seeds.
        metrics: names of columns.

    Returns:
        Columns for `write_table`.
    """
    columns: dict[str, list] = {"method": [], "frames": []}
    for method, own in curves.items():
        for metric in metrics:
            drawn = band(own, metric)
            columns.setdefault(metric, []).extend(drawn.mean.tolist())
            columns.setdefault(f"{metric}_half_width", []).extend(drawn.half_width.tolist())
        columns["method"] += [method] * len(own[0]["frames"])
        columns["frames"] += list(own[0]["frames"])
    return columns


def speed_columns(curves: Mapping[str, Sequence[Curve]]) -> dict[str, list]:
    """Frames to success of every method and seed.

    Args:
        curves: the curves of each method's seeds, seed 0 first.

    Returns:
        Columns for `write_table`; NaN where the level was not reached.
    """
    rows = [(m, seed, frames_to_success(curve)) for m, own in curves.items() for seed, curve in enumerate(own)]
    return dict(zip(("method", "seed", "frames"), map(list, zip(*rows, strict=True)), strict=True))


def speed_table(curves: Mapping[str, Sequence[Curve]]) -> str:
    """Frames to success for the report. A mean is given only where every seed arrives, so that none is picked.

    Args:
        curves: the curves of each method's seeds.

    Returns:
        A Markdown table.
    """
    lines = [f"| Method | Frames in thousands to a success rate of {LEVEL} | Seeds that reach it |", "|---|---:|---:|"]
    for method, own in curves.items():
        frames = np.asarray([frames_to_success(curve) for curve in own]) / 1e3
        reached = int(np.isfinite(frames).sum())
        shown = thousands(summarise(frames.tolist())) if reached == len(own) else "–"
        lines.append(f"| {METHOD_NAMES[method]} | {shown} | {reached} of {len(own)} |")
    return "\n".join(lines)


def thousands(value: Cell) -> str:
    """A cell without decimals.

    Args:
        value: the cell.

    Returns:
        Text such as `410 ± 30`.
    """
    return f"{value:,.0f}"
