"""Bars, the PRESS curve, and the table beside every figure."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import read_table, write_table
from relm_irl_jax.report.figures import (
    bar_figure,
    load_press_curve,
    press_columns,
    press_figure,
    press_minimum,
    save_figure,
)
from relm_irl_jax.report.intervals import MeanInterval


def test_a_figure_is_saved_with_its_table(tmp_path):
    errors = [np.asarray([3.0, 1.0, 2.0]), np.asarray([1.0, 2.0])]
    save_figure(Figure(figsize=(1, 1)), tmp_path / "figures" / "figure.png", press_columns(errors))
    assert sorted(path.name for path in (tmp_path / "figures").iterdir()) == ["figure.csv", "figure.png"]
    table = read_table(tmp_path / "figures" / "figure.csv")
    assert table["seed"] == ["0", "0", "0", "1", "1"]
    assert table["minimum"] == ["False", "True", "False", "True", "False"]


def test_the_press_curve_marks_its_minimum():
    curves = [np.asarray([np.inf, 3.0, 1.0, 2.0]), np.asarray([np.nan, 1.0])]
    assert [press_minimum(curve) for curve in curves] == [3, 2]
    panel = press_figure(curves).axes[0]
    assert [tuple(line.get_xydata()[0]) for line in panel.lines[1::2]] == [(3.0, 1.0), (2.0, 1.0)]
    assert panel.get_title() == "2 ± 6 neurons kept"


def test_a_press_curve_without_errors_is_refused(tmp_path):
    write_table(tmp_path / "press.csv", {"mean_squared_error": [np.inf, np.nan]})
    with pytest.raises(InputError, match="contains no finite number"):
        load_press_curve(tmp_path / "press.csv")


def test_bars_stand_side_by_side():
    interval, alone = MeanInterval(0.5, 0.1), MeanInterval(0.25, float("nan"))
    panel = bar_figure({"elm-irl": [interval, alone], "own": [alone, alone]}, ["Bathroom", "Mean"], "SPL").axes[0]
    assert [bar.get_height() for bar in panel.patches] == [0.5, 0.25, 0.25, 0.25]
    assert len({round(bar.get_x(), 6) for bar in panel.patches}) == 4
