"""Figures of a run: learning curves, the PRESS curve, and maps of rewards over a room."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from relm_irl_jax.files import write_bytes
from relm_irl_jax.report.tables import METHOD_NAMES
from relm_irl_jax.scenes.scene import GRID_STEP, HEADINGS, Scene

COLOURS = {
    "random": "#7f7f7f",
    "bc": "#2ca02c",
    "rl": "#222222",
    "irl": "#1f6fd6",
    "elm-irl": "#e08a1e",
    "relm-irl": "#d62728",
}
"""One colour a method; black, blue and red as in the paper's Figure 6."""


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG.

    Args:
        figure: the figure.
        path: the file.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=150, format="png")
    write_bytes(path, buffer.getvalue())


def learning_curves(curves: Mapping[str, Sequence[Mapping[str, Sequence[str]]]]) -> Figure:
    """Path length error, success rate and SPL during training (the paper's Figure 6 shows the first).

    Args:
        curves: for each method, the learning curve of each seed, as columns of text.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(11, 3.4), layout="constrained")
    panels = figure.subplots(1, 3)
    for panel, (key, label) in zip(
        panels, (("path_length_error", "PLE in actions"), ("success_rate", "SR"), ("spl", "SPL")), strict=True
    ):
        for method, seeds in curves.items():
            for number, columns in enumerate(seeds):
                frames = np.asarray(columns["frames"], float) / 1e6
                panel.plot(
                    frames,
                    _smoothed(np.asarray(columns[key], float)),
                    color=COLOURS[method],
                    lw=1.3,
                    label=METHOD_NAMES[method] if number == 0 else None,
                )
        panel.set(xlabel="training frames in millions", ylabel=label, xlim=(0, None), ylim=(0, None))
        panel.grid(alpha=0.25)
    panels[0].legend(frameon=False)
    figure.suptitle("Episodes that ended during training, on the training targets")
    return figure


def press_figure(curve: Float[np.ndarray, "neurons"], chosen: int) -> Figure:
    """Leave-one-out error against the number of neurons, its minimum marked (the paper's Figure 9).

    Args:
        curve: mean squared leave-one-out error of each prefix of the ordered neurons.
        chosen: number of neurons kept.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(6, 3.6), layout="constrained")
    panel = figure.subplots()
    panel.plot(np.arange(1, len(curve) + 1), curve, color=COLOURS["relm-irl"], lw=1.3)
    panel.plot(chosen, curve[chosen - 1], "o", color="black")
    panel.annotate(f"{chosen} neurons kept", (chosen, curve[chosen - 1]), xytext=(8, 14), textcoords="offset points")
    finite = curve[np.isfinite(curve)]
    panel.set(xlabel="neurons in MRSR order", ylabel="mean squared leave-one-out error", xlim=(0, None), yscale="log")
    panel.set_ylim(finite.min() * 0.9, min(finite.max(), finite.min() * 100) * 1.1)
    panel.grid(alpha=0.25)
    return figure


def reward_maps(
    scene: Scene,
    target: int,
    start: int,
    rewards: Mapping[str, Float[np.ndarray, "states"]],
    limits: tuple[float, float] = (-1.0, 0.0),
) -> Figure:
    """Maps of r(s) over a room, seen from above, one a method.

    Each place is a square of four triangles, one a heading. The star is the target and its arrow the heading at which
    it is reached; the ring is the start from which predicted rewards are predicted.

    Args:
        scene: the room.
        target: the target's state.
        start: the start's state.
        rewards: reward of every state, by title.
        limits: ends of the colour scale; predicted rewards may lie beyond them.

    Returns:
        The figure.
    """
    title = f"{scene.name}: reward for target state {target} (star), from a start (ring)"
    return _maps(scene, target, rewards, limits, "r(s)", title, start)


def distance_maps(scene: Scene, target: int, distances: Mapping[str, Float[np.ndarray, "states"]]) -> Figure:
    """Maps of the distance to a target over a room, seen from above, side by side on one scale.

    Args:
        scene: the room.
        target: the target's state.
        distances: distance of every state to the target, by title; infinite or negative where there is no way.

    Returns:
        The figure.
    """
    shown = {title: np.where(np.isfinite(d) & (d >= 0), d, np.nan) for title, d in distances.items()}
    limits = (0.0, float(max(np.nanmax(values) for values in shown.values())))
    return _maps(scene, target, shown, limits, "steps", f"{scene.name}: distance to target state {target} (star)")


def _maps(
    scene: Scene,
    target: int,
    maps: Mapping[str, Float[np.ndarray, "states"]],
    limits: tuple[float, float],
    unit: str,
    title: str,
    start: int | None = None,
) -> Figure:
    """One map for each entry, on one colour scale."""
    width = np.ptp(scene.location[:, 0]) + 2.2
    height = np.ptp(scene.location[:, 1]) + 2.2
    figure = Figure(figsize=(len(maps) * 4.6, 4.2 * height / width + 0.9), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(maps)))
    for panel, (name, values) in zip(panels, maps.items(), strict=True):
        collection = _triangles(panel, scene, values)
        collection.set_clim(*limits)
        place, heading = scene.location[target], np.deg2rad(scene.rotation[target])
        panel.plot(*place, "*", color="#d62728", markersize=13, markeredgecolor="white")
        if start is not None:
            panel.plot(*scene.location[start], "o", color="none", markersize=9, markeredgecolor="#d62728")
        tip = place + 0.75 * np.array([np.sin(heading), np.cos(heading)])
        panel.annotate("", tip, place, arrowprops={"arrowstyle": "->", "color": "#d62728", "lw": 1.8})
        panel.set(title=name, aspect="equal", xlabel="x in metres", ylabel="z in metres")
        figure.colorbar(collection, ax=panel, label=unit, shrink=0.8, extend="both")
    figure.suptitle(title)
    return figure


def _triangles(panel: Axes, scene: Scene, values: Float[np.ndarray, "states"]):
    """Draw one triangle a state: from the centre of its place to the edge that the heading faces."""
    half = GRID_STEP / 2
    corners = {
        HEADINGS[0]: [(-half, half), (half, half)],
        HEADINGS[1]: [(half, half), (half, -half)],
        HEADINGS[2]: [(half, -half), (-half, -half)],
        HEADINGS[3]: [(-half, -half), (-half, half)],
    }
    shapes = [
        [place, *(place + np.asarray(corner) for corner in corners[float(heading)])]
        for place, heading in zip(scene.location, scene.rotation, strict=True)
    ]
    collection = PolyCollection(shapes, array=values, cmap="viridis", edgecolors="none", antialiased=False)
    panel.add_collection(collection)
    panel.autoscale_view()
    return collection


def _smoothed(values: Float[np.ndarray, "chunks"], width: int = 5) -> Float[np.ndarray, "chunks"]:
    """Running mean that leaves out chunks in which no episode ended."""
    known = np.isfinite(values)
    window = np.ones(min(width, len(values)))
    count = np.convolve(known, window, "same")
    with np.errstate(invalid="ignore"):
        return np.convolve(np.where(known, values, 0.0), window, "same") / count
