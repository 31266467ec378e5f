"""Learning curves of the mapping agent: how well it locates targets during training, which has no episodes."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from matplotlib.figure import Figure

from relm_irl_jax.files import read_numbers, read_table
from relm_irl_jax.report.figures import DrawnFigure, save_figure
from relm_irl_jax.report.run_figures import RunData

PANELS = {
    "targets located right": {"last_location_accuracy": "after whole walks", "location_accuracy": "all prefixes"},
    "loss in nats": {
        "last_location_loss": "target's pose, after whole walks",
        "location_loss": "target's pose, all prefixes",
        "free_loss": "free places",
    },
}
"""Columns of each panel with their labels."""

COLUMNS = ("frames", *(name for panel in PANELS.values() for name in panel))

Curve = Mapping[str, Float64[np.ndarray, "chunks"]]


def load_map_curve(path: Path) -> Curve | None:
    """Read the learning curve of a mapping agent.

    Args:
        path: the CSV file.

    Returns:
        Its columns; None if nothing was trained.

    Raises:
        InputError: the file is missing or damaged.
    """
    return read_numbers(path, COLUMNS) if read_table(path) else None


def map_curve_figure(curves: Mapping[int, Curve]) -> Figure:
    """Draw one line for each column and seed.

    Args:
        curves: the curve of each seed.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(4.6 * len(PANELS), 3.2), layout="constrained")
    for panel, (label, columns) in zip(figure.subplots(1, len(PANELS)), PANELS.items(), strict=True):
        for number, (name, title) in enumerate(columns.items()):
            for seed, curve in enumerate(curves.values()):
                named = title if seed == 0 else None
                panel.plot(curve["frames"], curve[name], color=f"C{number}", lw=1.2, label=named)
        panel.set(xlabel="views of walks", ylabel=label)
        panel.set_ylim(bottom=0)
        panel.legend(frameon=False, fontsize=8)
    return figure


def map_curve_figures(data: RunData) -> list[DrawnFigure]:
    """Draw the learning curves of a run's mapping agents.

    Args:
        data: the run.

    Returns:
        The figure; an empty list if no mapping agent was trained.
    """
    if data.agent != "map":
        return []

    def draw() -> list[DrawnFigure]:
        seeds = [seed for seed in data.seeds if data.folder.curve("rl", seed).exists()]
        read = {seed: data.read(load_map_curve, data.folder.curve("rl", seed)) for seed in seeds}
        curves = {seed: curve for seed, curve in read.items() if curve is not None}
        if not curves:
            return []
        path = data.folder.figure("learning-map")
        table = {"seed": np.concatenate([np.full(len(curve["frames"]), seed) for seed, curve in curves.items()])}
        table |= {name: np.concatenate([curve[name] for curve in curves.values()]) for name in COLUMNS}
        save_figure(map_curve_figure(curves), path, table)
        caption = (
            "Training of the mapping agent: share of targets whose pose is the most probable one, and losses, of the "
            "walks of each chunk of updates" + (", one line for each seed" if len(curves) > 1 else "")
        )
        return [DrawnFigure(path, "Learning curves of the mapping agent", caption)]

    return data.drawn("learning-map", draw)
