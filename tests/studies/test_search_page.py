"""The tables of the mapping agent's study, from files that are written by hand."""

from relm_irl_jax.files import columns_of_rows, write_table
from relm_irl_jax.studies.search_page import (
    FAILURE_COLUMNS,
    METRIC_COLUMNS,
    SearchRow,
    failed_rooms_table,
    learned_rewards_table,
    maps_section,
    search_section,
)


def test_means_are_over_scenes_then_room_types_then_seeds(tmp_path):
    row = SearchRow("map", "III", 0, "empty", 10)
    lines = [
        (0, "bathroom-2", "bathroom", 10, 1.0, 0.0, 0.8),
        (0, "bathroom-3", "bathroom", 10, 0.8, 1.0, 0.6),
        (0, "bedroom-2", "bedroom", 10, 0.5, 1.0, 0.5),
        (1, "bathroom-2", "bathroom", 10, 1.0, 0.0, 0.9),
        (1, "bedroom-2", "bedroom", 10, 0.8, 0.0, 0.5),
    ]
    write_table(row.path(tmp_path), columns_of_rows(METRIC_COLUMNS, lines))
    failed = [(0, "bathroom-3", "door", 7, 3, 5), (0, "bathroom-3", "sink", 8, 3, 5), (1, "bedroom-2", "door", 1, 2, 3)]
    write_table(row.failures(tmp_path), columns_of_rows(FAILURE_COLUMNS, failed))
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


def test_maps_have_a_column_each_and_their_mean(tmp_path):
    assert maps_section(tmp_path) == []
    for agent, rates in (("random", (0.0, 0.1)), ("map", (0.5, 0.8))):
        lines = [(0, name, "doom", 20, sr, 0.0, sr / 2) for name, sr in zip(("e1m1", "map01"), rates, strict=True)]
        path = SearchRow(agent, "III", 0, "empty", 20).path(tmp_path)
        write_table(path, columns_of_rows(METRIC_COLUMNS, lines))
    table = [line for line in maps_section(tmp_path) if line.startswith("|")]
    assert table[0] == "| | Episodes | e1m1 | map01 | Mean |"
    assert table[2:] == [
        "| Mapping agent | 40 | 0.50 / 0.25 | 0.80 / 0.40 | 0.65 / 0.33 |",
        "| Random | 40 | 0.00 / 0.00 | 0.10 / 0.05 | 0.05 / 0.03 |",
    ]


def test_learned_rewards_are_compared_on_the_same_seeds(tmp_path):
    rows = []
    for agent, rates in (("rl-prices", (0.5, 0.7)), ("relm-irl-prices", (0.6, 0.9))):
        lines = [(seed, "bedroom-2", "bedroom", 20, sr, 0.0, 0.5) for seed, sr in enumerate(rates)]
        rows.append(SearchRow(agent, "III", 0, "empty", 20))
        write_table(rows[-1].path(tmp_path), columns_of_rows(METRIC_COLUMNS, lines))
    # Differences 0.1 and 0.2; half width t(0.975, 1) · 0.0707 / √2 = 12.7 · 0.05.
    expected = "| RELM-IRL's reward prices steps | +0.150 ± 0.635 | +0.000 ± 0.000 |"
    assert learned_rewards_table(rows, tmp_path)[2:] == [expected]
    assert learned_rewards_table(rows[:1], tmp_path) == learned_rewards_table(rows[1:], tmp_path) == []


def test_failures_are_counted_by_room(tmp_path):
    row = SearchRow("map", "III", 0, "empty", 100)
    rates = {"a-2": (0.97, 0.9), "b-2": (1.0, 1.0), "c-2": (0.99, 1.0), "d-2": (1.0, 0.98)}
    lines = [
        (seed, scene, scene[0], 100, sr, 0.0, 0.5) for scene, found in rates.items() for seed, sr in enumerate(found)
    ]
    write_table(row.path(tmp_path), columns_of_rows(METRIC_COLUMNS, lines))
    assert failed_rooms_table([row], tmp_path, shown=1)[2:] == [
        "| `a-2` | 13 | 200 |",
        "| 2 others | 3 | 400 |",
        "| all 4 | 16 | 800 |",
    ]
