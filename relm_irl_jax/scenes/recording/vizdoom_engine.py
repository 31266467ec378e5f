"""Start of ViZDoom: the package, its WAD files and the engine's options."""

import re
import struct
from contextlib import chdir
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

from relm_irl_jax.errors import InputError
from relm_irl_jax.inputs import refuse_device

RESOLUTIONS = ((160, 120), (320, 240), (640, 480), (1600, 1200))
"""Columns and rows of the engine's frames, all 4:3."""


def vizdoom_package() -> ModuleType:
    """Import `vizdoom`.

    Raises:
        InputError: it is not installed.
    """
    try:
        return import_module("vizdoom")
    except ImportError as error:
        raise InputError(
            "ViZDoom is not installed; run: pip install 'relm-irl-jax[vizdoom]' (or pip install vizdoom)."
        ) from error


def find_wad(vizdoom: ModuleType, map_name: str, wad: Path | None) -> Path:
    """Find the WAD file that contains a map.

    Args:
        vizdoom: the package.
        map_name: for example `map01` or `e1m1`.
        wad: the file; by default one of Freedoom's from the package.

    Returns:
        The file.

    Raises:
        InputError: the file cannot be read or does not contain the map.
    """
    if wad is None:
        part = "freedoom1.wad" if re.fullmatch(r"e\dm\d", map_name.lower()) else "freedoom2.wad"
        wad = Path(vizdoom.__file__ or "").parent / part
    maps = _map_names(wad)
    if map_name.upper() not in maps:
        raise InputError(f"{wad.name}: contains no map {map_name}; it has {', '.join(maps).lower()}.")
    return wad


def _map_names(wad: Path) -> list[str]:
    """Names of the maps in a WAD file: the entries of its directory before an entry `THINGS`."""
    refuse_device(wad)
    try:
        content = wad.read_bytes()
        kind, count, offset = struct.unpack_from("<4sii", content)
        if kind not in (b"IWAD", b"PWAD"):
            raise InputError(f"{wad}: is not a WAD file; give another, or leave out `--wad` for Freedoom's maps.")
        names = [
            struct.unpack_from("<8s", content, offset + 16 * entry + 8)[0].rstrip(b"\0").decode("ascii", "replace")
            for entry in range(count)
        ]
    except (OSError, struct.error) as error:
        raise InputError(f"{wad}: cannot be read as a WAD file ({error}); give another.") from error
    return [name for name, following in pairwise(names) if following == "THINGS"]


def start_engine(vizdoom: ModuleType, map_name: str, wad: Path, resolution: tuple[int, int], folder: Path) -> Any:
    """Start the engine without window, sound, weapon, messages and monsters.

    Args:
        vizdoom: the package.
        map_name: the map.
        wad: the WAD file of the map.
        resolution: columns and rows of a frame, one of `RESOLUTIONS`.
        folder: folder for the files that the engine writes.

    Returns:
        The running `vizdoom.DoomGame`.
    """
    game = vizdoom.DoomGame()
    game.set_doom_game_path(str(wad.resolve()))
    game.set_doom_config_path(str(folder / "vizdoom.ini"))
    game.set_doom_map(map_name.lower())
    game.set_seed(0)
    game.set_doom_skill(3)
    game.set_window_visible(False)
    game.set_sound_enabled(False)
    game.set_screen_format(vizdoom.ScreenFormat.RGB24)
    game.set_screen_resolution(getattr(vizdoom.ScreenResolution, "RES_{}X{}".format(*resolution)))
    for part in ("hud", "crosshair", "weapon", "decals", "particles", "messages", "effects_sprites", "screen_flashes"):
        getattr(game, f"set_render_{part}")(False)
    game.set_labels_buffer_enabled(True)
    game.set_objects_info_enabled(True)
    game.set_sectors_info_enabled(True)
    button = vizdoom.Button
    game.set_available_buttons([button.MOVE_FORWARD_BACKWARD_DELTA, button.TURN_LEFT_RIGHT_DELTA])
    game.set_mode(vizdoom.Mode.PLAYER)
    game.set_episode_timeout(0)
    game.add_game_args("-nomonsters +sv_cheats 1 +cl_showsecretmessage 0")
    with chdir(folder):  # the engine creates a folder in the working directory
        game.init()
    return game
