"""Intervals, paired differences, and the sentences that they allow, on numbers worked out by hand."""

import numpy as np
import pytest

from relm_irl_jax.report.comparison import difference_columns, difference_table, differences, paired, statement
from relm_irl_jax.report.tables import by_seed, markdown_table, separate_best, summarise, table_columns


def results(task: str, values: dict[str, list[float]]) -> dict:
    """Results in which SR and SPL of a method are one value a seed, the same in both scenes of two room types."""
    rows = [
        {"method": method, "scene": f"{room}-0", "room_type": room, "seed": seed, "episodes": 10}
        | {"sr": value, "spl": value, "ple": 100 * (1 - value)}
        for method, own in values.items()
        for seed, value in enumerate(own)
        for room in ("bathroom", "bedroom")
    ]
    return {"task": task, "cap": 100, "encoder": "none", "rows": rows}


APART = {"rl": [0.1, 0.2, 0.3], "irl": [0.5, 0.3, 0.4], "relm-irl": [0.8, 0.9, 1.0]}


def test_the_interval_is_students():
    """The 97.5% point of Student's t with two degrees of freedom is 4.3027, the standard error 1/√3."""
    cell = summarise([1.0, 2.0, 3.0])
    assert (cell.mean, cell.half_width) == (2.0, pytest.approx(4.3027 / np.sqrt(3), abs=1e-4))
    assert np.isnan(summarise([1.0]).half_width)
    assert np.isnan(summarise([]).mean)


def test_room_types_weigh_alike():
    rows = [
        {"method": "rl", "room_type": room, "seed": 0, "sr": sr}
        for room, sr in (("bathroom", 0.0), ("bathroom", 1.0), ("bedroom", 1.0))
    ]
    assert by_seed(rows, "rl", "sr", "mean") == {0: 0.75}
    assert by_seed(rows, "rl", "sr", "bathroom") == {0: 0.5}


def test_pairs_are_of_the_same_seed():
    """Differences 0.1, 0.1 and 0.4 have mean 0.2 and standard error 0.1; a seed that one side lacks does not count."""
    cell, seeds = paired({0: 0.3, 1: 0.5, 2: 0.9, 3: 0.0}, {0: 0.2, 1: 0.4, 2: 0.5})
    assert seeds == 3
    assert (cell.mean, cell.half_width) == (pytest.approx(0.2), pytest.approx(0.43027, abs=1e-4))


def test_the_best_is_marked_only_where_intervals_lie_apart():
    tight = {"rl": [0.10, 0.11, 0.12], "relm-irl": [0.8, 0.81, 0.82]}
    assert separate_best(results("I", tight)["rows"], "sr", "mean") == "relm-irl"
    assert separate_best(results("I", tight)["rows"], "ple", "bedroom") == "relm-irl"
    assert separate_best(results("I", {"rl": [0.1, 0.9], "irl": [0.2, 0.95]})["rows"], "sr", "mean") is None
    assert separate_best(results("I", {"rl": [0.1], "irl": [0.9]})["rows"], "sr", "mean") is None
    assert separate_best(results("I", {"rl": [0.1, 0.2]})["rows"], "sr", "mean") is None
    assert separate_best(results("I", {"rl": [1.0, 1.0], "irl": [1.0, 1.0]})["rows"], "sr", "mean") is None
    assert markdown_table(results("I", tight)).count("**") == 2 * 3 * 3


def test_the_table_and_its_columns_agree():
    columns = table_columns(results("II", APART))
    row = next(
        i for i, key in enumerate(zip(columns["method"], columns["metric"], columns["column"], strict=True))
        if key == ("relm-irl", "sr", "mean")
    )  # fmt: skip
    assert (columns["mean"][row], columns["seeds"][row], columns["paper"][row]) == (pytest.approx(0.9), 3, 0.60)


def test_the_statement_follows_the_intervals():
    """RELM−RL is 0.7 on every seed; RELM−IRL 0.3, 0.6, 0.6: mean 0.5, half width 0.43."""
    found = differences({"II": results("II", APART)})
    assert [d.verdict for d in found] == ["ahead of"] * 4
    assert statement(found) == [
        "Task II: RELM-IRL is ahead of RL (SR +0.700 ± 0.000, SPL +0.700 ± 0.000); "
        "ahead of IRL (SR +0.500 ± 0.430, SPL +0.500 ± 0.430)."
    ]
    swapped = {"rl": APART["relm-irl"], "relm-irl": APART["rl"]}
    assert "behind RL (SR −0.700" in statement(differences({"I": results("I", swapped)}))[0]
    level = {"rl": [0.1, 0.9, 0.5], "relm-irl": [0.9, 0.1, 0.5]}
    assert "not distinguishable from RL" in statement(differences({"I": results("I", level)}))[0]
    assert len(difference_columns(found)["mean"]) == 4
    assert "**+0.700 ± 0.000**" in difference_table(found)


def test_one_seed_decides_nothing():
    found = differences({"I": results("I", {"rl": [0.1], "relm-irl": [0.9]})})
    assert [d.verdict for d in found] == ["not distinguishable from"] * 2
    assert statement(found) == ["One seed says nothing about differences between methods; run more."]
