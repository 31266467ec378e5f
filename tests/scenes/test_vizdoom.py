"""Recording of ViZDoom against the engine itself, on the first Freedoom map."""

import itertools
import re
import struct
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from relm_irl_jax.cli import main
from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.consistency import check_scene
from relm_irl_jax.scenes.recording.record import record_scene
from relm_irl_jax.scenes.recording.settings import VizdoomSettings
from relm_irl_jax.scenes.recording.simulator import AHEAD, BACK, Pose, next_pose
from relm_irl_jax.scenes.recording.vizdoom import reachable_places, vizdoom_map, vizdoom_maps
from relm_irl_jax.scenes.scene import HEADINGS
from relm_irl_jax.scenes.scene_file import load_scene

SETTINGS = VizdoomSettings(states=24, image_size=120)
UNITS = 64
"""Map units to a metre."""


@pytest.fixture(scope="module")
def engine():
    return pytest.importorskip("vizdoom", reason="ViZDoom is not installed: pip install 'relm-irl-jax[vizdoom]'")


@pytest.fixture(scope="module")
def source(engine, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("empty")
        patch.chdir(folder)
        with vizdoom_map("map01", SETTINGS) as opened:
            yield opened
        assert list(folder.iterdir()) == []  # the engine would leave its configuration and a folder here


def heading(source, rotation):
    """The player's start with another heading."""
    return source.poses[0]._replace(rotation=rotation)


def test_the_region_is_a_valid_scene(source, tmp_path):
    recording = record_scene(source, tmp_path / "map01.h5")
    scene = recording.scene
    assert check_scene(scene) == ((), ())
    assert (scene.n_states, scene.room_type, scene.views.shape[1:]) == (24, "doom", (120, 120, 3))
    assert (recording.refused, recording.closed, recording.disconnected) == (0, 0, 0)
    assert tuple(scene.location[0] * UNITS) == (-192, -192)  # where the map puts the player
    assert (scene.shortest_path_distance >= 0).all()
    assert "Stimpack" in scene.categories


def test_the_engine_stands_where_it_was_sent(source):
    for pose in source.poses[:8]:
        x, z, rotation = source.view(pose).pose
        assert (x, z) == pytest.approx(pose[:2], abs=1e-3)
        assert (rotation - pose.rotation + 180) % 360 == pytest.approx(180, abs=1e-3)


def test_four_views_join_to_a_panorama(source):
    """A view covers 90 degrees: its right edge is the left edge of the next one to the right."""
    place = next_pose(heading(source, 270), AHEAD)
    views = [source.view(place._replace(rotation=rotation)).image.astype(int) for rotation in HEADINGS]
    edges = list(itertools.pairwise([*views, views[0]]))
    joined = sum(np.abs(left[:, -1] - right[:, 0]).mean() for left, right in edges)
    mirrored = sum(np.abs(left[:, 0] - right[:, -1]).mean() for left, right in edges)  # were turns to the left
    assert joined < mirrored / 2


def test_views_and_moves_do_not_depend_on_earlier_ones(source):
    pose, last = heading(source, 0), source.poses[-1]
    before, before_last = source.view(pose), source.view(last)
    walked = pose
    for _ in range(5):
        walked = source.move(walked, AHEAD) or walked
    source.view(walked)
    again = source.view(pose)
    np.testing.assert_array_equal(source.view(last).image, before_last.image)
    np.testing.assert_array_equal(again.image, before.image)
    assert again.visible_objects == before.visible_objects


def test_a_region_holds_each_place_once_and_ends_at_drops():
    """Thirds of a metre are not exact, so that sums along two paths would differ; a drop leads down at z = 1.9."""
    start = Pose(1 / 3, 2 / 3, 0)

    def move(pose, action):
        after = next_pose(pose, action)
        is_up = pose.z > 1.9 and after.z < 1.9
        return after if abs(after.x) < 2 and 0 < after.z < 3 and not is_up else None

    region = list(reachable_places(move, start, 1000))
    assert len({(round(place.x, 3), round(place.z, 3)) for place in region}) == len(region)
    assert len(region) == 8 * 4  # x from -5/3 to 11/6, z from 1/6 to 5/3; 13/6 and 8/3 lie below
    assert list(reachable_places(move, start, 5)) == region[:5]


@pytest.fixture(scope="module")
def runner(engine):
    """A player of its own, with plain keys and no warps."""
    game = engine.DoomGame()
    game.set_doom_game_path(str(Path(engine.__file__).parent / "freedoom2.wad"))
    game.set_doom_map("map01")
    game.set_window_visible(False)
    game.set_available_buttons([engine.Button.MOVE_FORWARD, engine.Button.MOVE_BACKWARD, engine.Button.MOVE_RIGHT])
    game.add_game_args("-nomonsters")
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.chdir(folder)
        game.init()
        yield game
        game.close()


@pytest.mark.parametrize(("key", "rotation"), [(1, 270), (2, 180)])
def test_moves_lead_as_far_as_a_player_runs(engine, source, runner, key, rotation):
    """The player starts facing +x: it backs away from there, or steps right, until a wall stops it."""
    runner.new_episode()
    assert runner.get_game_variable(engine.GameVariable.ANGLE) == 0
    for _ in range(60):
        runner.make_action([number == key for number in range(3)])
    ran = Pose(*(runner.get_game_variable(getattr(engine.GameVariable, f"POSITION_{axis}")) for axis in "XY"), rotation)
    pose = heading(source, rotation)
    while (after := source.move(pose, AHEAD)) is not None:
        assert source.move(after, BACK) == pose
        pose = after
    along, aside = ((pose.x, ran.x), (pose.z, ran.z))[:: 1 if rotation == 270 else -1]
    assert -1 < along[0] * UNITS - along[1] < 32  # less than another step, in the direction of the walk
    assert aside[0] * UNITS == pytest.approx(aside[1], abs=1)


def test_solid_objects_stop_the_player(source):
    """Two barrels of the map: a place on one is refused, a walk into it collides."""
    barrel = Pose(864 / UNITS, 88 / UNITS, 0)
    assert source.view(barrel) is None
    assert source.move(barrel, AHEAD) is None


def test_a_door_that_a_move_closes_is_open_again_for_the_next(engine):
    place = Pose(-4.0, 6.5, 0)
    with vizdoom_map("map15", VizdoomSettings(states=8, image_size=32)) as opened:
        assert opened.move(place, AHEAD) is not None  # over the line that closes it
        assert opened.move(place._replace(rotation=180), AHEAD) is not None


def test_a_secret_place_writes_nothing_over_its_views(engine):
    """Letters would have the same colour at every heading."""
    place = Pose(26.375, 17.0, 0)
    with vizdoom_map("e4m4", VizdoomSettings(states=8, image_size=224)) as opened:
        views = [opened.view(place._replace(rotation=rotation)).image.astype(int) for rotation in HEADINGS]
    red, _, blue = np.moveaxis(np.mean(views, 0), -1, 0)
    letters = (np.std(views, 0).max(-1) < 2) & (red > 140) & (blue < 90)
    assert letters.sum() < 30  # 309 of "A secret is revealed"


def wad(path, *entries):
    """A WAD file with an empty directory entry of each name."""
    directory = b"".join(struct.pack("<ii8s", 12, 0, name.encode()) for name in entries)
    path.write_bytes(struct.pack("<4sii", b"PWAD", len(entries), 12) + directory)
    return path


def test_maps_that_do_not_exist_are_refused_before_anything_runs(engine, tmp_path):
    with pytest.raises(InputError, match=r"freedoom2.wad: contains no map map77; it has map01, .*map32"):
        vizdoom_maps(["map01", "map77"], SETTINGS)
    own = wad(tmp_path / "own.wad", "MAP05", "THINGS", "LINEDEFS", "TITLEPIC", "E1M2", "THINGS")
    with pytest.raises(InputError, match=r"own.wad: contains no map map01; it has map05, e1m2\."):
        vizdoom_maps(["map01"], VizdoomSettings(wad=own))
    assert list(vizdoom_maps(["MAP05"], VizdoomSettings(wad=own))) == ["map05"]
    for content in (b"", b"no WAD file at all", own.read_bytes()[:-5]):
        (tmp_path / "bad.wad").write_bytes(content)
        with pytest.raises(InputError, match=r"bad.wad"):
            vizdoom_maps(["map01"], VizdoomSettings(wad=tmp_path / "bad.wad"))


def test_the_command_keeps_finished_files_and_reports(engine, monkeypatch, capsys, tmp_path):
    arguments = [
        "--maps",
        "map01",
        "--states",
        "8",
        "--image-size",
        "32",
        "--room-type",
        "base",
        "--out",
        str(tmp_path),
    ]
    monkeypatch.setattr(sys, "argv", ["relm-irl", "scenes", "export", "vizdoom", *arguments])
    main()
    assert re.search(r"map01.h5 +8 +0 +0 +0", capsys.readouterr().out)
    assert load_scene(tmp_path / "map01.h5", views=False).room_type == "base"
    before = (tmp_path / "map01.h5").stat().st_mtime_ns
    main()
    assert "exists" in capsys.readouterr().out
    assert (tmp_path / "map01.h5").stat().st_mtime_ns == before


def test_without_the_engine_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "vizdoom", None)
    with pytest.raises(InputError, match=r"pip install 'relm-irl-jax\[vizdoom\]'"):
        vizdoom_maps(["map01"], SETTINGS)
