"""An agent that comes with the package searches for a target in one scene, without any run folder."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
from jaxtyping import UInt8
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from rich.console import Console
from rich.live import Live

from relm_irl_jax.files import whole_file
from relm_irl_jax.play.keyboard import draw_episode, half_blocks
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.report.names import target_name
from relm_irl_jax.report.searches import belief_text, draw_search
from relm_irl_jax.saved_searches import SavedSearch
from relm_irl_jax.scenes.objects import best_views
from relm_irl_jax.scenes.rooms.room_specifications import SOURCE
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.settings import ROOMS, SceneSettings
from relm_irl_jax.scenes.views import resized, scene_views
from relm_irl_jax.stages.episodes import EpisodePath, path_from
from relm_irl_jax.stages.make_agent import packaged_agent
from relm_irl_jax.stages.searches import beliefs_along, search_over_room
from relm_irl_jax.task_settings import TaskSettings
from relm_irl_jax.tasks import Target
from relm_irl_jax.world import build_targets, build_world

FRAME_MILLISECONDS = 350
"""Duration of each step; the first one is shown three times as long, the last one six times."""

DOTS_PER_INCH = 80


def search_scene(scene: Scene, targets: Sequence[int], seed: int, episode: int) -> tuple[SavedSearch, EpisodePath]:
    """Let the mapping agent search for a target, with the weights of the package.

    Args:
        scene: the scene with its views, as they are shown; the agent sees them at its own size.
        targets: possible target states.
        seed: the seed that draws target and start.
        episode: number of the episode.

    Returns:
        The search, with a moment for each step, and the path.

    Raises:
        InputError: the scene is too large for the agent.
    """
    start, target = draw_episode(scene, list(targets), seed, episode)
    agent, parameters = packaged_agent(lambda size: _views(scene, size))
    bare = replace(scene.without_views(), features=np.zeros((scene.n_states, 0), np.float32))
    category = next((name for name, state in best_views(scene).items() if state == target), "")
    world, tables = build_world([bare], []), build_targets([bare], [Target(0, target, category)])
    policy = agent.policy(parameters, world, tables)
    path = path_from(jax.random.key(seed), policy, world, tables, start, TaskSettings().cap)
    beliefs = beliefs_along(policy, path.states, 0, 0, 1, jax.random.key(seed))
    moments = range(len(beliefs))
    return search_over_room(scene, path, beliefs, moments, method="rl", seed=seed, category=category), path


def _views(scene: Scene, size: int) -> UInt8[np.ndarray, "states size size 3"]:
    """A built-in room's views rendered at this size, as the agent was trained on; those of other scenes resized."""
    if scene.source == SOURCE:
        return scene_views(ROOMS, SceneSettings(), size, scene.name)
    return resized(scene, size)


def search_frames(search: SavedSearch) -> list[UInt8[np.ndarray, "height width 3"]]:
    """Draw every step: the view, the target's view, and the belief over the room.

    Args:
        search: the search, with a moment for each step but the last one.

    Returns:
        RGB images of equal size, one for each state of the path.
    """
    figure = Figure(figsize=(10.5, 4.4), dpi=DOTS_PER_INCH, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    view, target, room = figure.subplots(1, 3, width_ratios=(1, 1, 1.35))
    target.imshow(search.target_view)
    target.set_title(f"target: {target_name(search.target, search.category)}", fontsize=11)
    last = len(search.path) - 1
    frames = []
    with progress_bar("drawing the search", last + 1, "steps") as advance:
        for step in range(last + 1):
            moment = min(step, last - 1)
            view.clear()
            view.imshow(search.target_view if step == last and search.success else search.views[moment])
            view.set_title(f"{search.poses.name}: step {step}", fontsize=11)
            room.clear()
            draw_search(room, search, moment, step)
            arrived = f"{'found' if search.success else 'not found'} after {last} steps"
            room.set_title(arrived if step == last else belief_text(search, moment), fontsize=11)
            for panel in (view, target, room):
                panel.set_axis_off()
            canvas.draw()
            frames.append(np.asarray(canvas.buffer_rgba())[..., :3].copy())
            advance(1)
    return frames


def write_search_gif(file: Path, frames: Sequence[UInt8[np.ndarray, "height width 3"]]) -> None:
    """Write frames as an animation.

    Args:
        file: the file.
        frames: RGB images of equal size.
    """
    # One palette, of frames spread over the episode: colours do not flicker.
    sample = Image.fromarray(np.concatenate([frames[0], frames[len(frames) // 2], frames[-1]]))
    palette = sample.quantize(256, dither=Image.Dither.NONE)
    images = [Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    times = [FRAME_MILLISECONDS] * len(images)
    times[0], times[-1] = 3 * FRAME_MILLISECONDS, 6 * FRAME_MILLISECONDS
    with whole_file(file) as temporary:
        images[0].save(temporary, "GIF", save_all=True, append_images=images[1:], duration=times, loop=0)


def show_in_terminal(frames: Sequence[UInt8[np.ndarray, "height width 3"]], console: Console, wait: float) -> None:
    """Show frames one after the other in a terminal.

    Args:
        frames: RGB images of equal size.
        console: a console on a terminal.
        wait: seconds between two frames.
    """
    from time import sleep

    with Live(console=console, auto_refresh=False) as live:
        for frame in frames:
            live.update(half_blocks(frame, max(20, console.width - 2)), refresh=True)
            sleep(wait)
