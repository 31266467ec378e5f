"""Which scenes a run uses."""

from dataclasses import replace

import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.rooms.cache import built_in_room
from relm_irl_jax.scenes.scene_file import save_scene
from relm_irl_jax.scenes.selection import check_scenes_setting, training_scenes, unseen_scenes
from relm_irl_jax.scenes.settings import SceneSettings

from .sizes import IMAGE_SIZE


@pytest.fixture
def folder(tmp_path):
    for number in range(4):
        scene = grid_scene(2, 2, name=f"bathroom-{number}")
        save_scene(replace(scene, observation=np.zeros((16, 4, 4, 3), np.uint8)), tmp_path / f"{scene.name}.h5")
    return str(tmp_path)


def test_unseen_scenes_are_never_training_scenes(folder):
    settings = SceneSettings(training_per_type=2, unseen_per_type=2)
    training = {load().name for load in training_scenes(folder, settings)}
    unseen = {load().name for load in unseen_scenes(folder, settings)}
    assert training == {"bathroom-0", "bathroom-1"}
    assert unseen == {"bathroom-2", "bathroom-3"}


def test_a_folder_may_hold_fewer_scenes(folder):
    assert len(training_scenes(folder, SceneSettings(training_per_type=9))) == 4
    assert len(unseen_scenes(folder, SceneSettings(training_per_type=2, unseen_per_type=3))) == 2


def test_no_scene_left_for_task_iii_is_refused(folder):
    with pytest.raises(InputError, match=r"all 4 scenes of type bathroom in .* are training scenes"):
        unseen_scenes(folder, SceneSettings(training_per_type=4))


def test_training_scenes_may_be_named(folder):
    settings = SceneSettings(training=("bathroom-3", "bathroom-1"), unseen_per_type=3)
    assert [load().name for load in training_scenes(folder, settings)] == ["bathroom-1", "bathroom-3"]
    assert [load().name for load in unseen_scenes(folder, settings)] == ["bathroom-0", "bathroom-2"]
    with pytest.raises(InputError, match=r"contains no scene kitchen-1; it has bathroom-0, .*bathroom-3\."):
        training_scenes(folder, SceneSettings(training=("kitchen-1",)))
    with pytest.raises(InputError, match="leave it out for the built-in rooms"):
        training_scenes("rooms", settings)


def test_unseen_rooms_stay_the_same_with_other_training_rooms(folder):
    tiny = SceneSettings(size="tiny", training_per_type=1, unseen_per_type=1)
    names = lambda scenes: [scene.keywords | {"type": scene.args} for scene in scenes]  # noqa: E731
    other = replace(tiny, first_room=7, training_per_type=4, first_unseen=1)
    assert names(unseen_scenes("rooms", tiny)) == names(unseen_scenes("rooms", other))
    assert len(training_scenes("rooms", other)) == 12
    for first, faulty in ((7, 7), (10, 10), (6, 7)):
        with pytest.raises(InputError, match=rf"room {faulty} of each type would be trained and unseen.* 7 to 10 "):
            training_scenes("rooms", replace(other, first_unseen=first, unseen_per_type=2))
    with pytest.raises(InputError, match=r"scene\.first_unseen: numbers built-in rooms"):
        training_scenes(folder, SceneSettings(first_unseen=3))


def test_values_that_hold_no_scene_are_refused(tmp_path):
    with pytest.raises(InputError, match="is not a folder"):
        check_scenes_setting(str(tmp_path / "absent"))
    with pytest.raises(InputError, match="contains no file"):
        check_scenes_setting(str(tmp_path))
    check_scenes_setting("rooms")


def test_rooms_are_rendered_once(tmp_path, monkeypatch):
    monkeypatch.setattr("relm_irl_jax.scenes.rooms.cache.cache_folder", lambda: tmp_path)
    settings = SceneSettings(training_per_type=1, size="tiny", image_size=IMAGE_SIZE)
    first = [load() for load in training_scenes("rooms", settings)]
    monkeypatch.setattr("relm_irl_jax.scenes.rooms.generate.generate_room", None)
    again = [load() for load in training_scenes("rooms", settings)]
    assert [scene.name for scene in first] == ["bathroom-0", "bedroom-0", "living_room-0"]
    for before, after in zip(first, again, strict=True):
        assert (before.views == after.views).all()
    blind = [load(views=False) for load in training_scenes("rooms", settings)]
    assert [scene.name for scene in blind] == [scene.name for scene in first]
    assert all(scene.observation is None for scene in blind)


def test_a_damaged_room_is_generated_again(tmp_path, monkeypatch):
    monkeypatch.setattr("relm_irl_jax.scenes.rooms.cache.cache_folder", lambda: tmp_path)
    blind = built_in_room("bathroom", 0, size="tiny", image_size=IMAGE_SIZE, views=False)
    assert blind.observation is None
    (path,) = tmp_path.rglob("*.h5")
    path.write_bytes(path.read_bytes()[:500])
    again = built_in_room("bathroom", 0, size="tiny", image_size=IMAGE_SIZE)
    assert again.views.shape == (again.n_states, IMAGE_SIZE, IMAGE_SIZE, 3)


@pytest.mark.parametrize("choose", [training_scenes, unseen_scenes])
def test_views_are_read_only_where_they_are_wanted(folder, choose):
    for load in choose(folder, SceneSettings(training_per_type=2)):
        assert load().observation is not None
        assert load(views=False).observation is None
