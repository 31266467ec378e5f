"""Selection of the training scenes and of the unseen scenes of Task III: built-in rooms or a folder of scene files."""

from collections import defaultdict
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

from relm_irl_jax.errors import InputError
from relm_irl_jax.lazy import deferred
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.settings import ROOM_TYPES, ROOMS, SceneSettings

# Settings are read more often than scenes.
built_in_room = deferred("relm_irl_jax.scenes.rooms.cache", "built_in_room")
load_scene = deferred("relm_irl_jax.scenes.scene_file", "load_scene")
require_views = deferred("relm_irl_jax.scenes.scene_file", "require_views")

SHOWN_SIZE = 224
"""Rows and columns of the views of built-in rooms that are shown to people, by default."""


@runtime_checkable
class SceneLoader(Protocol):
    """Loads one scene. The views of all scenes at once may need more memory than there is."""

    def __call__(self, *, views: bool = True) -> Scene:
        """Load the scene, with or without its views."""
        ...


def loader(scene: Scene) -> SceneLoader:
    """A scene in memory as a function that loads it.

    Args:
        scene: the scene.
    """

    def load(*, views: bool = True) -> Scene:
        return scene if views else scene.without_views()

    return load


def training_scenes(scenes: str, settings: SceneSettings) -> list[SceneLoader]:
    """Choose the training scenes, ordered by room type.

    Args:
        scenes: `ROOMS`, or a folder of scene files.
        settings: which scenes.

    Returns:
        A function for each scene that loads it.

    Raises:
        InputError: the folder or a file in it cannot be used, or a built-in room would be trained and unseen.
    """
    if scenes == ROOMS:
        _first_unseen(settings)  # refused before the training
        return _built_in_rooms(settings.first_room, settings.training_per_type, settings)
    chosen = [path for training, _ in _scenes_by_type(scenes, settings).values() for path in training]
    return [partial(load_scene, path) for path in chosen]


def unseen_scenes(scenes: str, settings: SceneSettings) -> list[SceneLoader]:
    """Choose the unseen scenes of Task III, ordered by room type.

    Args:
        scenes: `ROOMS`, or a folder of scene files.
        settings: which scenes.

    Returns:
        A function for each scene that loads it.

    Raises:
        InputError: the folder or a file in it cannot be used, the folder contains too few scenes, or a built-in room
            would be trained and unseen.
    """
    if scenes == ROOMS:
        return _built_in_rooms(_first_unseen(settings), settings.unseen_per_type, settings)
    chosen = []
    for room_type, (training, others) in _scenes_by_type(scenes, settings).items():
        if not others:
            raise InputError(
                f"scenes: all {len(training)} scenes of type {room_type} in {scenes} are training scenes, so that none "
                "is left for Task III; add scenes, or lower scene.training_per_type."
            )
        chosen += others[: settings.unseen_per_type]
    return [partial(load_scene, path) for path in chosen]


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
    paths = _paths_by_name(tuple(scene_files(Path(scenes))))
    if name not in paths:
        raise InputError(f"scenes: {scenes} contains no scene {name} any more; restore its file.")
    return load_scene(paths[name])


@lru_cache(maxsize=1)
def _paths_by_name(paths: tuple[Path, ...]) -> dict[str, Path]:
    """File of each scene; every file is read once, however many scenes are shown."""
    return {load_scene(path, views=False).name: path for path in paths}


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


def _first_unseen(settings: SceneSettings) -> int:
    """Number of the first unseen built-in room of each type."""
    trained = range(settings.first_room, settings.first_room + settings.training_per_type)
    first = trained.stop if settings.first_unseen is None else settings.first_unseen
    if both := set(trained) & set(range(first, first + settings.unseen_per_type)):
        raise InputError(
            f"scene.first_unseen: room {min(both)} of each type would be trained and unseen, since rooms "
            f"{trained.start} to {trained.stop - 1} are trained; give another number."
        )
    return first


def _built_in_rooms(first: int, count: int, settings: SceneSettings) -> list[SceneLoader]:
    """Rooms `first` to `first + count - 1` of every type."""
    if settings.training:
        raise InputError("scene.training: names scenes of a folder; leave it out for the built-in rooms.")
    image_size = settings.image_size or SHOWN_SIZE
    return [
        partial(built_in_room, room_type, first + number, size=settings.size, image_size=image_size)
        for room_type in ROOM_TYPES
        for number in range(count)
    ]


def _scenes_by_type(scenes: str, settings: SceneSettings) -> dict[str, tuple[list[Path], list[Path]]]:
    """Training scenes and all other scenes of a folder, by room type in alphabetical order."""
    check_scenes_setting(scenes)
    if settings.first_unseen is not None:
        raise InputError("scene.first_unseen: numbers built-in rooms; leave it out for a folder of scenes.")
    by_type = defaultdict(list)
    names: dict[str, Path] = {}
    first: _Features | None = None
    for path in scene_files(Path(scenes)):
        require_views(path)
        scene = load_scene(path, views=False)
        if scene.name in names:
            raise InputError(f"{path}: its scene has the name {scene.name}, as {names[scene.name]}; rename one.")
        features = _features_of(scene)
        first = first or features
        if (fault := _difference(first, features)) is not None:
            raise InputError(f"{path}: {fault}; use scenes whose features are from one encoder.")
        by_type[scene.room_type].append((scene.name, path))
        names[scene.name] = path
    if missing := set(settings.training) - set(names):
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


class _Features(NamedTuple):
    """The kind of a scene's features; `size` is None without features."""

    name: str
    size: int | None
    encoder: str


def _features_of(scene: Scene) -> _Features:
    return _Features(scene.name, None if scene.features is None else scene.features.shape[1], scene.encoder)


def _difference(first: _Features, scene: _Features) -> str | None:
    """What makes the features of two scenes of a folder incomparable; None if they can be used together."""
    if (first.size is None) != (scene.size is None):
        return f"it has {'no ' if scene.size is None else ''}features, unlike {first.name}"
    if first.size is None:
        return None
    if first.size != scene.size:
        return f"its features have {scene.size} numbers, and those of {first.name} {first.size}"
    if first.encoder != scene.encoder:
        return f"its features are from the encoder {scene.encoder!r}, and those of {first.name} from {first.encoder!r}"
    return None
