"""Maps of values over a room, seen from above: rewards, and distances to a target."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from relm_irl_jax.scenes.scene import GRID_STEP, HEADINGS, Scene


def map_table(scene: Scene, maps: Mapping[str, Float[np.ndarray, "states"]]) -> dict[str, np.ndarray]:
    """What maps of a scene show, as a table.

    Args:
        scene: the scene.
        maps: a value for every state, by title.

    Returns:
        Columns: place in metres, heading in degrees, and the values.
    """
    return {"x": scene.location[:, 0], "z": scene.location[:, 1], "rotation": scene.rotation, **maps}


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
