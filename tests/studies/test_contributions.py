"""What memory and adaptation add, on results that can be subtracted by hand."""

from math import inf

import pytest

from relm_irl_jax.report.intervals import MeanInterval
from relm_irl_jax.results import TASKS
from relm_irl_jax.studies.ablation import COMPARED_METRICS, AblationRow
from relm_irl_jax.studies.contributions import contributions, contributions_table
from relm_irl_jax.studies.page import write_study


def row(line: str, rooms: int, values: dict[int, float]) -> AblationRow:
    """A finished run whose SR by seed is given; SPL is half of it."""
    by_seed = {
        (task, metric): {seed: value / (1 + number) for seed, value in values.items()}
        for task in TASKS
        for number, metric in enumerate(COMPARED_METRICS)
    }
    agent = line.partition(",")[0]
    unknown = MeanInterval(inf, inf)
    return AblationRow(agent=agent, name="base", title="", seeds=len(values), frames=1, by_seed=by_seed, change={},
                       rank=unknown, rooms=rooms, line=line)  # fmt: skip


ROWS = [
    row("siamese", 6, {0: 0.1, 1: 0.2}),
    row("recurrent", 6, {0: 0.4, 1: 0.5}),
    row("siamese", 60, {0: 0.1}),
    row("recurrent", 60, {1: 0.5}),
    row("savn", 60, {0: 0.5, 1: 0.7}),
    row("savn, no inner step", 60, {0: 0.5, 1: 0.5}),
    row("savn", 201, {0: 0.5}),
]


def test_agents_are_compared_in_the_same_rooms_on_the_seeds_of_both():
    table = contributions(ROWS)
    rows = list(zip(*table.values(), strict=True))
    assert len(rows) == 3 * len(TASKS) * len(COMPARED_METRICS)
    success = {row[:2]: row[4:] for row in rows if row[2:4] == ("III", "sr")}
    assert success["memory", 6] == (pytest.approx(0.3), pytest.approx(0, abs=1e-12), 2)
    assert ("memory", 60) not in success
    mean, _, seeds = success["training to adapt, and adapting", 60]
    assert (mean, seeds) == (pytest.approx(0.2), 1)
    assert success["adapting in evaluation", 60][0] == pytest.approx(0.1)
    text = contributions_table(table)
    assert text[2].startswith("| memory | 6 | **+0.300 ± 0.000** | **+0.150 ± 0.000** |")
    assert contributions_table({name: [str(value) for value in column] for name, column in table.items()}) == text


def test_the_page_shows_them_where_there_are_any(tmp_path):
    text = write_study(tmp_path, {"many-rooms": ROWS}).read_text()
    assert "| adapting in evaluation | 60 |" in text
    assert (tmp_path / "tables" / "contributions.csv").exists()
    text = write_study(tmp_path / "one", {"many-rooms": ROWS[:1]}).read_text()
    assert "Differences between agents" not in text
