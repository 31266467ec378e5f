"""Learning curves by hand, and the table beside every figure."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from relm_irl_jax.report.curves import band, band_columns, frames_to_success, running_mean, speed_table
from relm_irl_jax.runs import read_table

from relm_irl_jax.report.figures import press_columns, save_figure


def curve(success: list[float], episodes: list[float] | None = None) -> dict[str, list[str]]:
    episodes = episodes or [10.0] * len(success)
    frames = [100.0 * (n + 1) for n in range(len(success))]
    return {name: [str(v) for v in values] for name, values in
            (("frames", frames), ("episodes", episodes), ("success_rate", success))}  # fmt: skip


def test_the_running_mean_counts_episodes():
    """Nine of ten, then none ended, then one of thirty: 0.9, 0.9, 10 of 40."""
    assert running_mean(curve([0.9, np.nan, 1 / 30], [10.0, 0.0, 30.0]), "success_rate") == pytest.approx(
        [0.9, 0.9, 0.25]
    )
    assert np.isnan(running_mean(curve([np.nan, 1.0], [0.0, 1.0]), "success_rate")[0])
    assert running_mean(curve([0.0] + [1.0] * 5), "success_rate")[-1] == 1.0


def test_frames_to_success():
    assert frames_to_success(curve([0.0] + [1.0] * 5)) == 600.0
    assert np.isnan(frames_to_success(curve([0.9] * 6)))


def test_a_band_has_students_width():
    drawn = band([curve([0.1]), curve([0.2]), curve([0.3])], "success_rate")
    assert drawn.mean == pytest.approx([0.2])
    assert drawn.half_width == pytest.approx([4.3027 * 0.1 / np.sqrt(3)], abs=1e-4)
    assert np.isnan(band([curve([0.1])], "success_rate").half_width).all()
    assert band_columns({"rl": [curve([0.1, 0.1])]}, ["success_rate"])["method"] == ["rl", "rl"]


def test_no_mean_where_a_seed_never_arrives():
    table = speed_table({"rl": [curve([1.0]), curve([0.5])], "irl": [curve([1.0]), curve([1.0])]})
    assert "| RL | – | 1 of 2 |" in table
    assert "| IRL | 0 ± 0 | 2 of 2 |" in table


def test_a_figure_is_saved_with_its_table(tmp_path):
    errors = [np.asarray([3.0, 1.0, 2.0]), np.asarray([1.0, 2.0])]
    save_figure(Figure(figsize=(1, 1)), tmp_path / "figure.png", press_columns(errors))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["figure.csv", "figure.png"]
    table = read_table(tmp_path / "figure.csv")
    assert table["seed"] == ["0", "0", "0", "1", "1"]
    assert table["minimum"] == ["False", "True", "False", "True", "False"]
