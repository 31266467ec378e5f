"""Navigation by keyboard: the terminal shows the current view and the target's view, and keys select the actions."""

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import numpy as np
from jaxtyping import UInt8
from PIL import Image
from rich import box
from rich.color import Color
from rich.console import Console, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.style import Style
from rich.table import Table
from rich.text import Text

from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.gym import find_scene, target_states
from relm_irl_jax.scenes.scene import Scene, successors
from relm_irl_jax.scenes.selection import scene_to_show, training_scenes, unseen_scenes
from relm_irl_jax.stages.encoding import scene_settings
from relm_irl_jax.stages.episodes import EpisodePath
from relm_irl_jax.tasks import draw_split

KEYS = {"\x1b[A": 0, "\x1b[C": 1, "\x1b[D": 2, "\x1b[B": 3, "w": 0, "d": 1, "a": 2, "s": 3}
"""Action of each key: up, right, left and down, or w, d, a and s."""

QUIT = "q"

COLUMNS = 48
"""Largest width of an image in terminal columns."""


def scene_and_targets_of_run(config: Config, task: str, seed: int, name: str | None) -> tuple[Scene, list[int]]:
    """Load a scene of a run, and the targets of a task in it.

    Args:
        config: the configuration as run.
        task: `I`, `II` or `III`.
        seed: the seed that drew the targets.
        name: the scene's name; the task's first scene if None.

    Returns:
        The scene with its views, and its target states.

    Raises:
        InputError: the task has no such scene.
    """
    settings = scene_settings(config)  # objects are as large in views as in the run's, so that the targets are the same
    training = [load(views=False) for load in training_scenes(config.scenes, settings)]
    unseen = [load(views=False) for load in unseen_scenes(config.scenes, settings)] if task == "III" else []
    scenes = unseen if task == "III" else training
    targets = draw_split(training, unseen, config.tasks, seed).of_task(task, config.evaluation)
    states = {scene.name: [t.state for t in targets if t.scene == number] for number, scene in enumerate(scenes)}
    with_targets = [scene.name for scene in scenes if states[scene.name]]
    chosen = with_targets[0] if name is None else name
    if chosen not in with_targets:
        raise InputError(f"scene: Task {task} has no targets in {chosen}; give one of {', '.join(with_targets)}.")
    return scene_to_show(config.scenes, config.scene, chosen), states[chosen]


def scene_and_targets(scene: str, target: str | None) -> tuple[Scene, list[int]]:
    """Load a scene, and choose targets in it.

    Args:
        scene: a scene file, or the name of a built-in room such as `bathroom-0`.
        target: a category of objects; all categories if None.

    Returns:
        The scene with its views, and its target states.

    Raises:
        InputError: there is no such scene or category, or the scene has no views.
    """
    loaded = find_scene(scene)
    if loaded.observation is None:
        raise InputError(f"scene: {scene} has no views; give a scene with views.")
    return loaded, target_states(loaded, target)


def draw_episode(scene: Scene, targets: list[int], seed: int, episode: int) -> tuple[int, int]:
    """Draw a target, and a different start that can reach it.

    Args:
        scene: the scene.
        targets: possible target states.
        seed: the seed.
        episode: number of the episode.

    Returns:
        Start and target.
    """
    generator = np.random.default_rng([seed, episode])
    target = int(generator.choice(targets))
    return int(generator.choice(np.flatnonzero(scene.shortest_path_distance[:, target] > 0))), target


def steps_by_keys(
    scene: Scene, start: int, target: int, keys: Iterable[str], show: Callable[[int, int, bool], None]
) -> EpisodePath:
    """Take the actions of pressed keys until the target is reached, `QUIT` is pressed or the keys end.

    Args:
        scene: the scene.
        start: first state.
        target: target state.
        keys: pressed keys; keys without an action are ignored.
        show: called at the start and after each step with the state, the number of steps, and whether the last step
            collided.

    Returns:
        The path; a collision also counts as a step.
    """
    successor = successors(scene.graph)
    states = [start]
    show(start, 0, False)
    for key in keys:
        if key == QUIT:
            break
        if key in KEYS:
            states.append(int(successor[states[-1], KEYS[key]]))
            show(states[-1], len(states) - 1, states[-1] == states[-2])
            if states[-1] == target:
                break
    return EpisodePath(np.asarray(states, np.int32), target, int(scene.shortest_path_distance[start, target]))


def play_in_terminal(scene: Scene, start: int, target: int, console: Console) -> EpisodePath:
    """Run an episode with actions from the terminal's keyboard.

    Args:
        scene: the scene with its views.
        start: first state.
        target: target state.
        console: the console to draw on.

    Returns:
        The path.

    Raises:
        InputError: standard input or the console is not a terminal.
    """
    if not (sys.stdin.isatty() and console.is_terminal):
        raise InputError("play --keyboard: input and output must be a terminal; start the command in one.")
    with terminal_keys() as keys, Live(console=console, screen=True, auto_refresh=False) as live:
        columns = max(8, min(COLUMNS, console.width // 2 - 4, 2 * (console.height - 6)))
        return steps_by_keys(
            scene,
            start,
            target,
            keys,
            lambda state, steps, collided: live.update(
                screen_of(scene, state, target, steps, collided, columns), refresh=True
            ),
        )


def screen_of(scene: Scene, state: int, target: int, steps: int, collided: bool, columns: int) -> RenderableType:
    """The terminal's content: both views, status and keys.

    Args:
        scene: the scene with its views.
        state: current state.
        target: target state.
        steps: number of steps taken.
        collided: whether the last step collided.
        columns: width of an image in terminal columns.

    Returns:
        The content.
    """
    views = Table.grid(padding=(0, 1))
    views.add_row(
        *(
            Panel(half_blocks(scene.views[number], columns), title=title, box=box.ROUNDED, padding=0, expand=False)
            for title, number in (("view", state), ("target", target))
        )
    )
    distance = scene.shortest_path_distance[state, target]
    page = Table.grid()
    page.add_row(views)
    page.add_row(f"{scene.name}   distance {distance}   steps {steps}{'   collided' if collided else ''}")
    page.add_row(Text("↑ w ahead   → d turn right   ← a turn left   ↓ s back   q quit", style="dim"))
    return page


def half_blocks(image: UInt8[np.ndarray, "rows columns 3"], columns: int) -> Text:
    """A small image as text: each character shows two pixels, one above the other.

    Args:
        image: RGB.
        columns: characters in a line.

    Returns:
        The text; the aspect ratio is right if characters are twice as high as wide.
    """
    lines = max(1, round(columns * image.shape[0] / image.shape[1] / 2))
    pixels = np.asarray(Image.fromarray(image).resize((columns, 2 * lines), Image.Resampling.BOX))
    text = Text(no_wrap=True, end="")
    for line in range(lines):
        if line:
            text.append("\n")
        for upper, lower in zip(pixels[2 * line].tolist(), pixels[2 * line + 1].tolist(), strict=True):
            text.append("▀", Style(color=Color.from_rgb(*upper), bgcolor=Color.from_rgb(*lower)))
    return text


@contextmanager
def terminal_keys() -> Iterator[Iterator[str]]:
    """Read keys as they are pressed, without echo, until Ctrl-C.

    Yields:
        An iterator over the keys; arrow keys are escape sequences.
    """
    import termios  # only exists on Unix
    import tty

    handle = sys.stdin.fileno()
    attributes = termios.tcgetattr(handle)

    def read() -> Iterator[str]:
        try:
            while pressed := os.read(handle, 64):
                yield from split_keys(pressed.decode(errors="ignore"))
        except KeyboardInterrupt:
            return

    tty.setcbreak(handle)
    try:
        yield read()
    finally:
        termios.tcsetattr(handle, termios.TCSADRAIN, attributes)


def split_keys(pressed: str) -> list[str]:
    """Split input into keys.

    Args:
        pressed: characters and escape sequences.

    Returns:
        One string for each key; arrow keys in the form of `KEYS`, for both forms that terminals send.
    """
    return [key.replace("\x1bO", "\x1b[") for key in re.findall(r"\x1b[\[O][A-D]|.", pressed, re.DOTALL)]
