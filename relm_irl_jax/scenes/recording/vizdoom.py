"""Scenes of ViZDoom, a game engine with human-made maps; it runs without window and network.

The wheel of `vizdoom` contains the Freedoom maps, `map01` to `map32` and `e1m1` to `e4m9`.

- **Scale.** `map_units` map units, 32 by default, are 0.5 m. The player is 32 units wide and 56 tall, so neighbouring
  places do not overlap. The map's x is the scene's x, its y the scene's z; the player's start is a place.
- **Moves** are tried in the engine: the player is warped to a place and runs ahead; the move succeeds if it reaches the
  next place. Solid objects, walls, steps higher than 24 units and closed doors are therefore collisions. States are the
  places that can be reached from the start and back, nearest first, up to a limit; drops bound the region. The start is
  the player's start, or, with `start = "objects"`, a place near the object that is surrounded by the most kinds of
  objects.
- **Views** are the centre square of a 4:3 frame, cropped and never resampled. The field of view of the square is 90
  degrees, as in the built-in rooms. Weapon, messages, HUD, flashes and monsters are off.
- **Episodes.** The results do not depend on other places, and an interrupted recording gives the same file. The engine
  starts a new episode after a move that opened a door or moved a floor; items that moves pick up stop nobody. Views are
  taken in an episode without moves, in which each place has its own time: all items are there, and lights flicker from
  place to place.
- **Objects** are the engine's labels: decorations and items by name, with the share of the view that they cover.
"""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from relm_irl_jax.lazy import deferred
from relm_irl_jax.scenes.recording.settings import VizdoomSettings
from relm_irl_jax.scenes.recording.simulator import AHEAD, BACK, Pose, SceneOpener, SimulatorScene
from relm_irl_jax.scenes.recording.vizdoom_engine import RESOLUTIONS, find_wad, start_engine, vizdoom_package
from relm_irl_jax.scenes.recording.vizdoom_player import Player
from relm_irl_jax.scenes.scene import GRID_STEP, HEADINGS

# Settings are read more often than maps.
progress_bar = deferred("relm_irl_jax.progress", "progress_bar")


def vizdoom_maps(names: Sequence[str], settings: VizdoomSettings) -> dict[str, SceneOpener]:
    """Prepare the recording of several maps; nothing is started if one of them is missing.

    Args:
        names: the maps.
        settings: states and views.

    Returns:
        For each map a function that starts the engine in it.

    Raises:
        InputError: ViZDoom is not installed, or there is no such map.
    """
    vizdoom = vizdoom_package()
    for name in names:
        find_wad(vizdoom, name, settings.wad)
    return {name.lower(): partial(vizdoom_map, name, settings) for name in names}


@contextmanager
def vizdoom_map(name: str, settings: VizdoomSettings) -> Iterator[SimulatorScene]:
    """Start the engine in a map.

    Args:
        name: the map, for example `map01`, or `e1m1` for the maps of Freedoom's first part.
        settings: states and views.

    Yields:
        The scene; the engine runs until the context ends.

    Raises:
        InputError: ViZDoom is not installed, or there is no such map.
    """
    vizdoom = vizdoom_package()
    wad = find_wad(vizdoom, name, settings.wad)
    size, units = settings.image_size, settings.map_units
    resolution = next((width, height) for width, height in RESOLUTIONS if height >= size)
    with tempfile.TemporaryDirectory() as folder:
        game = start_engine(vizdoom, name, wad, resolution, Path(folder))
        try:
            player = Player(vizdoom, game, resolution, image_size=size, map_units=units)
            poses = _find_poses(player, name, settings)
            source = (
                f"vizdoom/{vizdoom.__version__} {wad.name} {name} from {settings.start}, "
                f"{units} units a step, {size} pixels, no messages"
            )
            yield SimulatorScene(name.lower(), settings.room_type, source, poses, player.move, player.view)
        finally:
            game.close()


def _find_poses(player: Player, name: str, settings: VizdoomSettings) -> list[Pose]:
    """Poses of the recorded region, four at each place; the first region of full size, or else the largest."""
    max_places = settings.states // 4
    starts = player.starts_near_objects(max_places) if settings.start == "objects" else [player.start]
    region: list[Pose] = []
    with progress_bar(f"exploring {name.lower()}", max_places, "places") as advance:
        for start in starts:
            places: list[Pose] = []
            for place in reachable_places(player.move, start, max_places):
                places.append(place)
                if len(places) > len(region):
                    advance(1)
            region = max(region, places, key=len)
            if len(region) == max_places:
                break
    player.arrange_views(region)
    return [place._replace(rotation=heading) for place in region for heading in HEADINGS]


def reachable_places(move: Callable[[Pose, str], Pose | None], start: Pose, max_places: int) -> Iterator[Pose]:
    """Search breadth-first for places that can be reached from the start and back.

    Args:
        move: the pose after an action, None for a collision.
        start: first place.
        max_places: largest number of places.

    Yields:
        The places in the order of the search, all with the first heading.
    """

    def pose(offset: tuple[int, int], heading: float = HEADINGS[0]) -> Pose:
        # Computed from the start, since sums along different paths would differ by rounding errors.
        return Pose(start.x + GRID_STEP * offset[0], start.z + GRID_STEP * offset[1], heading)

    queue = [(0, 0)]
    visited = {(0, 0)}
    yield pose((0, 0))
    for column, row in queue:  # the loop appends to the queue
        for heading, (dx, dz) in zip(HEADINGS, ((0, 1), (1, 0), (0, -1), (-1, 0)), strict=True):
            neighbour = (column + dx, row + dz)
            if len(queue) == max_places or neighbour in visited:
                continue
            reached = move(pose((column, row), heading), AHEAD)
            if reached is not None and move(pose(neighbour, heading), BACK) is not None:
                visited.add(neighbour)
                queue.append(neighbour)
                yield pose(neighbour)
