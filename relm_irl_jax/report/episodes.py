"""Maps of episodes: the agent's path, a shortest path, and the target's view."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from relm_irl_jax.files import columns_of_rows
from relm_irl_jax.report.names import method_name, target_name
from relm_irl_jax.saved_episodes import SavedEpisode
from relm_irl_jax.scenes.scene import GRID_STEP

COLUMNS = 3
"""Largest number of episodes in a row."""

PATH_COLOUR = "#1f6fd6"
TARGET_COLOUR = "#d62728"


def episode_figure(episodes: Sequence[SavedEpisode]) -> Figure:
    """Draw episodes from above, each with the target's view below it.

    Args:
        episodes: the episodes.

    Returns:
        The figure.
    """
    columns = min(COLUMNS, len(episodes))
    rows = -(-len(episodes) // columns)
    figure = Figure(figsize=(3.6 * columns, 5.8 * rows), layout="constrained")
    panels = figure.subplots(2 * rows, columns, squeeze=False, height_ratios=(2, 1) * rows)
    for panel in panels.flat:
        panel.set_axis_off()
    for number, episode in enumerate(episodes):
        above, beneath = panels[2 * (number // columns) :, number % columns][:2]
        _draw(above, episode)
        beneath.imshow(episode.target_view)
        beneath.set_title(f"target: {target_name(episode.target, episode.category)}", fontsize=9)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def episode_caption(episodes: Sequence[SavedEpisode], task: str) -> str:
    """Caption of a figure of episodes.

    Args:
        episodes: the episodes, all of one method and seed.
        task: the task.

    Returns:
        The caption.
    """
    first = episodes[0]
    shown = "; ".join(f"{e.poses.name}, target {target_name(e.target, e.category)}" for e in episodes)
    return f"The first episodes of {method_name(first.method)}, seed {first.seed}, on Task {task}: {shown}"


def episode_columns(episodes: Sequence[SavedEpisode]) -> dict[str, list]:
    """The data of the maps, as a table.

    Args:
        episodes: the episodes.

    Returns:
        Columns for `write_table`: scene, kind of the row (a free place, the path taken, a shortest path, the target),
        step along a path, position in metres, and heading in degrees.
    """
    rows = []
    for episode in episodes:
        poses = episode.poses
        for kind, states in (
            ("place", np.unique(poses.location, axis=0, return_index=True)[1]),
            ("taken", episode.path),
            ("shortest", episode.shortest_path),
            ("target", [episode.target]),
        ):
            steps = range(len(states)) if kind in ("taken", "shortest") else [""] * len(states)
            rows += [
                (poses.name, kind, step, *poses.location[state].tolist(), float(poses.rotation[state]))
                for step, state in zip(steps, states, strict=True)
            ]
    return columns_of_rows(("scene", "kind", "step", "x", "z", "rotation"), rows)


def _draw(panel: Axes, episode: SavedEpisode) -> None:
    """Draw the room from above with both paths, and the headings of start and target."""
    location, rotation = episode.poses.location, episode.poses.rotation
    corners = np.unique(location, axis=0) - 0.46 * GRID_STEP
    squares = [Rectangle((x, z), 0.92 * GRID_STEP, 0.92 * GRID_STEP) for x, z in corners]
    panel.add_collection(PatchCollection(squares, facecolor="#e8e8e8", edgecolor="none"))
    panel.plot(*location[episode.shortest_path].T, color="#999999", lw=5, alpha=0.6, label="a shortest path")
    panel.plot(*location[episode.path].T, color=PATH_COLOUR, lw=1.6, label="path taken")
    start, target = int(episode.path[0]), episode.target
    panel.plot(*location[start], "o", color=PATH_COLOUR, markersize=8)
    style = {"color": TARGET_COLOUR, "markersize": 14, "markeredgecolor": "white", "linestyle": "none"}
    panel.plot(*location[target], "*", label="target", **style)
    for state, colour in ((start, PATH_COLOUR), (target, TARGET_COLOUR)):
        heading = np.deg2rad(rotation[state])
        tip = location[state] + 1.5 * GRID_STEP * np.array([np.sin(heading), np.cos(heading)])
        panel.annotate("", tip, location[state], arrowprops={"arrowstyle": "->", "color": colour, "lw": 1.6})
        panel.update_datalim([tip])
    steps, shortest = len(episode.path) - 1, len(episode.shortest_path) - 1
    outcome = f"{'found in' if episode.success else 'not found in'} {steps} steps"
    panel.set_title(f"{episode.poses.name}: {outcome}\n(shortest {shortest})", fontsize=10)
    panel.set_aspect("equal")
    panel.margins(0.08)
