"""What memory and adaptation add: paired differences between agents that were trained on the same rooms."""

from collections.abc import Mapping, Sequence

from relm_irl_jax.report.comparison import markdown_difference
from relm_irl_jax.report.intervals import MeanInterval, intervals_of_rows, paired_difference
from relm_irl_jax.report.names import metric_name
from relm_irl_jax.results import TASKS
from relm_irl_jax.studies.ablation import COMPARED_METRICS, AblationRow

CONTRIBUTIONS = {
    "memory": ("recurrent", "siamese"),
    "training to adapt, and adapting": ("savn", "recurrent"),
    "adapting in evaluation": ("savn", "savn, no inner step"),
}
"""What is added, and the lines whose difference says how much: with it, and without."""


def contributions(rows: Sequence[AblationRow]) -> dict[str, list]:
    """What each part adds, in each number of training rooms in which both lines have a seed in common.

    Args:
        rows: rows of a study that differ in the agent and in the number of training rooms.

    Returns:
        Columns for `write_table`: a row for each part, number of rooms, task and metric, with the mean difference over
        seeds and half of its 95% interval.
    """
    by_line = {(row.line, row.rooms): row.by_seed for row in rows}
    columns: dict[str, list] = {name: [] for name in ("part", "rooms", "task", "metric", "mean", "half_width", "seeds")}
    for part, (with_it, without) in CONTRIBUTIONS.items():
        for rooms in sorted({row.rooms for row in rows}):
            second = by_line.get((without, rooms), {})
            for key, values in by_line.get((with_it, rooms), {}).items():
                difference, seeds = paired_difference(values, second.get(key, {}))
                if seeds:
                    row = (part, rooms, *key, difference.mean, difference.half_width, seeds)
                    for column, value in zip(columns.values(), row, strict=True):
                        column.append(value)
    return columns


def contributions_table(table: Mapping[str, Sequence]) -> list[str]:
    """The differences as a table, bold where the interval excludes zero.

    Args:
        table: columns as `contributions` returns them, or as they are read from a file.

    Returns:
        Lines of a Markdown table.
    """
    found: dict[tuple[str, int], dict[tuple[str, str], MeanInterval]] = {}
    for (part, rooms, task, metric), value in intervals_of_rows(table, "part", "rooms", "task", "metric"):
        found.setdefault((part, int(rooms)), {})[task, metric] = value
    keys = [(task, metric) for task in TASKS for metric in COMPARED_METRICS]
    lines = ["| Added | Rooms | " + " | ".join(f"Task {task}: {metric_name(metric)}" for task, metric in keys) + " |"]
    lines.append("|---|---:|" + "---:|" * len(keys))
    for (part, rooms), differences in found.items():
        cells = [markdown_difference(differences[key]) for key in keys]
        lines.append(f"| {part} | {rooms} | " + " | ".join(cells) + " |")
    return lines
