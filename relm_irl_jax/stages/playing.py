"""Watching an agent: one episode in each scene, as a moving picture of its view, the target's and the way taken."""

from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Int32, UInt8
from PIL import Image, ImageDraw

from relm_irl_jax import env
from relm_irl_jax.config import Config, Method
from relm_irl_jax.env import Episode, scene_lanes
from relm_irl_jax.errors import InputError
from relm_irl_jax.evaluation import Policy
from relm_irl_jax.experts import shortest_path_expert
from relm_irl_jax.experts import walk as expert_walk
from relm_irl_jax.files import whole_file
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.saved_maps import SavedEpisode, poses_of, save_episodes
from relm_irl_jax.scenes.catalog import training_scenes, unseen_scenes
from relm_irl_jax.scenes.scene import GRID_STEP, Scene
from relm_irl_jax.stages.encoding import EncodedScenes, encode_training
from relm_irl_jax.stages.evaluating import policy_of
from relm_irl_jax.stages.ground import Ground, ground_of
from relm_irl_jax.world import scene_offsets

FRAME_MILLISECONDS = 250
"""Time that each step is shown; the last one stays four times as long."""


@dataclass(frozen=True)
class Walk:
    """One episode.

    Attributes:
        states: states of the scene, from the start to the last.
        target: the state sought.
        shortest: least number of actions from the start to the target.
    """

    states: Int32[np.ndarray, "steps+1"]
    target: int
    shortest: int

    @property
    def success(self) -> bool:
        """Whether the walk ends at the target."""
        return int(self.states[-1]) == self.target


def play(
    config: Config, folder: RunFolder, method: Method, task: str, seed: int, episode: int
) -> list[tuple[Path, Walk]]:
    """Run one episode in each scene of a task and keep it as a GIF in the run folder.

    Args:
        config: the configuration as run.
        folder: the run folder.
        method: whose agent.
        task: `I`, `II` or `III`.
        seed: which seed's agent.
        episode: number of the episode; another one draws another start, target and actions.

    Returns:
        Files and walks, in the order of the scenes.

    Raises:
        InputError: the run holds no such agent.
    """
    if method != "random" and not folder.agent(method, seed).exists():
        raise InputError(f"{folder.path}: holds no agent of {method} with seed {seed}; train it, or choose another.")
    played = []
    walks = walks_of(config, folder, encode_training(config), method, task, seed, episode)
    with progress_bar("drawing episodes", len(walks), "scenes") as advance:
        for scene, walk in walks:
            path = folder.film(method, task, scene.name, episode)
            write_gif(path, scene, walk)
            played.append((path, walk))
            advance(1)
    return played


def keep_episodes(
    config: Config, folder: RunFolder, training: EncodedScenes, method: Method, task: str, seed: int = 0
) -> None:
    """Save the first episode in one scene of each room type, for the report.

    Args:
        config: the configuration as run.
        folder: the run folder.
        training: the training scenes.
        method: whose agent.
        task: `I`, `II` or `III`.
        seed: which seed's agent.
    """
    first: dict[str, SavedEpisode] = {}
    chosen = ground_of(config, training, task, seed).chosen
    for number, (scene, walk) in enumerate(walks_of(config, folder, training, method, task, seed, 0)):
        if scene.room_type in first:
            continue
        category = next(t.category for t in chosen if (t.scene, t.state) == (number, walk.target))
        first[scene.room_type] = SavedEpisode(
            poses=poses_of(scene),
            method=method,
            seed=seed,
            target=walk.target,
            category=category,
            path=walk.states,
            shortest_path=expert_walk(scene, shortest_path_expert(scene, walk.target), int(walk.states[0])).states,
            target_view=scene.views[walk.target],
        )
    save_episodes(folder.episodes(task), list(first.values()))


def walks_of(
    config: Config, folder: RunFolder, training: EncodedScenes, method: Method, task: str, seed: int, episode: int
) -> list[tuple[Scene, Walk]]:
    """Run one episode in each scene of a task.

    Args:
        config: the configuration as run.
        folder: the run folder.
        training: the training scenes.
        method: whose agent.
        task: `I`, `II` or `III`.
        seed: which seed's agent.
        episode: number of the episode.

    Returns:
        Scenes with their views, and walks.
    """
    ground = ground_of(config, training, task, seed)
    pictured = (unseen_scenes if task == "III" else training_scenes)(config.scenes, config.scene)
    names = [scene.name for scene in pictured]
    policy = policy_of(config, folder, method, seed, ground)
    walks = walk_all(jax.random.fold_in(jax.random.key(seed), episode), policy, ground, config.tasks.cap)
    return [(pictured[names.index(scene.name)], walk) for scene, walk in zip(ground.scenes, walks, strict=True)]


def walk_all(key: jax.Array, policy: Policy, ground: Ground, cap: int) -> list[Walk]:
    """One episode in each scene.

    Args:
        key: source of all randomness.
        policy: the agent.
        ground: scenes and targets.
        cap: most steps.

    Returns:
        One walk a scene.
    """
    scenes, world, targets = ground.scenes, ground.world, ground.targets
    lane = scene_lanes(targets, len(scenes), 1)
    reset_key, key = jax.random.split(key)
    each = lambda function: jax.vmap(jax.vmap(function))  # noqa: E731
    first = env.reset_all(reset_key, targets, lane, policy.history)

    @jax.jit
    def advance(episode: Episode, key: jax.Array):
        action = policy(key, episode.views, episode.target)
        return each(lambda e, a: env.step(e, a, world, targets, jnp.int32(cap))[0])(episode, action)

    episode, course = first, [np.asarray(first.state)[:, 0]]
    for step_key in jax.random.split(key, cap):
        episode = advance(episode, step_key)
        course.append(np.asarray(episode.state)[:, 0])
    states, offsets = np.stack(course, axis=1), scene_offsets(scenes)
    sought = np.asarray(targets.state)[np.asarray(first.target)[:, 0]]
    walks = []
    for number, scene in enumerate(scenes):
        arrived = np.flatnonzero(states[number] == sought[number])
        last = int(arrived[0]) if len(arrived) else cap
        local = (states[number, : last + 1] - offsets[number]).astype(np.int32)
        target = int(sought[number]) - offsets[number]
        walks.append(Walk(local, target, int(scene.shortest_path_distance[local[0], target])))
    return walks


def write_gif(path: Path, scene: Scene, walk: Walk) -> None:
    """Draw a walk: view, target view and map side by side, one frame a step.

    Args:
        path: the file.
        scene: the scene with its views.
        walk: the walk.
    """
    frames = [
        Image.fromarray(
            np.concatenate(
                [scene.views[state], scene.views[walk.target], draw_map(scene, walk, step, scene.views.shape[1])],
                axis=1,
            )
        )
        for step, state in enumerate(walk.states)
    ]
    durations = [FRAME_MILLISECONDS] * (len(frames) - 1) + [4 * FRAME_MILLISECONDS]
    with whole_file(path) as temporary:
        frames[0].save(temporary, "GIF", save_all=True, append_images=frames[1:], duration=durations, loop=0)


def draw_map(scene: Scene, walk: Walk, step: int, size: int) -> UInt8[np.ndarray, "size size 3"]:
    """The room from above: free places, the way so far, the agent in blue and the target in red, with their headings.

    Args:
        scene: the scene.
        walk: the walk.
        step: number of steps taken.
        size: rows and columns of the picture.

    Returns:
        The picture, +z upwards.
    """
    low, high = scene.location.min(0) - GRID_STEP, scene.location.max(0) + GRID_STEP
    scale = size / (high - low).max()
    margin = (size - (high - low) * scale) / 2

    def place(state: int) -> tuple[float, float]:
        x, z = (scene.location[state] - low) * scale + margin
        return float(x), float(size - z)

    picture = Image.new("RGB", (size, size), "white")
    pen = ImageDraw.Draw(picture)
    half = 0.45 * GRID_STEP * scale
    for x, y in {place(state) for state in range(scene.n_states)}:
        pen.rectangle((x - half, y - half, x + half, y + half), fill="#dddddd")
    way = [place(int(state)) for state in walk.states[: step + 1]]
    if len(way) > 1:
        pen.line(way, fill="#1f6fd6", width=2)
    for state, colour in ((walk.target, "#d62728"), (int(walk.states[step]), "#1f6fd6")):
        x, y = place(state)
        radians = np.deg2rad(scene.rotation[state])
        tip = (x + 1.6 * half * np.sin(radians), y - 1.6 * half * np.cos(radians))
        pen.line(((x, y), tip), fill=colour, width=3)
        pen.ellipse((x - 0.7 * half, y - 0.7 * half, x + 0.7 * half, y + 0.7 * half), fill=colour)
    return np.asarray(picture)
