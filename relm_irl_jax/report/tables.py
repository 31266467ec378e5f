"""The task's table in the paper's layout: methods × (PLE, SR, SPL) × room types and their mean."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.table import Table
from scipy.stats import t as student

from relm_irl_jax.report.paper import COLUMNS, PAPER
from relm_irl_jax.scenes.scene import ROOM_TYPES

METRICS = ("ple", "sr", "spl")
METRIC_NAMES = {"ple": "PLE ↓", "sr": "SR ↑", "spl": "SPL ↑"}
METHOD_NAMES = {"random": "Random", "bc": "BC", "rl": "RL", "irl": "IRL", "elm-irl": "ELM-IRL", "relm-irl": "RELM-IRL"}


@dataclass(frozen=True)
class Cell:
    """One value of the table.

    Attributes:
        mean: mean over seeds of the mean over scenes.
        half_width: half of the 95% interval over seeds (Student's t); NaN with one seed.
    """

    mean: float
    half_width: float

    def __format__(self, form: str) -> str:
        """The mean, with the interval where there is one, both in a form such as `.1f`; `.2f` where none is given."""
        numbers = (self.mean,) if np.isnan(self.half_width) else (self.mean, self.half_width)
        return " ± ".join(format(number, form or ".2f") for number in numbers)

    def __str__(self) -> str:
        """The mean, with the interval where there is one."""
        return format(self)


def columns_of(rows: Sequence[dict]) -> tuple[str, ...]:
    """Columns of the table: the room types that the results hold, the paper's first, then their mean.

    Args:
        rows: rows of `results.json`.

    Returns:
        Column names.
    """
    found = {row["room_type"] for row in rows}
    ordered = [name for name in ROOM_TYPES if name in found] + sorted(found - set(ROOM_TYPES))
    return (*ordered, "mean")


def summarise(values: Sequence[float]) -> Cell:
    """Mean and 95% interval of one value a seed.

    Args:
        values: the values.

    Returns:
        The cell; the interval is Student's t with one degree of freedom less than values, NaN where that is none.
    """
    if len(values) < 2:
        return Cell(float(np.mean(values)) if values else np.nan, np.nan)
    error = np.std(values, ddof=1) / np.sqrt(len(values))
    return Cell(float(np.mean(values)), float(student.ppf(0.975, len(values) - 1) * error))


def by_seed(rows: Sequence[dict], method: str, metric: str, column: str) -> dict[int, float]:
    """One value a seed: the mean over the scenes of a room type, or over room types.

    Args:
        rows: rows of `results.json`.
        method: method.
        metric: `sr`, `ple` or `spl`.
        column: room type, or `mean` for the mean over room types.

    Returns:
        Values by seed.
    """
    own = [row for row in rows if row["method"] == method]
    room_types = [name for name in columns_of(rows)[:-1] if column in (name, "mean")]
    return {
        seed: float(
            np.mean(
                [
                    np.mean([row[metric] for row in own if row["seed"] == seed and row["room_type"] == name])
                    for name in room_types
                ]
            )
        )
        for seed in sorted({row["seed"] for row in own})
    }


def cell(rows: Sequence[dict], method: str, metric: str, column: str) -> Cell:
    """Summarise one method, metric and column.

    Args:
        rows: rows of `results.json`.
        method: method.
        metric: `sr`, `ple` or `spl`.
        column: room type, or `mean` for the mean over room types.

    Returns:
        The cell; NaN where there are no rows.
    """
    return summarise(list(by_seed(rows, method, metric, column).values()))


def separate_best(rows: Sequence[dict], metric: str, column: str) -> str | None:
    """The best method, where its interval lies apart from every other one's.

    Args:
        rows: rows of `results.json`.
        metric: `sr`, `ple` or `spl`.
        column: room type or `mean`.

    Returns:
        The method; None where intervals overlap, or there are none.
    """
    sign = -1.0 if metric == "ple" else 1.0
    cells = {method: cell(rows, method, metric, column) for method in methods_of(rows)}
    best = max(cells, key=lambda method: sign * cells[method].mean)
    least = sign * cells[best].mean - cells[best].half_width
    others = [sign * c.mean + c.half_width for method, c in cells.items() if method != best]
    return best if others and all(least > other for other in others) else None


def methods_of(rows: Sequence[dict]) -> list[str]:
    """Methods that the results hold, in the order of the paper's tables.

    Args:
        rows: rows of `results.json`.

    Returns:
        Method names.
    """
    found = {row["method"] for row in rows}
    return [name for name in METHOD_NAMES if name in found]


def readable(column: str) -> str:
    """A column's name as a heading."""
    return column.replace("_", " ").capitalize()


def console_table(results: dict) -> Table:
    """The table for the terminal.

    Args:
        results: contents of `results.json`.

    Returns:
        The table.
    """
    rows = results["rows"]
    columns = columns_of(rows)
    table = Table(title=f"Task {results['task']}: cap {results['cap']}, encoder {results['encoder']}")
    for heading in ("Method", "Metric", *map(readable, columns)):
        table.add_column(heading, justify="left" if heading in ("Method", "Metric") else "right")
    for method in methods_of(rows):
        for position, metric in enumerate(METRICS):
            table.add_row(
                METHOD_NAMES[method] if position == 0 else "",
                METRIC_NAMES[metric],
                *(str(cell(rows, method, metric, column)) for column in columns),
                end_section=position == len(METRICS) - 1,
            )
    return table


def markdown_table(results: dict) -> str:
    """The table for the report, the paper's numbers beside ours in brackets.

    Args:
        results: contents of `results.json`.

    Returns:
        A Markdown table.
    """
    rows = results["rows"]
    columns = columns_of(rows)
    paper = PAPER[results["task"]]
    lines = ["| Method | Metric | " + " | ".join(map(readable, columns)) + " |", "|---|---|" + "---:|" * len(columns)]
    for method in methods_of(rows):
        for metric in METRICS:
            cells = []
            for column in columns:
                text = str(cell(rows, method, metric, column))
                if separate_best(rows, metric, column) == method:
                    text = f"**{text}**"
                if method in paper and column in COLUMNS:
                    text += f" ({paper[method][metric][COLUMNS.index(column)]:.2f})"
                cells.append(text)
            lines.append(f"| {METHOD_NAMES[method]} | {METRIC_NAMES[metric]} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def table_columns(results: dict) -> dict[str, list]:
    """The table as columns, one row for each method, metric and room type.

    Args:
        results: contents of `results.json`.

    Returns:
        Columns for `write_table`: the mean, half of the 95% interval, the number of seeds, whether the value is best by
        intervals that lie apart, and the paper's number.
    """
    rows, paper = results["rows"], PAPER[results["task"]]
    table = []
    for method in methods_of(rows):
        for metric in METRICS:
            for column in columns_of(rows):
                values = list(by_seed(rows, method, metric, column).values())
                shown = summarise(values)
                printed = method in paper and column in COLUMNS
                theirs = paper[method][metric][COLUMNS.index(column)] if printed else np.nan
                best = separate_best(rows, metric, column) == method
                table.append((method, metric, column, shown.mean, shown.half_width, len(values), best, theirs))
    names = ("method", "metric", "column", "mean", "half_width", "seeds", "best", "paper")
    return dict(zip(names, map(list, zip(*table, strict=True)), strict=True))
