"""Walking by keyboard: the keys' actions, how a walk ends, and the command in a pseudo-terminal."""

import dataclasses
import fcntl
import io
import os
import pty
import struct
import sys
import termios
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from builders import grid_scene
from rich.console import Console

from relm_irl_jax.config import Config
from relm_irl_jax.demonstrations import load_demonstrations
from relm_irl_jax.errors import InputError
from relm_irl_jax.play import keyboard
from relm_irl_jax.play.keyboard import (
    draw_episode,
    half_blocks,
    play_in_terminal,
    scene_and_targets,
    split_keys,
    steps_by_keys,
)
from relm_irl_jax.play.recording import record_walk

UP, RIGHT, DOWN = "\x1b[A", "\x1b[C", "\x1b[B"


def walk(keys, target):
    """In a corridor of three places along x, from the first, which faces +z."""
    scene, shown = grid_scene(3, 1), []
    return steps_by_keys(scene, 0, target, keys, lambda *seen: shown.append(seen)), shown


def test_a_walk_by_hand():
    """Ahead is a wall; then a turn to +x, and two steps to the last place."""
    found, shown = walk([UP, "x", RIGHT, "w", UP, DOWN], target=9)
    assert found.states.tolist() == [0, 0, 1, 5, 9]
    assert (found.success, found.shortest) == (True, 3)
    assert shown == [(0, 0, False), (0, 1, True), (1, 2, False), (5, 3, False), (9, 4, False)]


@pytest.mark.parametrize("keys", [["d", "q", "w"], ["d"]])
def test_a_walk_that_is_given_up(keys):
    ended, _ = walk(keys, target=9)
    assert ended.states.tolist() == [0, 1]
    assert not ended.success


def test_keys_that_are_read_at_once():
    assert split_keys("w\x1b[A\x1bOCq") == ["w", UP, RIGHT, "q"]


def test_starts_reach_their_targets():
    scene = grid_scene(2, 2)
    drawn = {draw_episode(scene, [3, 7], 0, episode) for episode in range(30)}
    assert {target for _, target in drawn} == {3, 7}
    assert all(scene.shortest_path_distance[start, target] > 0 for start, target in drawn)
    assert draw_episode(scene, [3, 7], 0, 0) == draw_episode(scene, [3, 7], 0, 0)


def test_two_pixels_a_character():
    picture = np.zeros((4, 4, 3), np.uint8)
    picture[:2] = (255, 0, 0)
    text = half_blocks(picture, 2)
    assert text.plain == "▀▀"
    console = Console(color_system="truecolor", force_terminal=True, width=10)
    with console.capture() as captured:
        console.print(text)
    assert "38;2;255;0;0;48;2;0;0;0" in captured.get()


def test_without_a_terminal_there_is_one_sentence():
    with pytest.raises(InputError, match="must be a terminal"):
        play_in_terminal(grid_scene(2, 2), 0, 3, Console(force_terminal=False))


def test_a_walk_is_recorded_if_it_arrives(tmp_path):
    scene, file = grid_scene(3, 1), tmp_path / "walks.jsonl"
    assert "nothing was recorded" in record_walk(scene, walk(["d", "q"], target=9)[0], file)
    assert not file.exists()
    arrived, _ = walk([UP, RIGHT, "w", UP], target=9)
    assert record_walk(scene, arrived, file) == f"{file}: 1 demonstration"
    file.write_text(file.read_text().rstrip())  # as an editor may leave it
    assert record_walk(scene, arrived, file) == f"{file}: 2 demonstrations"
    for read in load_demonstrations(file, scene):
        assert (read.states.tolist(), read.actions.tolist()) == ([0, 0, 1, 5, 9], [0, 1, 0, 0])


def test_walks_are_not_added_to_another_file(tmp_path):
    (tmp_path / "notes.txt").write_text("not a demonstration")
    with pytest.raises(InputError, match="not a JSON object"):
        record_walk(grid_scene(3, 1), walk(["d", "w", "w"], target=9)[0], tmp_path / "notes.txt")
    assert (tmp_path / "notes.txt").read_text() == "not a demonstration"


def test_a_room_of_no_run():
    with pytest.raises(InputError, match="neither a scene file nor a built-in room"):
        scene_and_targets("attic-0", None)


def test_a_task_of_a_run(monkeypatch):
    scenes = [grid_scene(3, 3, name="bathroom-0"), grid_scene(3, 3, name="bedroom-0")]
    split = SimpleNamespace(of_task=lambda task, settings: [SimpleNamespace(scene=1, state=7)])
    monkeypatch.setattr(
        keyboard, "training_scenes", lambda *_: [lambda views=True, scene=scene: scene for scene in scenes]
    )
    monkeypatch.setattr(keyboard, "scene_to_show", lambda _, __, name: next(s for s in scenes if s.name == name))
    monkeypatch.setattr(keyboard, "draw_split", lambda *_: split)
    scene, targets = keyboard.scene_and_targets_of_run(Config(), "I", 0, None)
    assert (scene.name, targets) == ("bedroom-0", [7])
    with pytest.raises(InputError, match="no targets in bathroom-0; give one of bedroom-0"):
        keyboard.scene_and_targets_of_run(Config(), "I", 0, "bathroom-0")


def test_in_a_pseudo_terminal(monkeypatch):
    """Keys go in one by one; the views come out, and the terminal is as it was."""
    primary, secondary = pty.openpty()
    fcntl.ioctl(secondary, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
    before = termios.tcgetattr(secondary)
    printed = b""

    def press_keys() -> None:
        nonlocal printed
        for steps, key in enumerate((RIGHT, UP, UP)):
            while f"steps {steps}".encode() not in printed:
                printed += os.read(primary, 65536)
            os.write(primary, key.encode())
        while b"?1049l" not in printed:  # the screen of before is back
            printed += os.read(primary, 65536)

    walker = threading.Thread(target=press_keys)
    with open(secondary, "r+b", buffering=0) as raw, io.TextIOWrapper(raw, write_through=True) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        scene = dataclasses.replace(grid_scene(3, 1), observation=np.full((12, 8, 8, 3), 200, np.uint8))
        walker.start()
        console = Console(file=terminal, color_system="truecolor", width=100, height=30)
        assert play_in_terminal(scene, 0, 9, console).states.tolist() == [0, 1, 5, 9]
        walker.join(60)
        assert not walker.is_alive()
        assert termios.tcgetattr(secondary) == before
    os.close(primary)
    assert "▀".encode() in printed
    assert b"38;2;200;200;200" in printed
