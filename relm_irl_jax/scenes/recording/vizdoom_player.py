"""The player of a running ViZDoom engine: moves and views at any pose."""

import math
from collections.abc import Sequence
from functools import cache, lru_cache
from types import ModuleType
from typing import Any

import numpy as np

from relm_irl_jax.scenes.recording.simulator import AHEAD, BACK, Pose, View, next_pose
from relm_irl_jax.scenes.scene import GRID_STEP, HEADINGS

SETTLING_TICS = 10
"""Tics until the player reacts after the start of an episode, and until eye height and field of view have settled after
a warp."""

STOPPING_TICS = 64
"""Tics in which friction stops a running player."""

EYE_HEIGHT = 41.0
"""Height of the player's eyes above its feet, in map units."""

THRUST, FRICTION = 1.5625, 0.90625
"""Acceleration of a running player in map units per tic², and the factor by which friction reduces
its speed each tic."""

FULL_SPEED = 50.0
"""Value of the engine's button for running ahead."""

STOPPING_SPEED = 1 / 16
"""Map units per tic below which the engine stops a player who does not run."""

TOLERANCE = 1.0
"""Map units by which the end of a move may be short of the next place or off the straight line."""

IGNORED_CATEGORIES = ("Self", "Player", "Internal", "MapSpot", "SFX", "ScriptThing", "DynamicLight", "Token")
"""Categories of labels that are not visible objects."""

MAX_STARTS = 8
"""Largest number of candidate starts near objects."""

VIEWING_TICS = SETTLING_TICS + 2 * len(HEADINGS)
"""Tics for the views of a place."""

Heights = list[tuple[float, float]]
"""Floor and ceiling of each sector."""


class Player:
    """Moves and views at any pose, independent of earlier calls.

    To start an episode takes the engine longer than everything else, so an episode serves many places: moves go on in
    it until one of them has moved a floor or a ceiling, and the views of the places of a region have times of their own
    in it.

    Args:
        vizdoom: the package.
        game: the running engine.
        resolution: columns and rows of the engine's frames.
        image_size: rows and columns of a view.
        map_units: map units in one grid step.
    """

    def __init__(self, vizdoom: ModuleType, game: Any, resolution: tuple[int, int], *, image_size: int, map_units: int):
        self._variables = vizdoom.GameVariable
        self._game = game
        width, height = resolution
        self._rows = slice((height - image_size) // 2, (height - image_size) // 2 + image_size)
        self._columns = slice((width - image_size) // 2, (width - image_size) // 2 + image_size)
        # The field of view of the frame at which its centre square sees 90°; the engine takes whole degrees.
        self._field_of_view = round(2 * math.degrees(math.atan(width / image_size)))
        self._map_units = map_units
        self._units_per_metre = map_units / GRID_STEP
        self._tics = _tics_to_run(map_units)
        self.start = self._pose()
        self._heights: Heights | None = None
        self._tic: int | None = None
        self._places: dict[tuple[float, float], int] = {}
        self._moves = cache(self._moves_from)
        self._views = lru_cache(maxsize=1)(self._views_from)

    def arrange_views(self, places: Sequence[Pose]) -> None:
        """Give each place of a region its time in an episode, at which its views are taken.

        Args:
            places: the places, in the order in which their views will mostly be asked for. Those of other places are
                taken at the time of the first one.
        """
        for place in places:
            self._moves(place.x, place.z)  # now, since moves between views would need episodes of their own
        self._places = {(place.x, place.z): number for number, place in enumerate(places)}
        self._views.cache_clear()

    def starts_near_objects(self, n_places: int) -> list[Pose]:
        """Candidate starts of a region: places near objects, in descending number of kinds of objects around them.

        Args:
            n_places: size of the region; objects within half the side of a square of this size count.

        Returns:
            The places; the player's start is the last one.
        """
        self._new_episode()
        objects = [item for item in self._game.get_state().objects if item.category not in IGNORED_CATEGORIES]
        positions = np.asarray([(item.position_x, item.position_y) for item in objects]).reshape(-1, 2)
        positions = positions / self._units_per_metre
        is_near = np.abs(positions[:, None] - positions).max(-1) <= GRID_STEP * math.sqrt(n_places) / 2
        n_kinds = [len({objects[other].name for other in np.flatnonzero(near)}) for near in is_near]
        starts = []
        for number in np.argsort(n_kinds, kind="stable")[::-1]:
            x, z = (
                origin + GRID_STEP * round((value - origin) / GRID_STEP)
                for value, origin in zip(positions[number], self.start, strict=False)
            )
            starts.append(Pose(float(x), float(z), HEADINGS[0]))
        return [*list(dict.fromkeys(starts))[:MAX_STARTS], self.start]

    def move(self, pose: Pose, action: str) -> Pose | None:
        """The pose after an action; None for a collision.

        MoveBack is tried as MoveAhead with the opposite heading, which is equivalent since the player is square.
        """
        if action not in (AHEAD, BACK):
            return next_pose(pose, action)
        direction = (pose.rotation + (0 if action == AHEAD else 180)) % 360
        return next_pose(pose, action) if self._moves(pose.x, pose.z)[HEADINGS.index(direction)] else None

    def view(self, pose: Pose) -> View | None:
        """The view at a pose; None if the player does not fit or is not at rest."""
        return self._views(pose.x, pose.z)[HEADINGS.index(pose.rotation)]

    def _moves_from(self, x: float, z: float) -> tuple[bool, ...]:
        """Whether the player can move ahead from a place, for each heading."""
        return tuple(self._moves_ahead(Pose(x, z, heading)) for heading in HEADINGS)

    def _moves_ahead(self, pose: Pose) -> bool:
        self._stop()
        if self._heights is not None:
            self._approach(pose)
        if self._heights is None or self._current_heights() != self._heights:  # a door opens, a lift moves
            self._new_episode()
            self._approach(pose)
            self._heights = self._current_heights()
        if not self._at_rest():
            return False
        self._advance(self._tics, forward=FULL_SPEED)
        if self._game.is_episode_finished():  # the player has reached the exit
            self._heights = None
            return False
        reached, expected = self._pose(), next_pose(pose, AHEAD)
        along, aside = (reached.z - expected.z, reached.x - expected.x)
        if pose.rotation in (90, 270):
            along, aside = aside, along
        if pose.rotation in (180, 270):
            along = -along
        overshoot = _distance_run(self._tics) - self._map_units + TOLERANCE
        is_straight = abs(aside) * self._units_per_metre <= TOLERANCE
        return -TOLERANCE <= along * self._units_per_metre <= overshoot and is_straight

    def _approach(self, pose: Pose) -> None:
        self._warp(pose)
        self._turn(pose)
        reached, speed = self._pose(), abs(self._variable("VELOCITY_X")) + abs(self._variable("VELOCITY_Y"))
        slid = max(abs(reached.x - pose.x), abs(reached.z - pose.z)) * self._units_per_metre > 0.01
        if slid or speed > 0 or not self._at_rest():  # it was in the air, where brakes do not work
            self._advance(STOPPING_TICS, report=False)
            self._warp(pose)
            self._turn(pose)

    def _stop(self) -> None:
        """Brake a player who has run, since a warp keeps the speed."""
        vx, vy, angle = (self._variable(name) for name in ("VELOCITY_X", "VELOCITY_Y", "ANGLE"))
        forward, aside = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        speed, drift = vx * forward + vy * aside, vy * forward - vx * aside
        if abs(drift) > STOPPING_SPEED:  # it slides along a wall
            self._advance(STOPPING_TICS, report=False)
            return
        while abs(speed) > STOPPING_SPEED:
            thrust = float(np.rint(np.clip(-speed / THRUST, -1, 1) * FULL_SPEED))
            self._advance(1, forward=thrust, report=False)
            speed = (speed + thrust / FULL_SPEED * THRUST) * FRICTION

    def _views_from(self, x: float, z: float) -> tuple[View | None, ...]:
        """The views at a place, for each heading."""
        tic = VIEWING_TICS * self._places.get((x, z), 0)
        if self._tic is None or self._tic > tic:
            self._new_episode()
            self._tic = 0
        self._advance(tic - self._tic, report=False)
        self._tic = tic + VIEWING_TICS
        self._warp(Pose(x, z, HEADINGS[0]))
        return tuple(self._view_ahead(Pose(x, z, heading)) for heading in HEADINGS)

    def _new_episode(self) -> None:
        self._heights = self._tic = None
        self._game.new_episode()
        self._game.send_game_command("god")  # an episode outlasts many places on ground that hurts

    def _current_heights(self) -> Heights:
        return [(sector.floor_height, sector.ceiling_height) for sector in self._game.get_state().sectors]

    def _view_ahead(self, pose: Pose) -> View | None:
        self._turn(pose)
        if not self._at_rest():
            return None
        state = self._game.get_state()
        labels = state.labels_buffer[self._rows, self._columns]
        share = np.bincount(labels.ravel(), minlength=256) / labels.size
        visible: dict[str, float] = {}
        for label in state.labels:
            if share[label.value] > 0 and label.object_category not in IGNORED_CATEGORIES:
                visible[label.object_name] = visible.get(label.object_name, 0.0) + float(share[label.value])
        return View(self._pose(), state.screen_buffer[self._rows, self._columns].copy(), visible)

    def _warp(self, pose: Pose) -> None:
        x, y = pose.x * self._units_per_metre, pose.z * self._units_per_metre
        self._game.send_game_command(f"warp {x:.6f} {y:.6f}")
        self._game.send_game_command(f"fov {self._field_of_view}")
        self._advance(SETTLING_TICS, report=False)

    def _turn(self, pose: Pose) -> None:
        self._advance(1, turn=pose.rotation - self._pose().rotation, report=False)
        self._advance(1)

    def _advance(self, tics: int, *, forward: float = 0.0, turn: float = 0.0, report: bool = True) -> None:
        """Run the engine for some tics; a report, which takes as long as many tics, updates pose and view."""
        if tics == 0:
            return
        self._game.set_action([forward, turn])
        self._game.advance_action(tics, report)

    def _at_rest(self) -> bool:
        """Whether eye height and field of view have settled, which never happens if the player does not fit."""
        eye_height = self._variable("CAMERA_POSITION_Z") - self._variable("POSITION_Z")
        field_of_view = self._variable("CAMERA_FOV")
        return abs(eye_height - EYE_HEIGHT) < 0.1 and abs(field_of_view - self._field_of_view) < 0.1

    def _pose(self) -> Pose:
        """The player's pose as the engine reports it; the engine's angles grow anticlockwise from +x."""
        x, y = self._variable("POSITION_X"), self._variable("POSITION_Y")
        return Pose(x / self._units_per_metre, y / self._units_per_metre, (90 - self._variable("ANGLE")) % 360)

    def _variable(self, name: str) -> float:
        return self._game.get_game_variable(getattr(self._variables, name))


def _distance_run(tics: int) -> float:
    """Map units that the player runs in a number of tics from rest."""
    speed = distance = 0.0
    for _ in range(tics):
        speed += THRUST
        distance += speed
        speed *= FRICTION
    return distance


def _tics_to_run(map_units: int) -> int:
    """Smallest number of tics in which the player runs a distance from rest."""
    return next(tics for tics in range(1, 10_000) if _distance_run(tics) >= map_units)
