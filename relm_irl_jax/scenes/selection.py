"""Selection of the training scenes and of the unseen scenes of Task III: built-in rooms or a folder of scene files."""

from collections import defaultdict
from pathlib import Path
from typing import Literal

from pydantic import NonNegativeInt, PositiveInt
from pydantic.dataclasses import dataclass

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.rooms.cache import built_in_room
from relm_irl_jax.scenes.scene import ROOM_TYPES, Scene
from relm_irl_jax.scenes.scene_file import load_scene

ROOMS = "rooms"
"""Value of the setting `scenes` that selects the built-in rooms instead of a folder."""


SHOWN_SIZE = 224
"""Rows and columns of the views of built-in rooms that are shown to people, by default."""


@dataclass(frozen=True)
class SceneSettings:
    """Training scenes, unseen scenes, and the size of the built-in rooms."""

    training_per_type: PositiveInt = 2
    """Training scenes of each room type. In a folder, these are the first ones in the order of file names."""
    training: tuple[str, ...] = ()
    """Names of the training scenes in a folder, instead of the first ones; all other scenes are unseen."""
    unseen_per_type: PositiveInt = 3
    """Unseen scenes of each room type for Task III. In a folder, these follow the training scenes; one is enough."""
    size: Literal["full", "tiny"] = "full"
    """Size of the built-in rooms: the state counts of the original scenes (`full`), or 12 to 20 places (`tiny`)."""
    image_size: PositiveInt | None = None
    """Rows and columns of the views of built-in rooms; by default as many as the encoder takes."""
    first_room: NonNegativeInt = 0
    """Number of the first built-in room of each type; training rooms come first, then unseen rooms."""


def training_scenes(scenes: str, settings: SceneSettings, *, views: bool = True) -> list[Scene]:
    """Load the training scenes, ordered by room type.

    Args:
        scenes: `ROOMS`, or a folder of scene files.
        settings: which scenes.
        views: whether to read the views.

    Returns:
        The scenes.

    Raises:
        InputError: the folder or a file in it cannot be used.
    """
    if scenes == ROOMS:
        return _built_in_rooms(settings.first_room, settings.training_per_type, settings, views=views)
    chosen = [path for training, _ in _scenes_by_type(scenes, settings).values() for path in training]
    return [load_scene(path, views=views) for path in chosen]


def unseen_scenes(scenes: str, settings: SceneSettings, *, views: bool = True) -> list[Scene]:
    """Load the unseen scenes of Task III, ordered by room type.

    Args:
        scenes: `ROOMS`, or a folder of scene files.
        settings: which scenes.
        views: whether to read the views.

    Returns:
        The scenes.

    Raises:
        InputError: the folder or a file in it cannot be used, or the folder contains too few scenes.
    """
    if scenes == ROOMS:
        first = settings.first_room + settings.training_per_type
        return _built_in_rooms(first, settings.unseen_per_type, settings, views=views)
    chosen = []
    for room_type, (training, others) in _scenes_by_type(scenes, settings).items():
        if not others:
            raise InputError(
                f"scenes: all {len(training)} scenes of type {room_type} in {scenes} are training scenes, so that none "
                "is left for Task III; add scenes, or lower scene.training_per_type."
            )
        chosen += others[: settings.unseen_per_type]
    return [load_scene(path, views=views) for path in chosen]


def scene_to_show(scenes: str, settings: SceneSettings, name: str) -> Scene:
    """Load one scene with views as people want to see them.

    Args:
        scenes: `ROOMS`, or a folder of scene files.
        settings: which scenes.
        name: name of one of them.

    Returns:
        The scene with its views.

    Raises:
        InputError: there is no such scene.
    """
    if scenes == ROOMS:
        room_type, number = name.rsplit("-", 1)
        return built_in_room(room_type, int(number), size=settings.size, image_size=settings.image_size or SHOWN_SIZE)
    for path in scene_files(Path(scenes)):
        if load_scene(path, views=False).name == name:
            return load_scene(path)
    raise InputError(f"scenes: {scenes} contains no scene {name} any more; restore its file.")


def check_scenes_setting(scenes: str) -> None:
    """Check that a value is `ROOMS` or a folder of scene files.

    Args:
        scenes: the value.

    Raises:
        InputError: the value is neither.
    """
    if scenes == ROOMS:
        return
    folder = Path(scenes)
    if not folder.is_dir():
        raise InputError(f"scenes: {scenes} is not a folder; give `{ROOMS}` or a folder of HDF5 scene files.")
    if not scene_files(folder):
        raise InputError(f"scenes: {scenes} contains no file ending in .h5 or .hdf5; give a folder of scene files.")


def scene_files(folder: Path) -> list[Path]:
    """List the scene files of a folder, in order of name.

    Args:
        folder: the folder.

    Returns:
        Files ending in `.h5` or `.hdf5`.
    """
    return sorted(path for path in folder.iterdir() if path.suffix in (".h5", ".hdf5"))


def _built_in_rooms(first: int, count: int, settings: SceneSettings, *, views: bool) -> list[Scene]:
    """Load rooms `first` to `first + count - 1` of every type."""
    if settings.training:
        raise InputError("scene.training: names scenes of a folder; leave it out for the built-in rooms.")
    image_size = settings.image_size or SHOWN_SIZE
    return [
        built_in_room(room_type, first + number, size=settings.size, image_size=image_size, views=views)
        for room_type in ROOM_TYPES
        for number in range(count)
    ]


def _scenes_by_type(scenes: str, settings: SceneSettings) -> dict[str, tuple[list[Path], list[Path]]]:
    """Training scenes and all other scenes of a folder, by room type in alphabetical order."""
    check_scenes_setting(scenes)
    by_type = defaultdict(list)
    names = set()
    for path in scene_files(Path(scenes)):
        scene = load_scene(path, views=False)
        by_type[scene.room_type].append((scene.name, path))
        names.add(scene.name)
    if missing := set(settings.training) - names:
        available = ", ".join(sorted(names))
        raise InputError(f"scene.training: {scenes} contains no scene {min(missing)}; it has {available}.")
    split = {}
    for room_type, named_paths in sorted(by_type.items()):
        paths = [path for _, path in named_paths]
        if settings.training:
            training = [path for name, path in named_paths if name in settings.training]
        else:
            training = paths[: settings.training_per_type]
        split[room_type] = training, [path for path in paths if path not in training]
    return split
