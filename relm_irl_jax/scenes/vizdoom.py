"""Scenes from ViZDoom: a real engine and human-made maps, headless and offline.

The wheel of `vizdoom` holds the Freedoom maps, `map01` to `map32` and `e1m1` to `e4m9`; none is shipped here.

- **Scale.** `map_units` map units, 32 by default, count as 0.5 m. The player is 32 units wide and 56 tall, so
  neighbouring places do not overlap. The map's x is the scene's x, its y the scene's z; the player's start is a place.
- **Moves** are the engine's own: the player is warped to a place, walks ahead, and has moved if it gets as far as the
  next place. Solid objects, walls, steps higher than 24 units and closed doors are therefore collisions. States are the
  places that can be walked to from the start and back, nearest first, up to a limit; drops bound the region. It starts
  where the player does, or, with `start = "objects"`, beside the object with the most kinds of others around it.
- **Views** are the centre square of a frame of 4:3, cut out pixel by pixel and never resampled, with the lens widened
  so that the square sees 90 degrees, as in the built-in rooms. Weapon, messages, HUD, flashes and monsters are off.
- **Each place begins in a fresh episode**, once for its views and once for its moves, which therefore do not depend on
  other places: items that a walk picks up lie there again, lights flicker in the same phase, and a record that was cut
  off goes on to the same file.
- **Objects** are the engine's labels: decorations and items by name, with the share of the view that they cover.
"""

import math
import re
import struct
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, chdir, contextmanager
from functools import cache, lru_cache, partial
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
from pydantic import Field, PositiveInt
from pydantic.dataclasses import dataclass

from relm_irl_jax.errors import InputError
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.scenes.dump import NAME_PATTERN
from relm_irl_jax.scenes.scene import GRID_STEP, HEADINGS
from relm_irl_jax.scenes.source import AHEAD, BACK, Pose, Source, View, stepped

SETTLING_TICS = 10
"""Tics until the player obeys after an episode begins and eye height and lens have settled after a warp."""

STOPPING_TICS = 64
"""Tics in which friction stops a running player."""

EYE_HEIGHT = 41.0
"""The player's eyes above its feet, in map units."""

THRUST, FRICTION = 1.5625, 0.90625
"""Map units a tic by which running speeds the player up, and what friction leaves of its speed."""

SLACK = 1.0
"""Map units by which a walk may end short of the next place or beside the straight line."""

NO_OBJECTS = ("Self", "Player", "Internal", "MapSpot", "SFX", "ScriptThing", "DynamicLight", "Token")
"""Categories of labels that name nothing a person would see or look for."""

MOST_STARTS = 8
"""Places that are tried where a region shall begin among objects; the first whose region is full is taken."""


@dataclass(frozen=True)
class VizdoomSettings:
    """What is recorded of a map."""

    states: int = Field(default=600, ge=8)
    """Most states of a scene, four a place; the original scenes have 180 to 900."""
    map_units: PositiveInt = 32
    """Map units that count as one step of 0.5 m."""
    image_size: int = Field(default=224, ge=8, le=1200)
    """Rows and columns of a view."""
    start: Literal["player", "objects"] = "player"
    """Begin where the player does, or where the most kinds of objects are near each other."""
    room_type: str = Field(default="doom", pattern=f"^{NAME_PATTERN}$")
    """Room type of the scenes: training has one head for each, and Task III seeks what was trained in its own."""
    wad: Path | None = None
    """WAD file with the maps; by default Freedoom's, from the wheel."""


def vizdoom_maps(
    names: Sequence[str], settings: VizdoomSettings
) -> dict[str, Callable[[], AbstractContextManager[Source]]]:
    """What opens each of several maps; refuses before anything runs if one is missing.

    Args:
        names: the maps.
        settings: what is recorded.

    Returns:
        For each map a function that opens it.

    Raises:
        InputError: ViZDoom is not installed, or there is no such map.
    """
    vizdoom = _engine_package()
    for name in names:
        _wad_with(vizdoom, name, settings.wad)
    return {name.lower(): partial(vizdoom_map, name, settings) for name in names}


@contextmanager
def vizdoom_map(name: str, settings: VizdoomSettings) -> Iterator[Source]:
    """Open a map.

    Args:
        name: the map, for example `map01`, or `e1m1` for the maps of Freedoom's first part.
        settings: what is recorded.

    Yields:
        The map as a source; the engine runs until the block ends.

    Raises:
        InputError: ViZDoom is not installed, or there is no such map.
    """
    vizdoom = _engine_package()
    wad = _wad_with(vizdoom, name, settings.wad)
    with tempfile.TemporaryDirectory() as folder:
        game, resolution = _start(vizdoom, name, wad, settings.image_size, Path(folder))
        try:
            walker = _Walker(vizdoom, game, resolution, settings)
            poses = _states(walker, name, settings)
            origin = (
                f"vizdoom/{vizdoom.__version__} {wad.name} {name} from {settings.start}, "
                f"{settings.map_units} units a step, {settings.image_size} pixels"
            )
            yield Source(name.lower(), settings.room_type, origin, poses, walker.move, walker.view)
        finally:
            game.close()


class _Walker:
    """The player of a running engine, sent to places, moved and asked what it sees."""

    def __init__(self, vizdoom: ModuleType, game: Any, resolution: tuple[int, int], settings: VizdoomSettings):
        self._variables = vizdoom.GameVariable
        self._game = game
        self._settings = settings
        width, height = resolution
        size = settings.image_size
        self._rows = slice((height - size) // 2, (height - size) // 2 + size)
        self._columns = slice((width - size) // 2, (width - size) // 2 + size)
        self._lens = round(2 * math.degrees(math.atan(width / size)))  # the engine takes whole degrees
        self._units = settings.map_units / GRID_STEP
        self._tics = _walking_tics(settings.map_units)
        self.start = self._pose()
        self._walks = cache(self._walks_around)
        self._views = lru_cache(maxsize=1)(self._views_around)

    def starts(self, places: int) -> list[Pose]:
        """Places of the player's grid nearest to objects, those with the most kinds of objects around them first.

        Around means half as far as a square of so many places is wide.
        """
        self._game.new_episode()
        objects = [item for item in self._game.get_state().objects if item.category not in NO_OBJECTS]
        where = np.asarray([(item.position_x, item.position_y) for item in objects]).reshape(-1, 2) / self._units
        is_near = np.abs(where[:, None] - where).max(-1) <= GRID_STEP * math.sqrt(places) / 2
        kinds = [len({objects[other].name for other in np.flatnonzero(near)}) for near in is_near]
        starts = []
        for number in np.argsort(kinds, kind="stable")[::-1]:
            x, z = (
                origin + GRID_STEP * round((value - origin) / GRID_STEP)
                for value, origin in zip(where[number], self.start, strict=False)
            )
            starts.append(Pose(float(x), float(z), HEADINGS[0]))
        return [*list(dict.fromkeys(starts))[:MOST_STARTS], self.start]

    def move(self, pose: Pose, action: str) -> Pose | None:
        """Where an action leads; backwards is ahead the other way round, the player being as wide as deep."""
        if action not in (AHEAD, BACK):
            return stepped(pose, action)
        direction = (pose.rotation + (0 if action == AHEAD else 180)) % 360
        return stepped(pose, action) if self._walks(pose.x, pose.z)[HEADINGS.index(direction)] else None

    def view(self, pose: Pose) -> View | None:
        """What the player sees; None where it does not fit or is not at rest."""
        return self._views(pose.x, pose.z)[HEADINGS.index(pose.rotation)]

    def _walks_around(self, x: float, z: float) -> tuple[bool, ...]:
        """Whether the player gets from a place to the next one, for each heading."""
        self._game.new_episode()
        return tuple(self._walks_ahead(Pose(x, z, heading)) for heading in HEADINGS)

    def _walks_ahead(self, pose: Pose) -> bool:
        self._advance([0, 0], STOPPING_TICS, report=False)  # a warp does not take speed away
        self._warp(pose)
        self._turn(pose)
        if not self._at_rest():
            return False
        self._advance([50, 0], self._tics)
        if self._game.is_episode_finished():  # a walk through the exit
            self._game.new_episode()
            return False
        there, onward = self._pose(), stepped(pose, AHEAD)
        along, aside = (there.z - onward.z, there.x - onward.x)
        if pose.rotation in (90, 270):
            along, aside = aside, along
        if pose.rotation in (180, 270):
            along = -along
        too_far = _walked(self._tics) - self._settings.map_units + SLACK
        return -SLACK <= along * self._units <= too_far and abs(aside) * self._units <= SLACK

    def _views_around(self, x: float, z: float) -> tuple[View | None, ...]:
        """What the player sees from a place, for each heading."""
        self._game.new_episode()
        self._warp(Pose(x, z, HEADINGS[0]))
        return tuple(self._view_ahead(Pose(x, z, heading)) for heading in HEADINGS)

    def _view_ahead(self, pose: Pose) -> View | None:
        self._turn(pose)
        if not self._at_rest():
            return None
        state = self._game.get_state()
        labels = state.labels_buffer[self._rows, self._columns]
        share = np.bincount(labels.ravel(), minlength=256) / labels.size
        visible: dict[str, float] = {}
        for label in state.labels:
            if share[label.value] > 0 and label.object_category not in NO_OBJECTS:
                visible[label.object_name] = visible.get(label.object_name, 0.0) + float(share[label.value])
        return View(self._pose(), state.screen_buffer[self._rows, self._columns].copy(), visible)

    def _warp(self, pose: Pose) -> None:
        self._game.send_game_command(f"warp {pose.x * self._units:.6f} {pose.z * self._units:.6f}")
        self._game.send_game_command(f"fov {self._lens}")
        self._advance([0, 0], SETTLING_TICS, report=False)

    def _turn(self, pose: Pose) -> None:
        self._advance([0, pose.rotation - self._pose().rotation], 1, report=False)
        self._advance([0, 0], 1)

    def _advance(self, action: list[float], tics: int, *, report: bool = True) -> None:
        """Let time pass; without a report, which takes as long as many tics, pose and picture stay those before."""
        self._game.set_action(action)
        self._game.advance_action(tics, report)

    def _at_rest(self) -> bool:
        """Whether eye height and lens have settled; a player that did not fit where it was sent hangs elsewhere."""
        eyes = self._value("CAMERA_POSITION_Z") - self._value("POSITION_Z")
        lens = self._value("CAMERA_FOV")
        return abs(eyes - EYE_HEIGHT) < 0.1 and abs(lens - self._lens) < 0.1

    def _pose(self) -> Pose:
        """The player's pose as the engine reports it; its angles grow anticlockwise from +x."""
        x, y = self._value("POSITION_X"), self._value("POSITION_Y")
        return Pose(x / self._units, y / self._units, (90 - self._value("ANGLE")) % 360)

    def _value(self, name: str) -> float:
        return self._game.get_game_variable(getattr(self._variables, name))


def _states(walker: _Walker, name: str, settings: VizdoomSettings) -> list[Pose]:
    """Poses of the region that is recorded: four headings at each of its places."""
    most = settings.states // 4
    region: list[Pose] = []
    with progress_bar(f"walking {name.lower()}", most, "places") as advance:
        for start in walker.starts(most) if settings.start == "objects" else [walker.start]:
            found: list[Pose] = []
            for place in _region(walker, start, most):
                found.append(place)
                if len(found) > len(region):
                    advance(1)
            region = max(region, found, key=len)
            if len(region) == most:
                break
    return [place._replace(rotation=heading) for place in region for heading in HEADINGS]


def _region(walker: _Walker, start: Pose, most: int) -> Iterator[Pose]:
    """Places that can be walked to from the start and back, nearest first, as they are found."""

    def place(offset: tuple[int, int], heading: float = HEADINGS[0]) -> Pose:
        # From the start, not from a neighbour: rounding would tell one place's poses apart.
        return Pose(start.x + GRID_STEP * offset[0], start.z + GRID_STEP * offset[1], heading)

    offsets = [(0, 0)]
    found = {(0, 0)}
    yield place((0, 0))
    for column, row in offsets:  # grows as places are found
        for heading, (dx, dz) in zip(HEADINGS, ((0, 1), (1, 0), (0, -1), (-1, 0)), strict=True):
            onward = (column + dx, row + dz)
            if len(offsets) == most or onward in found:
                continue
            there = walker.move(place((column, row), heading), AHEAD)
            if there is not None and walker.move(place(onward, heading), BACK) is not None:
                found.add(onward)
                offsets.append(onward)
                yield place(onward)


def _walked(tics: int) -> float:
    """Map units that the player runs in so many tics from rest."""
    speed = distance = 0.0
    for _ in range(tics):
        speed += THRUST
        distance += speed
        speed *= FRICTION
    return distance


def _walking_tics(map_units: int) -> int:
    """Least number of tics in which the player runs so far."""
    return next(tics for tics in range(1, 10_000) if _walked(tics) >= map_units)


def _engine_package() -> ModuleType:
    try:
        return import_module("vizdoom")
    except ImportError as error:
        raise InputError(
            "ViZDoom is not installed; run: pip install 'relm-irl-jax[vizdoom]' (or pip install vizdoom)."
        ) from error


def _wad_with(vizdoom: ModuleType, name: str, given: Path | None) -> Path:
    """The WAD file that holds a map."""
    folder = Path(vizdoom.__file__ or "").parent
    part = "freedoom1.wad" if re.fullmatch(r"e\dm\d", name.lower()) else "freedoom2.wad"
    wad = folder / part if given is None else given
    maps = _maps(wad)
    if name.upper() not in maps:
        raise InputError(f"{wad.name}: holds no map {name}; it has {', '.join(maps).lower()}.")
    return wad


def _maps(wad: Path) -> list[str]:
    """Names of the maps in a WAD file: the entries of its directory that `THINGS` follows."""
    try:
        content = wad.read_bytes()
        kind, count, offset = struct.unpack_from("<4sii", content)
        if kind not in (b"IWAD", b"PWAD"):
            raise InputError(f"{wad}: is no WAD file; give one, or leave `--wad` out for Freedoom's maps.")
        names = [
            struct.unpack_from("<8s", content, offset + 16 * entry + 8)[0].rstrip(b"\0").decode("ascii", "replace")
            for entry in range(count)
        ]
    except (OSError, struct.error) as error:
        raise InputError(f"{wad}: cannot be read as a WAD file ({error}); give another.") from error
    return [name for name, after in pairwise(names) if after == "THINGS"]


def _start(vizdoom: ModuleType, name: str, wad: Path, size: int, folder: Path) -> tuple[Any, tuple[int, int]]:
    """Start the engine without window, sound, weapon, messages and monsters."""
    resolution = next((w, h) for w, h in ((160, 120), (320, 240), (640, 480), (1600, 1200)) if h >= size)
    game = vizdoom.DoomGame()
    game.set_doom_game_path(str(wad.resolve()))
    game.set_doom_config_path(str(folder / "vizdoom.ini"))
    game.set_doom_map(name.lower())
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
    button = vizdoom.Button
    game.set_available_buttons([button.MOVE_FORWARD_BACKWARD_DELTA, button.TURN_LEFT_RIGHT_DELTA])
    game.set_mode(vizdoom.Mode.PLAYER)
    game.set_episode_timeout(0)
    game.add_game_args("-nomonsters +sv_cheats 1")
    with chdir(folder):  # where the engine starts, it leaves a folder
        game.init()
    return game, resolution
