"""Learning curves of the mapping agent."""

import numpy as np

from relm_irl_jax.files import write_table
from relm_irl_jax.report.map_curves import COLUMNS, load_map_curve, map_curve_figure


def test_curves_are_read_and_drawn(tmp_path):
    columns = {name: np.arange(3) + number for number, name in enumerate(COLUMNS)}
    write_table(tmp_path / "a.csv", columns)
    write_table(tmp_path / "b.csv", {name: [] for name in COLUMNS})
    assert load_map_curve(tmp_path / "b.csv") is None
    curve = load_map_curve(tmp_path / "a.csv")
    figure = map_curve_figure({0: curve, 1: curve})
    accuracy, loss = figure.axes
    assert [len(panel.lines) for panel in (accuracy, loss)] == [4, 6]
    np.testing.assert_array_equal(accuracy.lines[0].get_ydata(), columns["last_location_accuracy"])
