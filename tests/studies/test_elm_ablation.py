"""The script of Figures 7 to 10, on seeds that its folder holds already."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import read_table, write_table
from relm_irl_jax.stages.encoding import encode_training, encode_unseen
from relm_irl_jax.studies.study import load_preset

sys.path.insert(0, str(Path(__file__).parents[2] / "experiments"))

import elm_ablation

SMOKE = Path(elm_ablation.__file__).parent / "smoke.toml"


def test_pairs_to_test_on_share_no_target_and_no_scene_with_those_to_fit():
    config = load_preset(SMOKE)
    config = replace(config, irl=replace(config.irl, trajectories=2, processes=1))
    training = encode_training(config)
    unseen = encode_unseen(config, training)
    pairs = elm_ablation.learned_pairs(config, training.scenes, unseen, 0)
    width = training.scenes[0].encoded.shape[1]

    def views(rows):
        return {row.tobytes() for row in rows}

    trained, elsewhere = (views(np.concatenate([s.encoded for s in scenes])) for scenes in (training.scenes, unseen))
    for part, own in ((pairs.train, trained), (pairs.test, trained), (pairs.unseen, elsewhere)):
        assert views(part.X[:, :width]) | views(part.X[:, width:]) <= own
    assert not views(pairs.train.X[:, width:]) & views(pairs.test.X[:, width:])
    assert not trained & elsewhere


def test_every_figure_has_its_table_and_nothing_is_fitted_again(tmp_path, monkeypatch):
    for seed in range(2):
        folder = tmp_path / f"seed-{seed}"
        write_table(folder / "sizes.csv", {"neurons": [1, 10], "test_r2": [0.1 + seed, 0.3], "train_r2": [0.2, 0.9]})
        write_table(folder / "points.csv", {name: np.arange(4) / 10 for name in ("truth", "elm", "relm")})
        write_table(folder / "press.csv", {"mean_squared_error": [3.0, 1.0 - 0.5 * seed, 2.0]})
        choice = {
            "choice": ["all", "some, by PRESS"],
            "accuracy": [0.1, 0.2 + seed],
            "accuracy_in_unseen_scenes": [-1.0, 0.5],
            "kept": [9, 5],
            "ridge": [0.0, 1.0],
        }
        write_table(folder / "choices.csv", choice)
        write_table(folder / "accuracy.csv", {"fitted": [5], "tested": [4], "elm_r2": [0], "relm_r2": [1], "kept": [2]})
    settings = elm_ablation.Ablation(tmp_path, seeds=2, sizes=(1, 10))
    elm_ablation.main(settings)
    for name in ("figure-7", "figure-8-10", "figure-9"):
        assert (tmp_path / f"{name}.png").stat().st_size > 0
        assert read_table(tmp_path / f"{name}.csv")
    curve = read_table(tmp_path / "figure-7.csv")
    assert [float(value) for value in curve["test_r2"]] == pytest.approx([0.6, 0.3])
    assert read_table(tmp_path / "figure-9.csv")["minimum"] == ["False", "True", "False"] * 2
    choices = read_table(tmp_path / "choices.csv")
    assert choices["choice"] == ["all", "some, by PRESS"]
    assert [float(value) for value in choices["accuracy"]] == pytest.approx([0.1, 0.7])
    monkeypatch.setattr(elm_ablation, "save_figure", lambda figure, path, table: None)
    kept = json.loads((tmp_path / "settings.json").read_text())
    del kept["config"]["elm"]["leave_out"]  # as a version left it that had no such field
    (tmp_path / "settings.json").write_text(json.dumps(kept))
    elm_ablation.main(settings)
    with pytest.raises(InputError, match=r"holds results with other settings \(sizes\); give another folder"):
        elm_ablation.main(elm_ablation.Ablation(tmp_path, seeds=2, sizes=(1, 20)))
    fewer = replace(settings.config, elm=replace(settings.config.elm, hidden=9))
    with pytest.raises(InputError, match=r"other settings \(elm\)"):
        elm_ablation.main(replace(settings, config=fewer))
    elm_ablation.main(replace(settings, config=replace(settings.config, frames=7)))  # no ELM depends on it
