"""The command `relm-irl play`."""

from pathlib import Path

from rich.console import Console

from relm_irl_jax.cli.output import standard_output
from relm_irl_jax.commands import Play
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import ensure_writable
from relm_irl_jax.play.animation import play
from relm_irl_jax.play.keyboard import draw_episode, play_in_terminal, scene_and_targets, scene_and_targets_of_run
from relm_irl_jax.play.recording import record_walk
from relm_irl_jax.play.search import search_frames, search_scene, show_in_terminal, write_search_gif
from relm_irl_jax.run_config import find_run
from relm_irl_jax.stages.episodes import AgentChoice, EpisodePath


def execute(command: Play) -> None:
    """Save animations of an agent, or navigate by keyboard.

    Args:
        command: the arguments.
    """
    console = standard_output()
    if command.agent is not None:
        _play_packaged(command, console)
        return
    if command.keyboard or command.run is None:
        _play_by_keyboard(command, console)
        return
    if command.record is not None:
        raise InputError("record: only walks by keyboard are recorded; add --keyboard, or use `demonstrations`.")
    if command.target is not None:
        raise InputError("target: the targets are those of the run's task; leave it out, or play without a run.")
    folder, config = find_run(command.run)
    choice = AgentChoice(command.method, command.task, command.seed)
    for file, path in play(config, folder, choice, command.episode, command.scene):
        console.print(f"{file}: {_outcome(path)}", highlight=False, soft_wrap=True)


def _play_by_keyboard(command: Play, console: Console) -> None:
    if command.run is None:
        scene, targets = scene_and_targets(command.scene or "bathroom-0", command.target)
    else:
        scene, targets = scene_and_targets_of_run(find_run(command.run)[1], command.task, command.seed, command.scene)
    start, target = draw_episode(scene, targets, command.seed, command.episode)
    if command.record is not None:
        ensure_writable(command.record.parent)
    path = play_in_terminal(scene, start, target, console)
    console.print(f"{scene.name}: {_outcome(path)}", highlight=False, soft_wrap=True)
    if command.record is not None:
        console.print(record_walk(scene, path, command.record), highlight=False, soft_wrap=True)


def _play_packaged(command: Play, console: Console) -> None:
    if command.run is not None or command.keyboard:
        raise InputError("agent: an agent of the package belongs to no run; give either a run or --agent.")
    scene, targets = scene_and_targets(command.scene or "bathroom-50", command.target)
    file = Path("runs") / "play" / f"{command.agent}-{scene.name}-{command.seed}-{command.episode}.gif"
    ensure_writable(file.parent)
    search, path = search_scene(scene, targets, command.seed, command.episode)
    frames = search_frames(search)
    write_search_gif(file, frames)
    if console.is_terminal:
        show_in_terminal(frames, console, 0.35)
    console.print(f"{file}: {_outcome(path)}", highlight=False, soft_wrap=True)


def _outcome(path: EpisodePath) -> str:
    """How an episode ended, in a few words."""
    steps = len(path.states) - 1
    ended = "reached after" if path.success else "not reached in"
    return f"target {ended} {steps} steps; shortest path: {path.shortest}"
