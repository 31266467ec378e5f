"""Walking by keyboard: the current view and the target's in the terminal, four keys for the four actions."""

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
from relm_irl_jax.scenes.selection import training_scenes, unseen_scenes
from relm_irl_jax.stages.episodes import EpisodePath
from relm_irl_jax.tasks import draw_split

KEYS = {"\x1b[A": 0, "\x1b[C": 1, "\x1b[D": 2, "\x1b[B": 3, "w": 0, "d": 1, "a": 2, "s": 3}
"""Action of each key: up, right, left and down, or w, d, a and s."""

QUIT = "q"

COLUMNS = 48
"""Most columns of the terminal that one picture takes."""


def task_of_run(config: Config, task: str, seed: int, name: str | None) -> tuple[Scene, list[int]]:
    """A scene of a run, and the targets that a task has in it.

    Args:
        config: the configuration as run.
        task: `I`, `II` or `III`.
        seed: the seed that drew the targets.
        name: the scene's name; the task's first scene where None.

    Returns:
        The scene with its views, and the states that are targets.

    Raises:
        InputError: the task has no such scene.
    """
    training = training_scenes(config.scenes, config.scene)
    unseen = unseen_scenes(config.scenes, config.scene) if task == "III" else []
    scenes = unseen if task == "III" else training
    targets = draw_split(training, unseen, config.tasks, seed).of_task(task, config.evaluation)
    states = {scene.name: [t.state for t in targets if t.scene == number] for number, scene in enumerate(scenes)}
    with_targets = {scene.name: scene for scene in scenes if states[scene.name]}
    chosen = next(iter(with_targets)) if name is None else name
    if chosen not in with_targets:
        raise InputError(f"scene: Task {task} has no targets in {chosen}; it has some in {', '.join(with_targets)}.")
    return with_targets[chosen], states[chosen]


def any_task(scene: str, target: str | None) -> tuple[Scene, list[int]]:
    """A scene of any kind, and targets in it.

    Args:
        scene: a scene file, or the name of a built-in room such as `bathroom-0`.
        target: a category of objects; all of them where None.

    Returns:
        The scene with its views, and the states that are targets.

    Raises:
        InputError: there is no such scene or category, or the scene has no views.
    """
    found = find_scene(scene)
    if found.observation is None:
        raise InputError(f"scene: {scene} holds no views; give one that does.")
    return found, target_states(found, target)


def draw_episode(scene: Scene, targets: list[int], seed: int, episode: int) -> tuple[int, int]:
    """Draw a target, and a start that can reach it and is not it.

    Args:
        scene: the scene.
        targets: states that may be sought.
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
    """Walk as the keys say, until the target is found, `QUIT` is pressed or the keys end.

    Args:
        scene: the scene.
        start: first state.
        target: state sought.
        keys: keys pressed; those without an action are passed over.
        show: called with the state, the number of steps and whether the last one collided, at first and after each.

    Returns:
        The walk; an action that collides is a step, too.
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
    """Let the keyboard of this terminal walk.

    Args:
        scene: the scene with its views.
        start: first state.
        target: state sought.
        console: where to draw.

    Returns:
        The walk.

    Raises:
        InputError: input or output is no terminal.
    """
    if not (sys.stdin.isatty() and console.is_terminal):
        raise InputError("play --keyboard: there is no terminal to read keys from and draw in; start it in one.")
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
    """What the walker sees.

    Args:
        scene: the scene with its views.
        state: current state.
        target: state sought.
        steps: number of steps taken.
        collided: whether the last one collided.
        columns: width of a picture.

    Returns:
        Both views and a few words.
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


def half_blocks(picture: UInt8[np.ndarray, "rows columns 3"], columns: int) -> Text:
    """A small picture as text: each character is two pixels, one above the other.

    Args:
        picture: RGB.
        columns: characters of a line.

    Returns:
        The text; the picture keeps its shape, as far as characters are twice as high as wide.
    """
    lines = max(1, round(columns * picture.shape[0] / picture.shape[1] / 2))
    pixels = np.asarray(Image.fromarray(picture).resize((columns, 2 * lines), Image.Resampling.BOX))
    text = Text(no_wrap=True, end="")
    for line in range(lines):
        if line:
            text.append("\n")
        for upper, lower in zip(pixels[2 * line].tolist(), pixels[2 * line + 1].tolist(), strict=True):
            text.append("▀", Style(color=Color.from_rgb(*upper), bgcolor=Color.from_rgb(*lower)))
    return text


@contextmanager
def terminal_keys() -> Iterator[Iterator[str]]:
    """Read keys as they are pressed, without echo; Ctrl-C ends them.

    Yields:
        The keys, arrows as their escape sequences.
    """
    import termios  # Unix alone has it
    import tty

    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)

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
        termios.tcsetattr(handle, termios.TCSADRAIN, before)


def split_keys(pressed: str) -> list[str]:
    """Keys that were read at once.

    Args:
        pressed: characters and escape sequences.

    Returns:
        One text a key; arrows in the form of `KEYS`, whichever of both forms the terminal sends.
    """
    return [key.replace("\x1bO", "\x1b[") for key in re.findall(r"\x1b[\[O][A-D]|.", pressed, re.DOTALL)]
