"""The tables of the mapping agent's study, from files that are written by hand."""

from relm_irl_jax.files import write_table
from relm_irl_jax.studies.search_page import FAILURE_COLUMNS, METRIC_COLUMNS, SearchRow, search_section


def test_means_are_over_scenes_then_room_types_then_seeds(tmp_path):
    row = SearchRow("map", "III", 0, "empty", 10)
    lines = [
        (0, "bathroom-2", "bathroom", 10, 1.0, 0.0, 0.8),
        (0, "bathroom-3", "bathroom", 10, 0.8, 1.0, 0.6),
        (0, "bedroom-2", "bedroom", 10, 0.5, 1.0, 0.5),
        (1, "bathroom-2", "bathroom", 10, 1.0, 0.0, 0.9),
        (1, "bedroom-2", "bedroom", 10, 0.8, 0.0, 0.5),
    ]
    write_table(row.path(tmp_path), dict(zip(METRIC_COLUMNS, zip(*lines, strict=True), strict=True)))
    failed = [(0, "bathroom-3", "door", 7, 3, 5), (0, "bathroom-3", "sink", 8, 3, 5), (1, "bedroom-2", "door", 1, 2, 3)]
    write_table(row.failures(tmp_path), dict(zip(FAILURE_COLUMNS, zip(*failed, strict=True), strict=True)))
    text = search_section(tmp_path)
    table = next(line for line in text if line.startswith("| III | 2–3 |")).split(" | ")
    assert table[3] == "50"
    # SR of bathrooms 0.9 and 1.0, of bedrooms 0.5 and 0.8, their means 0.7 and 0.9; half widths t(0.975, 1) · s / √2.
    assert table[4].startswith("0.95 ± 0.64 / 0.80 ± 1.27")
    assert table[5].startswith("0.65 ± 1.91 / 0.50 ± 0.00")
    assert table[-1].startswith("0.80 ± 1.27")
    assert "| III | empty | from 0 | 3 of 50 | bathroom-3 2, bedroom-2 1 | door 2, sink 1 |" in text


def test_no_failures_and_no_rows(tmp_path):
    assert search_section(tmp_path) == []
    row = SearchRow("oracle", "III", 0, "empty", 10)
    write_table(
        row.path(tmp_path),
        {
            name: [value]
            for name, value in zip(METRIC_COLUMNS, (0, "bedroom-2", "bedroom", 1, 1.0, 0.0, 1.0), strict=True)
        },
    )
    write_table(row.failures(tmp_path), {name: [] for name in FAILURE_COLUMNS})
    assert any("Oracle" in line for line in search_section(tmp_path))
