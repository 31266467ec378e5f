"""Views at the size that an agent asks for."""

from dataclasses import replace

import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.scene_file import save_scene
from relm_irl_jax.scenes.settings import SceneSettings
from relm_irl_jax.scenes.views import resized, scene_views

SETTINGS = SceneSettings(training_per_type=1, unseen_per_type=1)


def test_a_new_pixel_is_the_mean_over_its_area():
    views = np.zeros((16, 4, 4, 3), np.uint8)
    views[3, :2, 2:, 0] = [[10, 20], [30, 40]]
    small = resized(replace(grid_scene(2, 2), observation=views), 2)
    assert small.shape == (16, 2, 2, 3)
    assert small[3, 0, 1, 0] == 25
    assert small.sum() == 25


def test_scenes_without_views_and_unknown_ones_are_refused(tmp_path):
    views = np.full((16, 4, 4, 3), 7, np.uint8)
    save_scene(replace(grid_scene(2, 2, name="bathroom-0"), observation=views), tmp_path / "a.h5")
    save_scene(replace(grid_scene(2, 2, name="bathroom-1"), observation=views + 1), tmp_path / "b.h5")
    assert (scene_views(str(tmp_path), SETTINGS, 2, "bathroom-0") == 7).all()
    assert (scene_views(str(tmp_path), SETTINGS, 2, "bathroom-1") == 8).all()
    with pytest.raises(InputError, match="contains no scene bathroom-7"):
        scene_views(str(tmp_path), SETTINGS, 2, "bathroom-7")
    with pytest.raises(InputError, match="the scene has no views"):
        resized(grid_scene(2, 2), 2)
