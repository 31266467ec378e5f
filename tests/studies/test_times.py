"""Times of a study's pieces add up over calls, also interrupted ones."""

import pytest

from relm_irl_jax.studies import times
from relm_irl_jax.studies.times import load_times, timed, times_table


def test_times_add_up(tmp_path, monkeypatch):
    clock = iter((0.0, 30.0, 100.0, 190.0, 200.0, 260.0))
    monkeypatch.setattr(times.time, "perf_counter", lambda: next(clock))
    path = tmp_path / "times.csv"
    assert times_table(path) == []
    with timed(path, "elm"):
        pass
    with timed(path, "map"):
        pass
    with pytest.raises(KeyboardInterrupt), timed(path, "elm"):
        raise KeyboardInterrupt
    assert load_times(path) == {"elm": 90.0, "map": 90.0}
    assert times_table(path)[2:] == ["| elm | 1.5 |", "| map | 1.5 |", "| sum | 3.0 |"]
