"""The tables of a run, on numbers worked out by hand."""

import io
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console
from run_folders import results, row

from relm_irl_jax.report.names import in_order
from relm_irl_jax.report.tables import (
    by_seed,
    columns_of,
    console_table,
    markdown_table,
    quality_table,
    separate_best,
    table_columns,
)
from relm_irl_jax.results import RewardQualityRow

APART = {"rl": [0.1, 0.2, 0.3], "irl": [0.5, 0.3, 0.4], "relm-irl": [0.8, 0.9, 1.0]}
TIGHT = {"rl": [0.10, 0.11, 0.12], "relm-irl": [0.8, 0.81, 0.82]}


def test_room_types_weigh_alike():
    rows = [row("rl", 0.0), row("rl", 1.0, scene=1), row("rl", 1.0, room="bedroom")]
    assert by_seed(rows, "rl", "sr", "mean") == {0: 0.75}
    assert by_seed(rows, "rl", "sr", "bathroom") == {0: 0.5}


def test_a_seed_without_a_room_type_has_no_mean():
    rows = [row("rl", 0.5), row("rl", 1.0, room="bedroom"), row("rl", 1.0, seed=1)]
    assert by_seed(rows, "rl", "sr", "mean") == {0: 0.75}
    assert by_seed(rows, "rl", "sr", "bathroom") == {0: 0.5, 1: 1.0}


def test_columns_and_methods_keep_the_papers_order():
    rows = [row("rl", 0.0, room=room) for room in ("maze", "living_room", "bathroom")]
    assert columns_of(rows) == ("bathroom", "living_room", "maze", "mean")
    assert in_order({"own", "relm-irl", "random"}) == ["random", "relm-irl", "own"]


def test_the_best_is_marked_only_where_intervals_lie_apart():
    assert separate_best(results("I", TIGHT).rows, "sr", "mean") == "relm-irl"
    assert separate_best(results("I", TIGHT).rows, "ple", "bedroom") == "relm-irl"
    assert separate_best(results("I", {"rl": [0.1, 0.9], "irl": [0.2, 0.95]}).rows, "sr", "mean") is None
    assert separate_best(results("I", {"rl": [0.1], "irl": [0.9]}).rows, "sr", "mean") is None
    assert separate_best(results("I", {"rl": [0.1, 0.2]}).rows, "sr", "mean") is None
    other = [replace(row, method="ppo", agent="own", sr=1.0) for row in results("I", {"rl": [0.1, 0.2]}).rows]
    assert separate_best([*results("I", TIGHT).rows, *other], "sr", "mean") == "relm-irl"
    assert separate_best(other, "sr", "mean") is None
    assert separate_best(results("I", {"rl": [1.0, 1.0], "irl": [1.0, 1.0]}).rows, "sr", "mean") is None
    assert markdown_table(results("I", TIGHT)).count("**") == 2 * 3 * 3


def test_the_table_and_its_columns_agree():
    columns = table_columns(results("II", APART))
    place = next(
        i for i, key in enumerate(zip(columns["method"], columns["metric"], columns["column"], strict=True))
        if key == ("relm-irl", "sr", "mean")
    )  # fmt: skip
    shown = (columns["mean"][place], columns["seeds"][place], columns["paper"][place])
    assert shown == (pytest.approx(0.9), 3, 0.60)
    assert "**0.90 ± 0.25** (0.60)" in markdown_table(results("II", APART))


def test_methods_that_the_paper_does_not_know_are_shown_without_its_numbers():
    table = markdown_table(results("I", {"rl": [0.5], "own": [0.75]}))
    assert "| own | SR ↑ | 0.75 | 0.75 | 0.75 |" in table
    assert "| RL | SR ↑ | 0.50 (1.00) |" in table
    assert np.isnan(table_columns(results("I", {"own": [0.75]}))["paper"]).all()


def test_the_terminal_shows_the_same():
    text = io.StringIO()
    Console(file=text, width=120).print(console_table(results("II", APART)))
    assert "Task II: cap 100, encoder none" in text.getvalue()
    assert "0.90 ± 0.25" in text.getvalue()


def test_the_quality_of_rewards_is_a_mean_over_seeds():
    def quality(method, targets, rank):
        return RewardQualityRow(method=method, targets=targets, median_rank=rank, median_rank_share=0.1, mean_order=0.5)

    table = quality_table(
        {
            0: [quality("relm-irl", "new", 1), quality("irl", "trained", 1)],
            1: [quality("relm-irl", "new", 2), quality("irl", "trained", 1)],
        }
    )
    assert table.splitlines()[2:] == [
        "| IRL | trained | 1.0 ± 0.0 | 0.50 ± 0.00 |",
        "| RELM-IRL | of Task II | 1.5 ± 6.4 | 0.50 ± 0.00 |",
    ]
