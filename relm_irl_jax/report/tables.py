"""The tables of a run: metrics of a task in the paper's layout (methods × metrics × room types), quality of rewards."""

from collections.abc import Mapping, Sequence

import numpy as np
from rich.table import Table

from relm_irl_jax.files import columns_of_rows
from relm_irl_jax.report.intervals import MeanInterval, mean_interval
from relm_irl_jax.report.names import METRIC_NAMES, as_text, heading, in_order, method_name
from relm_irl_jax.report.paper import COLUMNS, PAPER
from relm_irl_jax.results import ResultRow, Results, RewardQualityRow, is_of_run
from relm_irl_jax.scenes.settings import ROOM_TYPES

METRICS = tuple(METRIC_NAMES)

MEAN = "mean"
"""Name of the column with the mean over room types."""

TARGET_GROUPS = {"trained": "trained", "new": "of Task II", "uniform": "of Task II, drawn uniformly"}
"""Names of the groups of targets in the table of reward quality."""


def columns_of(rows: Sequence[ResultRow]) -> tuple[str, ...]:
    """Columns of a task's table: the room types of the rows, with the paper's first, and the mean.

    Args:
        rows: the rows.

    Returns:
        Column names.
    """
    found = {row.room_type for row in rows}
    return (*(name for name in ROOM_TYPES if name in found), *sorted(found - set(ROOM_TYPES)), MEAN)


def methods_of(rows: Sequence[ResultRow]) -> list[str]:
    """Methods of the rows, the paper's first and in the order of its tables.

    Args:
        rows: the rows.

    Returns:
        Method names.
    """
    return in_order({row.method for row in rows})


def seeds_of(rows: Sequence[ResultRow]) -> list[int]:
    """Seeds of the rows, ascending.

    Args:
        rows: the rows.

    Returns:
        The seeds.
    """
    return sorted({row.seed for row in rows})


def by_seed(rows: Sequence[ResultRow], method: str, metric: str, column: str) -> dict[int, float]:
    """One value for each seed: the mean over the scenes of a room type, or the mean of these means over room types.

    Args:
        rows: the rows.
        method: the method.
        metric: `sr`, `ple` or `spl`.
        column: a room type, or `mean`.

    Returns:
        Values by seed, without seeds for which a room type is missing.
    """
    of_method = [row for row in rows if row.method == method]
    room_types = [name for name in columns_of(rows)[:-1] if column in (name, MEAN)]
    values = {}
    for seed in seeds_of(of_method):
        scenes = [
            [getattr(row, metric) for row in of_method if (row.seed, row.room_type) == (seed, name)]
            for name in room_types
        ]
        if all(scenes):
            values[seed] = float(np.mean([np.mean(of_type) for of_type in scenes]))
    return values


def interval_of(rows: Sequence[ResultRow], method: str, metric: str, column: str) -> MeanInterval:
    """Mean and interval over seeds of one method, metric and column.

    Args:
        rows: the rows.
        method: the method.
        metric: `sr`, `ple` or `spl`.
        column: a room type, or `mean`.

    Returns:
        The mean and its interval; NaN if there are no rows.
    """
    return mean_interval(list(by_seed(rows, method, metric, column).values()))


def separate_best(rows: Sequence[ResultRow], metric: str, column: str) -> str | None:
    """The best method, if its interval does not overlap the interval of any other method.

    Args:
        rows: the rows; those of other agents and of other programs are not compared, since they have other means.
        metric: `sr`, `ple` or `spl`.
        column: a room type, or `mean`.

    Returns:
        The method; None if intervals overlap or are undefined.
    """
    of_run = [row for row in rows if is_of_run(row)]
    sign = -1.0 if metric == "ple" else 1.0
    intervals = {method: interval_of(of_run, method, metric, column) for method in methods_of(of_run)}
    if len(intervals) < 2:
        return None
    best = max(intervals, key=lambda method: sign * intervals[method].mean)
    lower_end = sign * intervals[best].mean - intervals[best].half_width
    others = [sign * value.mean + value.half_width for method, value in intervals.items() if method != best]
    return best if all(lower_end > other for other in others) else None


def paper_value(task: str, method: str, metric: str, column: str) -> float:
    """The paper's number.

    Args:
        task: the task.
        method: the method.
        metric: `sr`, `ple` or `spl`.
        column: a room type, or `mean`.

    Returns:
        The number; NaN if the paper has none.
    """
    printed = PAPER[task].get(method)
    return np.nan if printed is None or column not in COLUMNS else printed[metric][COLUMNS.index(column)]


def console_table(results: Results) -> Table:
    """The metrics of a task for the terminal.

    Args:
        results: the metrics.

    Returns:
        The table.
    """
    rows, columns = results.rows, columns_of(results.rows)
    table = Table(title=f"Task {results.task}: cap {results.cap}, encoder {results.encoder}")
    for name in ("Method", "Metric", *map(heading, columns)):
        table.add_column(name, justify="left" if name in ("Method", "Metric") else "right")
    for method in methods_of(rows):
        for position, metric in enumerate(METRICS):
            table.add_row(
                method_name(method) if position == 0 else "",
                METRIC_NAMES[metric],
                *(str(interval_of(rows, method, metric, column)) for column in columns),
                end_section=position == len(METRICS) - 1,
            )
    return table


def markdown_table(results: Results) -> str:
    """The metrics of a task for the report, with the paper's numbers in brackets.

    Args:
        results: the metrics.

    Returns:
        A Markdown table.
    """
    rows, columns = results.rows, columns_of(results.rows)
    best = {(metric, column): separate_best(rows, metric, column) for metric in METRICS for column in columns}
    lines = [
        "| Method | Metric | " + " | ".join(as_text(heading(column)) for column in columns) + " |",
        "|---|---|" + "---:|" * len(columns),
    ]
    for method in methods_of(rows):
        for metric in METRICS:
            texts = []
            for column in columns:
                text = str(interval_of(rows, method, metric, column))
                if best[metric, column] == method:
                    text = f"**{text}**"
                paper = paper_value(results.task, method, metric, column)
                texts.append(text if np.isnan(paper) else f"{text} ({paper:.2f})")
            lines.append(f"| {as_text(method_name(method))} | {METRIC_NAMES[metric]} | " + " | ".join(texts) + " |")
    return "\n".join(lines)


def table_columns(results: Results) -> dict[str, list]:
    """The metrics of a task as columns, one row for each method, metric and room type.

    Args:
        results: the metrics.

    Returns:
        Columns for `write_table`: the mean, half of the 95% interval, the number of seeds, whether the method is
        `separate_best`, and the paper's number.
    """
    rows, columns = results.rows, columns_of(results.rows)
    best = {(metric, column): separate_best(rows, metric, column) for metric in METRICS for column in columns}
    table = []
    for method in methods_of(rows):
        for metric, column in best:
            values = list(by_seed(rows, method, metric, column).values())
            shown, is_best = mean_interval(values), best[metric, column] == method
            paper = paper_value(results.task, method, metric, column)
            table.append((method, metric, column, shown.mean, shown.half_width, len(values), is_best, paper))
    names = ("method", "metric", "column", "mean", "half_width", "seeds", "best", "paper")
    return columns_of_rows(names, table)


def quality_table(quality: Mapping[int, Sequence[RewardQualityRow]]) -> str:
    """The quality of the learned rewards for the report.

    Args:
        quality: the rows of each seed.

    Returns:
        A Markdown table: means over seeds and their intervals.
    """
    rows = [row for of_seed in quality.values() for row in of_seed]
    lines = ["| Reward | Targets | Rank of the target | Order of states |", "|---|---|---:|---:|"]
    for targets, name in TARGET_GROUPS.items():
        for method in in_order({row.method for row in rows if row.targets == targets}):
            of_method = [row for row in rows if (row.method, row.targets) == (method, targets)]
            rank = mean_interval([row.median_rank for row in of_method])
            order = mean_interval([row.mean_order for row in of_method])
            lines.append(f"| {as_text(method_name(method))} | {name} | {rank:.1f} | {order} |")
    return "\n".join(lines)
