"""Tables of results in the pages, from `docs/tables`."""

import math
from collections.abc import Iterator

from committed_tables import EXAMPLE_COLUMNS, ROOT, TABLES

from relm_irl_jax.files import read_table
from relm_irl_jax.report.comparison import BASELINES, markdown_difference
from relm_irl_jax.report.intervals import MeanInterval, intervals_of_rows
from relm_irl_jax.report.names import TASK_NAMES, in_order, method_name, metric_name
from relm_irl_jax.report.tables import MEAN, paper_value
from relm_irl_jax.results import PREDICTED, TASKS
from relm_irl_jax.studies.ablation import BASE, COMPARED_METRICS, load_ablation
from relm_irl_jax.studies.rooms_figure import counts_of_rooms, unseen_by_rooms
from relm_irl_jax.studies.search_page import (
    failed_rooms_table,
    learned_rewards_table,
    maps_table,
    saved_rows,
    search_table,
)

PRESETS = ROOT / "experiments" / "paper"


def _intervals(
    table: str, *keys: str, columns: tuple[str, str] = ("mean", "half_width")
) -> Iterator[tuple[tuple[str, ...], MeanInterval]]:
    """The means and intervals of a committed table, each with the values of some columns."""
    return intervals_of_rows(read_table(TABLES / table), *keys, columns=columns)


Values = dict[str, dict[str, MeanInterval]]
"""Means over room types, by method and metric."""


def by_method(name: str, task: str) -> Values:
    """Mean over room types of each method and metric of a piece, methods in the order of the tables."""
    found: Values = {}
    for (method, metric, column), value in _intervals(f"{name}-task-{task}.csv", "method", "metric", "column"):
        if column == MEAN:
            found.setdefault(method, {})[metric] = value
    return {method: found[method] for method in in_order(found)}


def tasks(name: str) -> list[str]:
    """SR, PLE and SPL of all methods on each task, the paper's means in brackets."""
    lines = []
    for task in TASKS:
        lines += [f"| Task {task}: {TASK_NAMES[task]} | SR ↑ | PLE ↓ | SPL ↑ |", "|---|---:|---:|---:|"]
        for method, values in by_method(name, task).items():
            cells = []
            for metric in ("sr", "ple", "spl"):
                reported = paper_value(task, method, metric, MEAN)
                cells.append(f"{values[metric]}" + ("" if math.isnan(reported) else f" ({reported:.2f})"))
            lines.append(f"| {method_name(method)} | " + " | ".join(cells) + " |")
        lines.append("")
    return lines[:-1]


def differences(name: str) -> list[str]:
    """RELM-IRL minus each other method, bold where the interval excludes zero."""
    found = dict(_intervals(f"{name}-differences.csv", "task", "second", "metric"))
    lines = ["| RELM-IRL minus | " + " | ".join(f"Task {task}: SR | SPL" for task in TASKS) + " |"]
    lines.append("|---|" + "---:|---:|" * len(TASKS))
    for baseline in BASELINES:
        if any(key[1] == baseline for key in found):
            cells = [markdown_difference(found[task, baseline, metric]) for task in TASKS for metric in ("sr", "spl")]
            lines.append(f"| {method_name(baseline)} | " + " | ".join(cells) + " |")
    return lines


def summary() -> list[str]:
    """SR / SPL of the paper and of the pieces of the claims."""
    lines = ["| Task | Method | In the paper | " + " | ".join(CLAIM_PIECES.values()) + " |"]
    lines.append("|---|---|---:|" + "---:|" * len(CLAIM_PIECES))
    for task in TASKS:
        pieces = [by_method(name, task) for name in CLAIM_PIECES]
        for number, method in enumerate(in_order(set().union(*pieces))):
            reported = [paper_value(task, method, metric, MEAN) for metric in ("sr", "spl")]
            cells = ["" if math.isnan(reported[0]) else " / ".join(f"{value:.2f}" for value in reported)]
            for piece in pieces:
                values = piece.get(method)
                cells.append("" if values is None else f"{values['sr'].mean:.2f} / {values['spl'].mean:.2f}")
            lines.append(f"| {task if number == 0 else ''} | {method_name(method)} | " + " | ".join(cells) + " |")
    return lines


CLAIM_PIECES = {
    "siamese-given": "Given targets alone, 5M frames",
    "siamese": "Imagined ones too, 20M frames",
    "siamese-long": "Imagined ones too, 60M frames",
}
"""The pieces of the summary and of the claims' figure, and their headings there."""


def rooms(*names: str) -> list[str]:
    """SR / SPL on Task III by agent and number of training rooms."""
    lines = unseen_by_rooms(*(read_table(TABLES / f"{name}.csv") for name in names))
    counts = counts_of_rooms(lines)
    heads = [" or ".join(map(str, near)) for near in counts]
    table = ["| SR / SPL in unseen rooms, trained on | " + " | ".join(f"{head} rooms" for head in heads) + " |"]
    table.append("|---|" + "---:|" * len(counts))
    for line, by_rooms in lines.items():
        values = [next((by_rooms[count] for count in near if count in by_rooms), None) for near in counts]
        cells = ["" if value is None else f"{value['sr']} / {value['spl']}" for value in values]
        table.append(f"| {line} | " + " | ".join(cells) + " |")
    return table


def all_tasks(name: str) -> list[str]:
    """SR / SPL on every task by agent and number of training rooms."""
    found: dict[tuple[str, str, str], dict[tuple[str, str], MeanInterval]] = {}
    for (line, rooms, frames, task, metric), value in _intervals(
        f"{name}.csv", "line", "rooms", "frames", "task", "metric"
    ):
        found.setdefault((line, rooms, frames), {})[task, metric] = value
    heads = " | ".join(f"Task {task}: SR / SPL" for task in TASKS)
    lines = [f"| Agent | Training rooms | Frames | {heads} |", "|---|---:|---:|" + "---:|" * len(TASKS)]
    for (line, rooms, frames), values in found.items():
        cells = [f"{values[task, 'sr']} / {values[task, 'spl']}" for task in TASKS]
        lines.append(f"| {line} | {rooms} | {float(frames) / 1e6:g}M | " + " | ".join(cells) + " |")
    return lines


def search() -> list[str]:
    """The mapping agent in unseen rooms."""
    return search_table(saved_rows(TABLES / "map"), TABLES / "map")


def learned_rewards() -> list[str]:
    """What learned rewards change in the mapping agent's search."""
    return learned_rewards_table(saved_rows(TABLES / "map"), TABLES / "map")


def failed_rooms() -> list[str]:
    """The unseen rooms in which the mapping agent fails."""
    rows = [row for row in saved_rows(TABLES / "map") if row.agent == "map" and row.task == "III"]
    return failed_rooms_table(rows, TABLES / "map")


def maps(name: str) -> list[str]:
    """The mapping agent in unseen recorded maps."""
    return maps_table(saved_rows(TABLES / name), TABLES / name)


def ranks() -> list[str]:
    """Median rank of new, uniformly drawn and unseen targets by the predicted reward."""
    found = dict(_intervals("reward-ranks.csv", "variant", "title", "method", "targets"))
    groups = {"new": "new targets", "uniform": "uniform targets", "unseen": "unseen scenes"}
    columns = [(method, targets) for targets in groups for method in PREDICTED]
    lines = ["| | " + " | ".join(f"{method_name(m)}, {groups[targets]}" for m, targets in columns) + " |"]
    lines.append("|---|" + "---:|" * len(columns))
    for variant, title in dict.fromkeys(key[:2] for key in found):
        cells = [f"{(v := found[variant, title, *column]).mean:.1f} ± {v.half_width:.1f}" for column in columns]
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    return lines


def variants(name: str, *agents: str) -> list[str]:
    """Values of a base and its variants, in brackets their change, bold where its interval excludes zero."""
    study = load_ablation(PRESETS / f"{name}.toml")
    keys = ("agent", "variant", "task", "metric")
    values = dict(_intervals(f"{name}.csv", *keys))
    changes = dict(_intervals(f"{name}.csv", *keys, columns=("change", "change_half_width")))
    ranks = dict(_intervals(f"{name}.csv", "agent", "variant", columns=("rank", "rank_half_width")))
    shown = [key for key in ranks if not agents or key[0] in agents]
    ranked = not all(math.isnan(ranks[key].mean) for key in shown)
    columns = [(task, metric) for task in ("I", "II") for metric in COMPARED_METRICS]
    headings = ["Agent", "", *(["Rank"] if ranked else [])]
    headings += [f"Task {task}: {metric_name(metric)}" for task, metric in columns]
    lines = ["| " + " | ".join(headings) + " |", "|---|---|" + "---:|" * (len(headings) - 2)]
    for agent, variant in shown:
        title = study.title if variant == BASE else study.variants[variant].title
        rank = ranks[agent, variant]
        cells = ["" if math.isnan(rank.mean) else f"{rank:.1f}"] if ranked else []
        for column in columns:
            value = values[agent, variant, *column]
            change = changes[agent, variant, *column]
            unknown = variant == BASE or math.isnan(change.mean)
            cells.append(str(value) if unknown else f"{value.mean:.2f} ({markdown_difference(change)})")
        lines.append(f"| {agent} | {title} | " + " | ".join(cells) + " |")
    return lines


def examples() -> list[str]:
    """SR / SPL of agents of other programs."""
    rows = read_table(TABLES / "examples.csv")
    values: dict[str, dict[str, str]] = {}
    for agent, task, sr, spl in zip(*(rows[name] for name in EXAMPLE_COLUMNS), strict=True):
        values.setdefault(agent, {})[task] = f"{float(sr):.2f} / {float(spl):.2f}"
    tasks = sorted(dict.fromkeys(rows["task"]))
    lines = ["| | " + " | ".join(f"Task {task}: {TASK_NAMES[task]}" for task in tasks) + " |"]
    lines.append("|---|" + "---:|" * len(tasks))
    for agent in in_order(values):
        lines.append(f"| {method_name(agent)} | " + " | ".join(values[agent].get(task, "") for task in tasks) + " |")
    return lines
