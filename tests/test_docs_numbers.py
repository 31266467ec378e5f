"""Numbers in the text of the pages are those of the committed tables.

What can be recognised is compared: values with their interval, and pairs of a success rate and SPL. The tables of the
pages themselves are compared with their files in `test_docs.py`.
"""

import re
from itertools import combinations
from pathlib import Path

import pytest

from relm_irl_jax.files import read_table

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"<!-- table: .*?<!-- /table -->", re.DOTALL)
NUMBER = r"[−+]?\d+\.\d+"
INTERVAL = re.compile(rf"({NUMBER})\s±\s({NUMBER})")
PAIR = re.compile(rf"({NUMBER})(?:\s±\s{NUMBER})?\s/\s({NUMBER})")
KEYS = ("method", "column", "agent", "variant", "task")
"""Columns that say what the metrics of a row are of."""

Pair = tuple[str, str]


def magnitude(number: str) -> float:
    """A number without its sign: texts say "behind by 0.22" of a difference of −0.22."""
    return abs(float(number.replace("−", "-")))


def says(text: Pair, found: Pair) -> bool:
    """Whether a pair of a text is a pair of a table, rounded to the text's digits; both may be rounded."""
    return all(
        abs(magnitude(said) - magnitude(true)) <= 0.5 * 10.0 ** -len(said.split(".")[1]) + 1e-9
        for said, true in zip(text, found, strict=True)
    )


def of_files() -> tuple[set[Pair], set[Pair]]:
    """The intervals of all committed files, and their pairs of success rate and SPL."""
    intervals, metrics = set[Pair](), set[Pair]()
    for path in sorted((ROOT / "docs" / "tables").glob("*.csv")):
        table = read_table(path)
        for name, values in table.items():
            widths = table.get("half_width" if name == "mean" else f"{name}_half_width", [])
            intervals |= set(zip(values, widths, strict=False))
        if {"metric", "mean"} <= set(table):
            rows: dict[tuple[str, ...], dict[str, str]] = {}
            keys = [table[key] for key in KEYS if key in table]
            for *key, metric, mean in zip(*keys, table["metric"], table["mean"], strict=True):
                rows.setdefault(tuple(key), {})[metric] = mean
            metrics |= {(row["sr"], row["spl"]) for row in rows.values() if {"sr", "spl"} <= set(row)}
    return intervals, metrics


def of_pages() -> tuple[set[Pair], set[Pair]]:
    """The intervals of the pages' tables, and all pairs of numbers that follow each other in one row."""
    lines = [line for page in PAGES for block in BLOCK.findall(page.read_text()) for line in block.splitlines()]
    intervals = {pair for line in lines for pair in INTERVAL.findall(line)}
    return intervals, {pair for line in lines for pair in combinations(re.findall(NUMBER, line), 2)}


INTERVALS, METRICS = (first | second for first, second in zip(of_files(), of_pages(), strict=True))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_numbers_of_the_text_are_in_a_committed_table(page):
    text = BLOCK.sub("", page.read_text())
    unknown = [pair for pair in set(INTERVAL.findall(text)) if not any(says(pair, found) for found in INTERVALS)]
    assert not unknown, "intervals"
    unknown = [pair for pair in set(PAIR.findall(text)) if not any(says(pair, found) for found in METRICS)]
    assert not unknown, "SR / SPL"


def test_a_number_of_no_table_is_recognised():
    assert INTERVAL.findall("SR is 0.64 ± 0.08, 0.97 ±\n0.01") == [("0.64", "0.08"), ("0.97", "0.01")]
    assert PAIR.findall("0.96 ± 0.01 / 0.87 and 0.55 / 0.38") == [("0.96", "0.87"), ("0.55", "0.38")]
    assert says(("0.24", "0.08"), ("+0.238", "0.076"))
    assert says(("0.22", "0.20"), ("-0.2204", "0.1996"))
    assert not says(("0.24", "0.08"), ("0.246", "0.076"))
    assert not says(("0.24", "0.08"), ("0.24", "0.09"))
    assert not any(says(("0.64", "0.99"), found) for found in INTERVALS)
