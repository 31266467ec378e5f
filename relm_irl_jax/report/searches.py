"""Pictures of a search: the map so far and the belief about the target's pose, drawn over the true room."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Float32
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from relm_irl_jax.files import columns_of_rows
from relm_irl_jax.report.names import target_name
from relm_irl_jax.saved_searches import SavedSearch
from relm_irl_jax.scenes.scene import GRID_STEP

AGENT_COLOUR, TARGET_COLOUR, WALL_COLOUR = "#1f6fd6", "#111111", "#20242c"

UNKNOWN, FREE, BLOCKED = ((np.array(colour) / 255) for colour in ((206, 210, 216), (255, 255, 255), (96, 104, 120)))
"""Colours of places that were not seen, of free ones and of blocked ones."""

FAINTEST = 1e-3
"""Probability of a place below which nothing is drawn."""

LIKELY = 0.04
"""Probability of a pose from which on its heading is drawn."""

MARGIN = 1.0
"""Metres around the room that are shown."""


def search_figure(searches: Sequence[SavedSearch]) -> Figure:
    """One row for each search: the target's view, and the belief at its moments.

    Args:
        searches: the searches.

    Returns:
        The figure.
    """
    columns = 1 + max(len(search.steps) for search in searches)
    figure = Figure(figsize=(2.5 * columns, 2.9 * len(searches) + 0.5), layout="constrained")
    panels = figure.subplots(len(searches), columns, squeeze=False)
    for panel in panels.flat:
        panel.set_axis_off()
    for row, search in zip(panels, searches, strict=True):
        row[0].imshow(search.target_view)
        row[0].set_title(f"{search.poses.name}\ntarget: {target_name(search.target, search.category)}", fontsize=9)
        for moment, panel in enumerate(row[1 : 1 + len(search.steps)]):
            draw_search(panel, search, moment)
            steps = int(search.steps[moment])
            panel.set_title(f"after {steps} step{'' if steps == 1 else 's'}\n{belief_text(search, moment)}", fontsize=8)
    return figure


def search_caption(searches: Sequence[SavedSearch], task: str) -> str:
    """Caption of the figure.

    Args:
        searches: the searches.
        task: the task.

    Returns:
        The caption.
    """
    outcomes = "; ".join(
        f"{search.poses.name}: {'found in' if search.success else 'not found in'} {len(search.path) - 1} steps"
        for search in searches
    )
    return (
        f"How the agent searches on Task {task}, moment by moment. Grey: not seen yet; white and dark: places that it "
        "believes free or blocked; yellow to red: how probable it finds that the target's view was taken there, with "
        "arrows for likely headings. Outline, star and its arrow: the true room and the true pose, which it is not "
        f"told. Blue: its path. {outcomes}"
    )


def search_columns(searches: Sequence[SavedSearch]) -> dict[str, list]:
    """The data of the pictures in short, as a table.

    Args:
        searches: the searches.

    Returns:
        Columns for `write_table`: scene, steps taken, position and heading, the probability of the target's pose, and
        that of the most probable pose.
    """
    rows = []
    for search in searches:
        for moment, step in enumerate(search.steps.tolist()):
            state = int(search.path[step])
            here = (*search.poses.location[state].tolist(), float(search.poses.rotation[state]))
            top = float(search.probability[moment].max())
            rows.append((search.poses.name, step, *here, probability_of_target(search, moment), top))
    names = ("scene", "steps", "x", "z", "rotation", "probability_of_target", "largest_probability")
    return columns_of_rows(names, rows)


def probability_of_target(search: SavedSearch, moment: int) -> float:
    """Probability that the agent gives to the target's true pose.

    Args:
        search: the search.
        moment: index of the moment.

    Returns:
        It; 0 where the pose lies outside the square of places.
    """
    side = search.probability.shape[-1]
    x, z = np.rint((search.poses.location[search.target] - search.origin) / GRID_STEP).astype(int) + side // 2
    heading = round(float(search.poses.rotation[search.target]) / 90) % 4
    inside = 0 <= x < side and 0 <= z < side
    return float(search.probability[moment, heading, z, x]) if inside else 0.0


def belief_text(search: SavedSearch, moment: int) -> str:
    """What the agent believes, in a few words.

    Args:
        search: the search.
        moment: index of the moment.
    """
    return f"belief in the true pose: {probability_of_target(search, moment):.0%}"


def draw_search(panel: Axes, search: SavedSearch, moment: int, steps: int | None = None) -> None:
    """Draw the map so far and the belief over the true room.

    Args:
        panel: where to draw.
        search: the search.
        moment: index of the moment.
        steps: number of steps after which the agent is shown; by default those of the moment.
    """
    taken = int(search.steps[moment]) if steps is None else steps
    side = search.probability.shape[-1]
    reach = (side // 2 + 0.5) * GRID_STEP
    (x, z) = search.origin
    extent = (x - reach, x + reach, z - reach, z + reach)
    for image in (
        _map_colours(search.free[moment], search.coverage[moment]),
        _belief_colours(search.probability[moment].sum(0)),
    ):
        panel.imshow(image, extent=extent, origin="lower", interpolation="nearest")
    panel.add_collection(LineCollection(_outline(search), colors=WALL_COLOUR, linewidths=1.3))
    track = search.poses.location[search.path[: taken + 1]]
    panel.plot(*track.T, color=AGENT_COLOUR, lw=1.8, solid_capstyle="round")
    for heading, row, column in np.argwhere(search.probability[moment] > LIKELY).tolist():
        place = search.origin + GRID_STEP * (np.array([column, row]) - side // 2)
        _arrow(panel, place, 90.0 * heading, "#a01428", 0.75 * GRID_STEP)
    goal, here = search.target, int(search.path[taken])
    panel.plot(*search.poses.location[goal], "*", color=TARGET_COLOUR, markersize=11, markeredgecolor="white", zorder=5)
    _arrow(panel, search.poses.location[goal], float(search.poses.rotation[goal]), TARGET_COLOUR, 1.3 * GRID_STEP)
    rotation = float(search.poses.rotation[here])
    style = {"color": AGENT_COLOUR, "markersize": 10, "markeredgecolor": "white", "zorder": 6}
    panel.plot(*search.poses.location[here], marker=(3, 0, -rotation), **style)
    low, high = search.poses.location.min(0) - MARGIN, search.poses.location.max(0) + MARGIN
    panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")


def _map_colours(free: Float32[np.ndarray, "z x"], coverage: Float32[np.ndarray, "z x"]) -> Float[np.ndarray, "z x 3"]:
    """White where the agent believes a place free, dark where blocked, grey where it has seen nothing."""
    share = (1 / (1 + np.exp(-free)))[..., None]
    known = np.clip(2.5 * coverage, 0, 1)[..., None]
    return (1 - known) * UNKNOWN + known * (share * FREE + (1 - share) * BLOCKED)


def _belief_colours(probability: Float32[np.ndarray, "z x"]) -> Float[np.ndarray, "z x 4"]:
    """Yellow to red on a logarithmic scale, transparent below `FAINTEST`."""
    level = np.clip(1 + np.log10(np.maximum(probability, 1e-12)) / -np.log10(FAINTEST), 0, 1)
    colours = colormaps["YlOrRd"](0.15 + 0.75 * level)
    colours[..., 3] = np.clip(1.6 * level, 0, 0.9)
    return colours


def _outline(search: SavedSearch) -> list[Float[np.ndarray, "2 2"]]:
    """The borders between places that can be stood on and others."""
    cells = {(round(x / GRID_STEP), round(z / GRID_STEP)) for x, z in search.poses.location.tolist()}
    low = search.poses.location.min(0) - GRID_STEP * np.rint(search.poses.location.min(0) / GRID_STEP)
    borders = []
    for x, z in cells:
        for dx, dz in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            if (x + dx, z + dz) not in cells:
                middle = np.array([x + dx / 2, z + dz / 2])
                along = np.array([abs(dz), abs(dx)]) / 2
                borders.append(low + GRID_STEP * np.stack([middle - along, middle + along]))
    return borders


def _arrow(panel: Axes, place: Float[np.ndarray, "2"], rotation: float, colour: str, length: float) -> None:
    """An arrow from a place in the direction of a heading in degrees."""
    tip = place + length * np.array([np.sin(np.deg2rad(rotation)), np.cos(np.deg2rad(rotation))])
    panel.annotate("", tuple(tip), tuple(place), arrowprops={"arrowstyle": "->", "color": colour, "lw": 1.4}, zorder=4)
