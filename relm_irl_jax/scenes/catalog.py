"""Which scenes a run uses: the built-in rooms, generated once and kept, or a folder of scene files."""

from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Literal

from platformdirs import user_cache_path
from pydantic import NonNegativeInt, PositiveInt
from pydantic.dataclasses import dataclass

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.dump import load_scene, save_scene
from relm_irl_jax.scenes.rooms import VERSION, generate_room
from relm_irl_jax.scenes.scene import ROOM_TYPES, Scene

ROOMS = "rooms"
"""Name of the built-in source where a folder is expected."""


@dataclass(frozen=True)
class SceneSettings:
    """How many scenes of each room type are trained and kept unseen, and how rooms are generated."""

    training_per_type: PositiveInt = 2
    """Training scenes of each room type; of a folder the first ones in the order of file names, or fewer."""
    training: tuple[str, ...] = ()
    """Names of the training scenes of a folder, instead of the first ones; all others are unseen."""
    unseen_per_type: PositiveInt = 3
    """Scenes of each room type that only Task III sees; of a folder those that follow, at least one."""
    size: Literal["full", "tiny"] = "full"
    """Size of the built-in rooms: the original scenes' state counts, or a dozen places for quick trials."""
    image_size: PositiveInt = 224
    """Rows and columns of a built-in room's views."""
    first_room: NonNegativeInt = 0
    """Number of the first built-in room of each type; training rooms come first, unseen ones follow."""


def cache_folder() -> Path:
    """Folder in which rendered rooms and features are kept between runs.

    Returns:
        The user's cache folder for this project.
    """
    return user_cache_path("relm-irl-jax")


def training_scenes(source: str, settings: SceneSettings) -> list[Scene]:
    """Scenes that training sees, ordered by room type.

    Args:
        source: `ROOMS`, or a folder of scene files.
        settings: how many.

    Returns:
        The scenes with their views.

    Raises:
        InputError: the folder or a file in it cannot be used.
    """
    return _pick(source, settings, trained=True)


def unseen_scenes(source: str, settings: SceneSettings) -> list[Scene]:
    """Scenes that only Task III sees, ordered by room type.

    Args:
        source: `ROOMS`, or a folder of scene files.
        settings: how many.

    Returns:
        The scenes with their views.

    Raises:
        InputError: the folder or a file in it cannot be used, or holds too few scenes.
    """
    return _pick(source, settings, trained=False)


def check_source(source: str) -> None:
    """Refuse a source that is neither the built-in rooms nor a folder of scene files.

    Args:
        source: `ROOMS`, or a folder.

    Raises:
        InputError: says what was found instead.
    """
    if source == ROOMS:
        return
    folder = Path(source)
    if not folder.is_dir():
        raise InputError(f"scenes: {source} is no folder; give `{ROOMS}` or a folder of HDF5 scene files.")
    if not scene_files(folder):
        raise InputError(f"scenes: {source} holds no file ending in .h5 or .hdf5; give a folder of scene files.")


def scene_files(folder: Path) -> list[Path]:
    """Scene files of a folder, in order of name.

    Args:
        folder: where to look.

    Returns:
        Files ending in `.h5` or `.hdf5`.
    """
    return sorted(path for path in folder.iterdir() if path.suffix in (".h5", ".hdf5"))


def _pick(source: str, settings: SceneSettings, *, trained: bool) -> list[Scene]:
    """Take the training scenes of each room type, or as many unseen ones after them."""
    check_source(source)
    skip, count = settings.training_per_type, settings.unseen_per_type
    if source == ROOMS:
        if settings.training:
            raise InputError("scene.training: names scenes of a folder; leave it out for the built-in rooms.")
        first, count = (settings.first_room, skip) if trained else (settings.first_room + skip, count)
        return [
            built_in_room(room_type, first + number, settings) for room_type in ROOM_TYPES for number in range(count)
        ]
    by_type = defaultdict(list)
    names = set()
    for path in scene_files(Path(source)):
        scene = load_scene(path, frames=False)
        by_type[scene.room_type].append((scene.name, path))
        names.add(scene.name)
    if missing := set(settings.training) - names:
        raise InputError(f"scene.training: {source} holds no scene {min(missing)}; it has {', '.join(sorted(names))}.")
    chosen = []
    for room_type, scenes in sorted(by_type.items()):
        named = [path for name, path in scenes if name in settings.training]
        training = named if settings.training else [path for _, path in scenes[:skip]]
        unseen = [path for _, path in scenes if path not in training][:count]
        if not unseen and not trained:
            raise InputError(
                f"scenes: all {len(scenes)} scenes of type {room_type} in {source} are trained, none is left for Task "
                "III; add scenes, or lower scene.training_per_type."
            )
        chosen += training if trained else unseen
    return [load_scene(path) for path in chosen]


def built_in_room(room_type: str, number: int, settings: SceneSettings) -> Scene:
    """Read a built-in room from the cache, or generate and keep it.

    Args:
        room_type: one of `ROOM_TYPES`.
        number: the room's number.
        settings: size of the room and of its views.

    Returns:
        The room with its views.
    """
    folder = cache_folder() / f"rooms-{VERSION}-{settings.size}-{settings.image_size}"
    path = folder / f"{room_type}-{number}.h5"
    if path.exists():
        try:
            return load_scene(path)
        except InputError:
            path.unlink()
    scene = generate_room(room_type, number, size=settings.size, image_size=settings.image_size)
    save_scene(scene, path)
    return scene


def without_views(scene: Scene) -> Scene:
    """The scene without its views, once they are encoded.

    Args:
        scene: a scene.

    Returns:
        The same scene with `observation` None.
    """
    return replace(scene, observation=None)
