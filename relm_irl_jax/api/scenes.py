"""Scenes to train and evaluate in."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from relm_irl_jax.config import Config, overlay
from relm_irl_jax.errors import InputError
from relm_irl_jax.features.settings import SMALL_IMAGE_SIZE, settings_for
from relm_irl_jax.scenes.rooms.cache import built_in_room
from relm_irl_jax.scenes.rooms.room_specifications import SOURCE
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.scene_file import load_scene
from relm_irl_jax.scenes.selection import check_scenes_setting, scene_files, training_scenes
from relm_irl_jax.scenes.settings import ROOM_TYPES, ROOMS

Scenes = Sequence[Scene] | str | Path
"""Scenes; or `rooms` for the built-in training rooms; or a folder of scene files, whose first ones are for training."""

DEFAULT = Config(agent="siamese")


def rooms(*names: str, size: Literal["full", "tiny"] = "full", image_size: int = SMALL_IMAGE_SIZE) -> list[Scene]:
    """Built-in rooms; each is generated once and then read from the user's cache folder.

    Args:
        names: `bathroom-N`, `bedroom-N` or `living_room-N`, with any number N; none for the six training rooms.
        size: the original scenes' state counts (full), or 12 to 20 places (tiny).
        image_size: rows and columns of a view; by default as many as the default encoder takes.

    Returns:
        The scenes, with views.

    Raises:
        InputError: a name is not one of a room.
    """
    if not names:
        settings = replace(DEFAULT.scene, size=size, image_size=image_size)
        return [load() for load in training_scenes(ROOMS, settings)]
    parts = [name.rpartition("-") for name in names]
    for name, (room_type, _, number) in zip(names, parts, strict=True):
        if room_type not in ROOM_TYPES or not number.isdecimal():
            raise InputError(f"rooms: {name!r} is no built-in room; give a name such as {ROOM_TYPES[0]}-0.")
    return [built_in_room(kind, int(number), size=size, image_size=image_size) for kind, _, number in parts]


def load_scenes(folder: str | Path) -> list[Scene]:
    """Load all scene files of a folder.

    Args:
        folder: a folder of HDF5 files in the THOR v1 format.

    Returns:
        The scenes, in the order of file names.

    Raises:
        InputError: the folder or a file in it cannot be used.
    """
    check_scenes_setting(str(folder))
    return [load_scene(path) for path in scene_files(Path(folder))]


def config_of(scenes: Scenes, config: Config | None, targets: int | None = None) -> Config:
    """The settings for given scenes.

    Args:
        scenes: the scenes.
        config: all other settings; None for the default ones. The default encoder of listed built-in rooms is that of
            `rooms`.
        targets: number of training targets. None for the configuration's; for a list of scenes and default settings, as
            many for a scene as the default has, 20 in six scenes.

    Returns:
        The configuration.

    Raises:
        InputError: a value is refused.
    """
    listed = not isinstance(scenes, str | Path)
    if listed and not scenes:
        raise InputError("scenes: the list is empty; give at least one scene.")
    if targets is None and listed and config is None:
        targets = max(1, round(DEFAULT.tasks.training_targets * len(scenes) / DEFAULT.scene.training_rooms))
    changes: dict = {"scenes": "a list" if listed else str(scenes)}
    if listed and all(scene.source == SOURCE and scene.features is None for scene in scenes):
        changes["encoder"] = {"weights": settings_for((config or DEFAULT).encoder, built_in=True).weights}
    if targets is not None:
        changes["tasks"] = {"training_targets": targets}
    return overlay(config or DEFAULT, changes, "relm_irl_jax")
