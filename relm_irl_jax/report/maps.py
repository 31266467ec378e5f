"""Maps of values over a room, seen from above: rewards, and distances to a target."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from relm_irl_jax.report.names import in_order, listed, method_name, target_name
from relm_irl_jax.saved_maps import SHORTEST_PATH, StateMap
from relm_irl_jax.saved_poses import ScenePoses
from relm_irl_jax.scenes.scene import GRID_STEP, HEADINGS

COLUMNS = 3
"""Largest number of maps in a row."""

PANEL_INCHES = 3.4
"""Width of one map in inches."""

TARGET_COLOUR = "#d62728"


@dataclass(frozen=True)
class ColourScale:
    """The colour scale that all maps of a figure share.

    Attributes:
        low: lower end.
        high: upper end.
        label: quantity and unit of the colours.
    """

    low: float
    high: float
    label: str


def reward_figure(saved: StateMap) -> Figure:
    """Maps of r(s) over a room, one for each method.

    Args:
        saved: rewards; values outside `limits` have the colours of the ends.

    Returns:
        The figure.
    """
    values = _finite(saved)
    known = _known(values)
    low, high = saved.limits or (min(known, default=0.0), max(known, default=1.0))
    return _figure(saved, values, ColourScale(low, high, "reward r(s)"))


def distance_figure(saved: StateMap) -> Figure:
    """Maps of the distance to a target over a room, the true distance first.

    Args:
        saved: distances in actions.

    Returns:
        The figure.
    """
    values = _finite(saved)
    if SHORTEST_PATH in values:
        values[SHORTEST_PATH] = np.where(values[SHORTEST_PATH] >= 0, values[SHORTEST_PATH], np.nan)
    return _figure(saved, values, ColourScale(0.0, max(_known(values), default=1.0), "distance in actions"))


def reward_caption(saved: StateMap, targets: str) -> str:
    """Caption of a figure of rewards.

    Args:
        saved: the rewards.
        targets: `trained` or `new`.

    Returns:
        The caption.
    """
    target = target_name(saved.target, saved.category)
    kind = "a trained target" if targets == "trained" else "a target that was not trained"
    methods = listed([method_name(name) for name in in_order(saved.values)])
    start = "" if saved.start is None else f"; predicted for a start at state {saved.start} (ring)"
    return (
        f"Rewards of all states of {saved.poses.name} for {kind}, {target} (star; its arrow is the heading), by "
        f"{methods}, seed {saved.seed}{start}. Each place has four triangles, one for each heading"
    )


def distance_caption(saved: StateMap, task: str) -> str:
    """Caption of a figure of distances.

    Args:
        saved: the distances.
        task: the task whose target it is.

    Returns:
        The caption.
    """
    target = target_name(saved.target, saved.category)
    methods = listed([_title(name) for name in _panels(saved) if name != SHORTEST_PATH])
    return (
        f"Actions from every state of {saved.poses.name} to a target of Task {task}, {target} (star; its arrow is the "
        f"heading): along shortest paths, and as learned by {methods}, seed {saved.seed}. Each place has four "
        "triangles, one for each heading"
    )


def map_columns(saved: StateMap) -> dict[str, np.ndarray]:
    """The data of the maps, as a table.

    Args:
        saved: the map.

    Returns:
        Columns for `write_table`: position in metres, heading in degrees, and the values of each method.
    """
    poses = saved.poses
    columns = {"x": poses.location[:, 0], "z": poses.location[:, 1], "rotation": poses.rotation}
    return {**columns, **{_title(name): saved.values[name] for name in _panels(saved)}}


def _panels(saved: StateMap) -> list[str]:
    """Names of the values in drawing order: true distances, then the methods."""
    truth = [name for name in saved.values if name == SHORTEST_PATH]
    return truth + in_order([name for name in saved.values if name != SHORTEST_PATH])


def _title(name: str) -> str:
    return "Shortest path" if name == SHORTEST_PATH else method_name(name)


def _finite(saved: StateMap) -> dict[str, Float64[np.ndarray, "states"]]:
    return {name: np.where(np.isfinite(saved.values[name]), saved.values[name], np.nan) for name in _panels(saved)}


def _known(values: Mapping[str, Float64[np.ndarray, "states"]]) -> list[float]:
    """All finite values of all maps."""
    return np.concatenate([of_method[np.isfinite(of_method)] for of_method in values.values()]).tolist()


def _figure(saved: StateMap, values: Mapping[str, Float64[np.ndarray, "states"]], scale: ColourScale) -> Figure:
    """One map for each entry, all on one colour scale."""
    columns = min(COLUMNS, len(values))
    rows = -(-len(values) // columns)
    width, height = np.ptp(saved.poses.location, axis=0) + 2.2
    size = (columns * PANEL_INCHES + 1.0, rows * (PANEL_INCHES * np.clip(height / width, 0.4, 2.0) + 0.4) + 0.5)
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False)
    collections = []
    for number, (panel, (name, of_method)) in enumerate(zip(panels.flat, values.items(), strict=False)):
        collections.append(_triangles(panel, saved.poses, of_method))
        collections[-1].set_clim(scale.low, scale.high)
        _mark(panel, saved)
        panel.set(title=_title(name), aspect="equal")
        panel.tick_params(labelbottom=number + columns >= len(values), labelleft=number % columns == 0)
    for panel in panels.flat[len(values) :]:
        panel.set_axis_off()
    figure.supxlabel("x in metres", fontsize=10)
    figure.supylabel("z in metres", fontsize=10)
    known = _known(values)
    below, above = min(known, default=scale.low) < scale.low, max(known, default=scale.high) > scale.high
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[below, above]
    figure.colorbar(collections[0], ax=panels.ravel().tolist(), label=scale.label, shrink=0.8, extend=extend)
    figure.suptitle(f"{saved.poses.name}, target: {target_name(saved.target, saved.category)}")
    return figure


def _mark(panel: Axes, saved: StateMap) -> None:
    """Mark the target and its heading, and the start if there is one."""
    place, heading = saved.poses.location[saved.target], np.deg2rad(saved.poses.rotation[saved.target])
    tip = place + 0.75 * np.array([np.sin(heading), np.cos(heading)])
    panel.plot(*place, "*", color=TARGET_COLOUR, markersize=13, markeredgecolor="white")
    panel.annotate("", tip, place, arrowprops={"arrowstyle": "->", "color": TARGET_COLOUR, "lw": 1.8})
    panel.update_datalim([tip])
    panel.autoscale_view()
    if saved.start is not None:
        start = saved.poses.location[saved.start]
        panel.plot(*start, "o", color="none", markersize=9, markeredgecolor=TARGET_COLOUR)


def _triangles(panel: Axes, poses: ScenePoses, values: Float64[np.ndarray, "states"]) -> PolyCollection:
    """Draw one triangle for each state: from the centre of its place to the edge in the direction of its heading."""
    half = GRID_STEP / 2
    corners = {
        HEADINGS[0]: [(-half, half), (half, half)],
        HEADINGS[1]: [(half, half), (half, -half)],
        HEADINGS[2]: [(half, -half), (-half, -half)],
        HEADINGS[3]: [(-half, -half), (-half, half)],
    }
    shapes = [
        [place, *(place + np.asarray(corner) for corner in corners[float(heading)])]
        for place, heading in zip(poses.location, poses.rotation, strict=True)
    ]
    collection = PolyCollection(shapes, array=values, cmap="viridis", edgecolors="none", antialiased=False)
    panel.add_collection(collection)
    panel.autoscale_view()
    return collection
