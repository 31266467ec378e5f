"""Maps of episodes: the way an agent took, a shortest way, and what it was shown as its target."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int32
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from relm_irl_jax.experts import follow_expert, shortest_path_expert
from relm_irl_jax.scenes.scene import GRID_STEP, Scene


def episode_maps(episodes: Sequence[tuple[Scene, Int32[np.ndarray, "steps+1"], int]], title: str) -> Figure:
    """Draw one episode a scene from above, the target's view beneath.

    Args:
        episodes: scene with views, the states walked, and the target's state.
        title: title of the figure.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(4.2 * len(episodes), 6.4), layout="constrained")
    panels = figure.subplots(2, len(episodes), squeeze=False, height_ratios=(2, 1))
    for column, (scene, states, target) in enumerate(episodes):
        _map(panels[0, column], scene, states, target)
        panels[1, column].imshow(scene.views[target])
        panels[1, column].set_axis_off()
        panels[1, column].set_title("the target's view", fontsize=9)
    panels[0, 0].legend(loc="upper left", bbox_to_anchor=(0, -0.12), ncols=3, frameon=False, fontsize=8)
    figure.suptitle(title)
    return figure


def episode_table(episodes: Sequence[tuple[Scene, Int32[np.ndarray, "steps+1"], int]]) -> dict[str, list]:
    """What the maps show, as a table.

    Args:
        episodes: scene, the states walked, and the target's state.

    Returns:
        Columns: scene, what the row is (a free place, the way taken, a shortest way, the target), the step along a way,
        place in metres, and heading in degrees.
    """
    rows = []
    for scene, states, target in episodes:
        for kind, drawn in (
            ("place", np.unique(scene.location, axis=0, return_index=True)[1]),
            ("taken", states),
            ("shortest", _shortest(scene, states, target)),
            ("target", [target]),
        ):
            steps = range(len(drawn)) if kind in ("taken", "shortest") else [""] * len(drawn)
            rows += [
                (scene.name, kind, step, *scene.location[state].tolist(), float(scene.rotation[state]))
                for step, state in zip(steps, drawn, strict=True)
            ]
    return dict(zip(("scene", "kind", "step", "x", "z", "rotation"), map(list, zip(*rows, strict=True)), strict=True))


def _shortest(scene: Scene, states: Int32[np.ndarray, "steps+1"], target: int) -> Int32[np.ndarray, "least+1"]:
    """States along a shortest way from where the walk began."""
    return follow_expert(scene, shortest_path_expert(scene, target), int(states[0])).states


def _map(panel: Axes, scene: Scene, states: Int32[np.ndarray, "steps+1"], target: int) -> None:
    shortest = _shortest(scene, states, target)
    corners = np.unique(scene.location, axis=0) - 0.46 * GRID_STEP
    squares = [Rectangle((x, z), 0.92 * GRID_STEP, 0.92 * GRID_STEP) for x, z in corners]
    panel.add_collection(PatchCollection(squares, facecolor="#e8e8e8", edgecolor="none"))
    panel.plot(*scene.location[shortest].T, color="#999999", lw=5, alpha=0.6, label="a shortest way")
    panel.plot(*scene.location[states].T, color="#1f6fd6", lw=1.6, label="way taken")
    panel.plot(*scene.location[states[0]], "o", color="#1f6fd6", markersize=8)
    panel.plot(*scene.location[target], "*", color="#d62728", markersize=14, markeredgecolor="white", label="target")
    for state, colour in ((int(states[0]), "#1f6fd6"), (target, "#d62728")):
        heading = np.deg2rad(scene.rotation[state])
        tip = scene.location[state] + 1.5 * GRID_STEP * np.array([np.sin(heading), np.cos(heading)])
        arrow = {"arrowstyle": "->", "color": colour, "lw": 1.6}
        panel.annotate("", tip, scene.location[state], arrowprops=arrow)
        panel.update_datalim([tip])
    steps, least = len(states) - 1, len(shortest) - 1
    outcome = f"found in {steps} steps" if int(states[-1]) == target else f"not found in {steps} steps"
    panel.set(title=f"{scene.name}: {outcome} (shortest {least})", aspect="equal")
    panel.title.set_fontsize(10)
    panel.margins(0.08)
    panel.set_axis_off()
