"""The benchmark runs at small sizes and saves its files."""

import csv

from relm_irl_jax.benchmarks import elm
from relm_irl_jax.benchmarks.elm import Size


def test_it_saves_its_table_and_figure(tmp_path, monkeypatch):
    size = Size(60, 20, 3)
    monkeypatch.setattr(elm, "PEER", size)
    monkeypatch.setattr(elm, "LARGEST", size)
    monkeypatch.setattr(elm, "SCALING", {"L": [size], "N": [size], "p": [size]})
    rows = elm.main(tmp_path, repeats=2)
    with (tmp_path / "elm.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(rows)
    assert (tmp_path / "elm.png").stat().st_size > 10_000
    assert {row.method for row in rows if row.case == "largest"} == {
        "relm-irl-jax, norm 1",
        "relm-irl-jax, norm 2",
        "floor",
    }
    assert all(0 < row.error < 3 for row in rows if row.error is not None)
    assert all(row.first > 0 and row.median <= row.worst for row in rows)
