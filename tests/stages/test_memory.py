"""Work that the memory does not suffice for is refused before it begins, with the estimate."""

from dataclasses import replace

import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax import hardware, pipeline
from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.scene_file import load_scene, save_scene
from relm_irl_jax.stages.memory import check_memory, estimates

CONFIG = Config()


def test_the_defaults_fit_into_two_gigabytes():
    for agent in ("siamese", "metric"):
        assert max(estimates(replace(CONFIG, agent=agent)).values()) < 2e9


@pytest.mark.parametrize(
    ("config", "said"),
    [
        (replace(CONFIG, siamese=replace(CONFIG.siamese, workers=10**6, t_max=1000)), r"siamese\.workers.*8,192\.0 GB"),
        (replace(CONFIG, agent="metric", metric=replace(CONFIG.metric, states=10**5, goals=10**5)), r"metric\.states"),
        (replace(CONFIG, elm=replace(CONFIG.elm, hidden=10**6, pairs=10**6)), r"elm\.hidden.*24,000\.0 GB"),
        (replace(CONFIG, scene=replace(CONFIG.scene, training_per_type=1000)), r"scene\.training_per_type"),
    ],
)
def test_absurd_sizes_are_refused_with_the_estimate(config, said, tmp_path, monkeypatch):
    monkeypatch.setattr(hardware, "available_memory", lambda: 10**10)
    with pytest.raises(InputError, match=rf"{said}.*and 10\.0 GB are available"):
        check_memory(config)
    monkeypatch.setattr(pipeline, "encode_training", None)
    with pytest.raises(InputError, match="GB"):
        pipeline.run(replace(config, run=tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_a_scene_that_does_not_fit_is_refused(tmp_path, monkeypatch):
    scene = replace(grid_scene(2, 2), observation=np.zeros((16, 20, 20, 3), np.uint8))
    save_scene(scene, tmp_path / "a.h5")
    monkeypatch.setattr(hardware, "available_memory", lambda: 10_000)
    assert load_scene(tmp_path / "a.h5", views=False).n_states == 16
    with pytest.raises(InputError, match=r"a\.h5: reading the scene needs about"):
        load_scene(tmp_path / "a.h5")


def test_where_the_system_says_nothing_nothing_is_refused(monkeypatch):
    monkeypatch.setattr(hardware, "available_memory", lambda: None)
    check_memory(replace(CONFIG, siamese=replace(CONFIG.siamese, workers=10**6, t_max=1000)))


def test_this_computer_has_memory():
    available = hardware.available_memory()
    assert available is None or 10**7 < available < 10**14
