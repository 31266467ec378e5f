"""Learning curves by hand."""

import numpy as np
import pytest
from run_folders import write_curve

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_table
from relm_irl_jax.report.learning_curves import (
    TrainingCurve,
    band_columns,
    confidence_band,
    frames_to_success,
    learning_figure,
    load_curve,
    running_mean,
    success_columns,
    success_table,
)


def curve(success, episodes=None) -> TrainingCurve:
    success = np.asarray(success, float)
    ended = np.full(len(success), 10.0) if episodes is None else np.asarray(episodes, float)
    return TrainingCurve(100.0 * np.arange(1, len(success) + 1), ended, success, 100 * (1 - success), success / 2)


def test_the_running_mean_counts_episodes():
    """Nine of ten, then none ended, then one of thirty: 0.9, 0.9, 10 of 40."""
    means = running_mean(curve([0.9, np.nan, 1 / 30], [10.0, 0.0, 30.0]), "success_rate")
    assert means == pytest.approx([0.9, 0.9, 0.25])
    assert np.isnan(running_mean(curve([np.nan, 1.0], [0.0, 1.0]), "success_rate")[0])
    assert running_mean(curve([0.0] + [1.0] * 5), "success_rate")[-1] == 1.0


def test_frames_to_success():
    assert frames_to_success(curve([0.0] + [1.0] * 5)) == 600.0
    assert np.isnan(frames_to_success(curve([0.9] * 6)))
    assert np.isnan(frames_to_success(curve([1.0] * 4 + [0.5, 0.9])))
    assert np.isnan(frames_to_success(curve([1.0] * 4)))  # too few to say
    assert frames_to_success(curve([1.0] + [0.2] * 4 + [1.0] * 8)) > 600.0


def test_a_band_has_students_width():
    band = confidence_band([curve([0.1]), curve([0.2]), curve([0.3])], "success_rate")
    assert band.mean == pytest.approx([0.2])
    assert band.half_width == pytest.approx([4.3027 * 0.1 / np.sqrt(3)], abs=1e-4)
    assert np.isnan(confidence_band([curve([0.1])], "success_rate").half_width).all()


def test_tables_hold_every_method_and_seed():
    curves = {"rl": {0: curve([0.1, 0.1]), 2: curve([0.1, 1.0])}, "own": {0: curve([1.0, 1.0])}}
    columns = band_columns(curves)
    assert columns["method"] == ["rl", "rl", "own", "own"]
    assert columns["spl"] == pytest.approx([0.05, 0.1625, 0.5, 0.5])
    success = success_columns(curves)
    assert (success["method"], success["seed"]) == (["rl", "rl", "own"], [0, 2, 0])


def test_no_mean_where_a_seed_never_succeeds():
    always, never = curve([1.0] * 5), curve([0.5] * 5)
    table = success_table({"rl": {0: always, 1: never}, "irl": {0: always, 1: always}})
    assert "| RL | – | 1 of 2 |" in table
    assert "| IRL | 0 ± 0 | 2 of 2 |" in table


def test_the_figure_draws_each_method_once_a_panel():
    figure = learning_figure({"rl": {0: curve([0.1, 0.2])}, "relm-irl": {0: curve([0.3, 0.4])}})
    assert [len(panel.lines) for panel in figure.axes] == [2, 2, 2]
    np.testing.assert_allclose(figure.axes[1].lines[0].get_xydata(), [[1e-4, 0.1], [2e-4, 0.15]])
    assert figure.axes[0].lines[0].get_marker() == "None"


def test_a_curve_of_one_chunk_is_a_point():
    assert learning_figure({"rl": {0: curve([0.1])}}).axes[0].lines[0].get_marker() == "o"


def test_curves_are_read_as_they_were_written(tmp_path):
    write_curve(tmp_path / "a.csv", [np.nan, 0.5])
    read = load_curve(tmp_path / "a.csv")
    np.testing.assert_array_equal(read.frames, [100.0, 200.0])
    np.testing.assert_array_equal(read.success_rate, [np.nan, 0.5])


def test_damaged_curves_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    with pytest.raises(InputError, match=r"a\.csv is missing"):
        load_curve(path)
    write_table(path, {"frames": [1.0], "loss": [2.0]})
    with pytest.raises(InputError, match="column `episodes` is missing"):
        load_curve(path)
    write_curve(path, [0.5])
    path.write_text(path.read_text().replace("100.0", "nan", 1))
    with pytest.raises(InputError, match="column `frames` is not finite"):
        load_curve(path)
