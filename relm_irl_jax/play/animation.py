"""Animations of an agent's episodes: its view, the target's view and a map with its path."""

from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw

from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import whole_file
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.scene import GRID_STEP, Scene
from relm_irl_jax.scenes.selection import scene_to_show
from relm_irl_jax.stages.encoding import check_encoder, encode_training
from relm_irl_jax.stages.episodes import AgentChoice, EpisodePath, play_task

FRAME_MILLISECONDS = 250
"""Duration of each step; the last one is shown four times as long."""


def play(
    config: Config, folder: RunFolder, choice: AgentChoice, episode: int, only: str | None = None
) -> list[tuple[Path, EpisodePath]]:
    """Run one episode in each scene of a task, and write it as a GIF to the run folder.

    Args:
        config: the configuration as run.
        folder: the run folder.
        choice: the agent and the task.
        episode: number of the episode, which determines start, target and actions.
        only: name of a scene, if no other is to be drawn.

    Returns:
        Files and paths, in the order of the scenes.

    Raises:
        InputError: the run contains no such agent, or the task has no such scene.
    """
    method, seed = choice.method, choice.seed
    if method != "random" and not folder.agent(method, seed).exists():
        raise InputError(f"{folder.path}: contains no agent of {method} with seed {seed}; train it, or choose another.")
    played = []
    encoded = encode_training(config)
    check_encoder(folder, encoded)
    paths = play_task(config, folder, encoded, choice, episode).paths
    names = [scene.name for scene, _ in paths]
    if only is not None and only not in names:
        raise InputError(f"scene: Task {choice.task} of this run is not in {only}; give one of {', '.join(names)}.")
    paths = [(scene, path) for scene, path in paths if only in (None, scene.name)]
    with progress_bar("drawing episodes", len(paths), "scenes") as advance:
        for scene, episode_path in paths:
            file = folder.animation(method, choice.task, scene.name, episode)
            write_gif(file, scene_to_show(config.scenes, config.scene, scene.name), episode_path)
            played.append((file, episode_path))
            advance(1)
    return played


def write_gif(file: Path, scene: Scene, path: EpisodePath) -> None:
    """Draw an episode: view, target view and map side by side, one frame for each step.

    Args:
        file: the file.
        scene: the scene with its views.
        path: the episode's path.
    """
    frames = [
        Image.fromarray(
            np.concatenate(
                [scene.views[state], scene.views[path.target], draw_map(scene, path, step, scene.views.shape[1])],
                axis=1,
            )
        )
        for step, state in enumerate(path.states)
    ]
    durations = [FRAME_MILLISECONDS] * (len(frames) - 1) + [4 * FRAME_MILLISECONDS]
    with whole_file(file) as temporary:
        frames[0].save(temporary, "GIF", save_all=True, append_images=frames[1:], duration=durations, loop=0)


def draw_map(scene: Scene, path: EpisodePath, step: int, size: int) -> UInt8[np.ndarray, "size size 3"]:
    """Draw the room from above: free places, the path so far, the agent in blue and the target in red.

    Args:
        scene: the scene.
        path: the episode's path.
        step: number of steps taken.
        size: rows and columns of the image.

    Returns:
        The image, with +z upwards.
    """
    low, high = scene.location.min(0) - GRID_STEP, scene.location.max(0) + GRID_STEP
    scale = size / (high - low).max()
    margin = (size - (high - low) * scale) / 2

    def to_pixels(state: int) -> tuple[float, float]:
        x, z = (scene.location[state] - low) * scale + margin
        return float(x), float(size - z)

    image = Image.new("RGB", (size, size), "white")
    pen = ImageDraw.Draw(image)
    half = 0.45 * GRID_STEP * scale
    for x, y in {to_pixels(state) for state in range(scene.n_states)}:
        pen.rectangle((x - half, y - half, x + half, y + half), fill="#dddddd")
    track = [to_pixels(int(state)) for state in path.states[: step + 1]]
    if len(track) > 1:
        pen.line(track, fill="#1f6fd6", width=2)
    for state, colour in ((path.target, "#d62728"), (int(path.states[step]), "#1f6fd6")):
        x, y = to_pixels(state)
        radians = np.deg2rad(scene.rotation[state])
        tip = (x + 1.6 * half * np.sin(radians), y - 1.6 * half * np.cos(radians))
        pen.line(((x, y), tip), fill=colour, width=3)
        pen.ellipse((x - 0.7 * half, y - 0.7 * half, x + 0.7 * half, y + 0.7 * half), fill=colour)
    return np.asarray(image)
