"""The tables of the documentation, from the committed CSV files and from nothing else: `make tables`.

    make tables RUN=runs/paper    copy the tables of a study into docs/tables and its figures into docs, then write the
                                  tables of the pages; rows of variants that this study has not run stay as they are
    make tables RUN=runs/bench    the same with what the benchmarks have measured
    make tables                   write those of the pages from docs/tables

A page says where a table belongs, and which, between two comments:

    <!-- table: tasks siamese -->        SR, PLE and SPL of a piece's methods on each task
    <!-- table: differences siamese -->  RELM-IRL minus the other methods, paired over seeds
    <!-- table: summary siamese siamese-long -->    SR and SPL of several pieces, and the paper's
    <!-- table: rooms unseen many-rooms -->         success in unseen rooms against the number of training rooms
    <!-- table: all-tasks many-rooms -->           SR and SPL on every task by agent and number of training rooms
    <!-- table: contributions -->                  what memory and adaptation add
    <!-- table: search -->                          the mapping agent in unseen rooms
    <!-- table: ranks -->                           ranks of targets by predicted reward
    <!-- table: variants ablation metric -->       a base and its variants, of all agents or those named
    <!-- table: selections -->                      accuracy of several ways to select neurons
    <!-- table: stability -->                       how stable reward weights are
    <!-- table: peers -->                           speed of every part beside another library
    <!-- table: trainings gpu -->                   frames per second of all agents' trainings
    <!-- table: scaling -->                         an update on several virtual devices
    <!-- table: maps map-vizdoom -->                the mapping agent in unseen recorded maps
    <!-- /table -->
"""

import math
import re
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from relm_irl_jax.benchmarks.rows import three_digits
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import read_table, write_bytes, write_table
from relm_irl_jax.report.comparison import BASELINES, markdown_difference
from relm_irl_jax.report.figures import as_png
from relm_irl_jax.report.intervals import MeanInterval, intervals_of_rows
from relm_irl_jax.report.names import TASK_NAMES, in_order, method_name, metric_name
from relm_irl_jax.report.tables import MEAN, paper_value
from relm_irl_jax.results import PREDICTED, TASKS
from relm_irl_jax.studies.ablation import BASE, METRICS, load_ablation
from relm_irl_jax.studies.contributions import contributions_table
from relm_irl_jax.studies.page import RUN_TITLES, STUDY_TEXTS
from relm_irl_jax.studies.reward_tables import selections_table, stability_table
from relm_irl_jax.studies.rooms_figure import counts_of_rooms, rooms_figure, unseen_by_rooms
from relm_irl_jax.studies.search_page import maps_table, saved_rows, search_table

ROOT = Path(__file__).parents[1]
TABLES = ROOT / "docs" / "tables"
PRESETS = ROOT / "experiments" / "paper"
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))

BLOCK = re.compile(r"(<!-- table: ([a-z-]+)((?: [\w-]+)*) -->\n).*?(<!-- /table -->)", re.DOTALL)
"""A table of a page: its first line, kind, arguments, and last line."""


def copy_tables(study: Path) -> None:
    """Copy a study's tables into `docs/tables`, and its figures into `docs`.

    Args:
        study: folder of the study.
    """
    for name in RUN_TITLES:
        for path in sorted((study / name / "tables").glob("*.csv")):
            if path.stem == "differences" or path.stem.startswith("task-"):
                shutil.copyfile(path, TABLES / f"{name}-{path.name}")
    for name, keys in MERGED.items():
        if (path := study / "tables" / f"{name}.csv").is_file():
            committed = TABLES / path.name
            write_table(committed, merged(read_table(committed) if committed.exists() else {}, read_table(path), keys))
    for name in ("map", "map-vizdoom"):
        for path in (study / name).glob("*.csv"):
            shutil.copyfile(path, TABLES / name / path.name)
    for path, name in FILES.items():
        if (study / path).is_file():
            shutil.copyfile(study / path, ROOT / "docs" / name)
    if (path := study / "trainings" / "trainings.csv").is_file():
        on_cpu = read_table(path)["computer"][0].endswith("on cpu")
        shutil.copyfile(path, TABLES / f"speed-trainings-{'cpu' if on_cpu else 'gpu'}.csv")


def merged(old: Mapping[str, list[str]], new: Mapping[str, list[str]], keys: Sequence[str]) -> dict[str, list[str]]:
    """Replace the rows of a table that another one has measured again.

    Args:
        old: columns of the table.
        new: columns of the same names, of some of its rows and of further ones.
        keys: the columns that name a row, or several rows that were measured together.

    Returns:
        The columns: of the rows whose keys both have, those of `new`; rows with the same first key stand together.
    """
    if old and list(old) != list(new):
        raise InputError(f"docs/tables: a table has columns {', '.join(old)} instead of {', '.join(new)}; remove it.")
    rows: dict[tuple[str, ...], list[tuple[str, ...]]] = {}
    for table in (old, new):
        measured: dict[tuple[str, ...], list[tuple[str, ...]]] = {}
        for line in zip(*table.values(), strict=True):
            row = dict(zip(table, line, strict=True))
            measured.setdefault(tuple(row[key] for key in keys), []).append(line)
        rows |= measured
    first = list(dict.fromkeys(key[0] for key in rows))
    lines = [line for key in sorted(rows, key=lambda key: first.index(key[0])) for line in rows[key]]
    return dict(zip(new, map(list, zip(*lines, strict=True)), strict=True))


MERGED = {
    **dict.fromkeys(STUDY_TEXTS, ("agent", "variant")),
    "contributions": ("part", "rooms"),
}
"""Tables of a study of which parts can be measured, and what names their parts."""

FILES = {
    "reward-ranks/reward-ranks.csv": "tables/reward-ranks.csv",
    "elm/choices.csv": "tables/elm-selections.csv",
    "stability/stability.csv": "tables/stability.csv",
    "peers/peers.csv": "tables/speed-peers.csv",
    "scaling/scaling.csv": "tables/speed-scaling.csv",
    "elm/figure-7.png": "elm-neurons.png",
    "elm/figure-8-10.png": "elm-predictions.png",
    "elm/figure-9.png": "elm-press.png",
}
"""Single tables and figures of a study, and their places in `docs`."""


def written(page: str) -> str:
    """A page with its tables written from `docs/tables`.

    Args:
        page: the page's text.

    Returns:
        The text with the tables as they must be.
    """

    def table(block: re.Match[str]) -> str:
        lines = KINDS[block[2]](*block[3].split())
        return f"{block[1]}\n" + "\n".join(lines) + f"\n\n{block[4]}"

    return BLOCK.sub(table, page)


def _intervals(
    table: str, *keys: str, columns: tuple[str, str] = ("mean", "half_width")
) -> Iterator[tuple[tuple[str, ...], MeanInterval]]:
    """The means and intervals of a committed table, each with the values of some columns."""
    return intervals_of_rows(read_table(TABLES / table), *keys, columns=columns)


def _values(name: str, task: str) -> dict[str, dict[str, MeanInterval]]:
    """Mean over room types of each method and metric."""
    found: dict[str, dict[str, MeanInterval]] = {}
    for (method, metric, column), value in _intervals(f"{name}-task-{task}.csv", "method", "metric", "column"):
        if column == MEAN:
            found.setdefault(method, {})[metric] = value
    return {method: found[method] for method in in_order(found)}


def _tasks(name: str) -> list[str]:
    """SR, PLE and SPL of all methods on each task, the paper's means in brackets."""
    lines = []
    for task in TASKS:
        lines += [f"| Task {task}: {TASK_NAMES[task]} | SR ↑ | PLE ↓ | SPL ↑ |", "|---|---:|---:|---:|"]
        for method, values in _values(name, task).items():
            cells = []
            for metric in ("sr", "ple", "spl"):
                reported = paper_value(task, method, metric, MEAN)
                cells.append(f"{values[metric]}" + ("" if math.isnan(reported) else f" ({reported:.2f})"))
            lines.append(f"| {method_name(method)} | " + " | ".join(cells) + " |")
        lines.append("")
    return lines[:-1]


def _differences(name: str) -> list[str]:
    """RELM-IRL minus each other method, bold where the interval excludes zero."""
    found = dict(_intervals(f"{name}-differences.csv", "task", "second", "metric"))
    lines = ["| RELM-IRL minus | " + " | ".join(f"Task {task}: SR | SPL" for task in TASKS) + " |"]
    lines.append("|---|" + "---:|---:|" * len(TASKS))
    for baseline in BASELINES:
        if any(key[1] == baseline for key in found):
            cells = [markdown_difference(found[task, baseline, metric]) for task in TASKS for metric in ("sr", "spl")]
            lines.append(f"| {method_name(baseline)} | " + " | ".join(cells) + " |")
    return lines


def _summary(*names: str) -> list[str]:
    """SR / SPL of the paper and of several pieces."""
    lines = ["| Task | Method | In the paper | " + " | ".join(SHORT[name] for name in names) + " |"]
    lines.append("|---|---|---:|" + "---:|" * len(names))
    for task in TASKS:
        pieces = [_values(name, task) for name in names]
        for number, method in enumerate(pieces[0]):
            reported = [paper_value(task, method, metric, MEAN) for metric in ("sr", "spl")]
            cells = ["" if math.isnan(reported[0]) else " / ".join(f"{value:.2f}" for value in reported)]
            for piece in pieces:
                values = piece.get(method)
                cells.append("" if values is None else f"{values['sr'].mean:.2f} / {values['spl'].mean:.2f}")
            lines.append(f"| {task if number == 0 else ''} | {method_name(method)} | " + " | ".join(cells) + " |")
    return lines


SHORT = {
    "siamese": "The paper's agent here, 20M frames",
    "siamese-long": "60M frames",
    "metric-long": "The metric agent, 10M frames",
}
"""Headings of the summary's columns."""


def _rooms(*names: str) -> list[str]:
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


def _all_tasks(name: str) -> list[str]:
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


def _search() -> list[str]:
    """The mapping agent in unseen rooms."""
    return search_table(saved_rows(TABLES / "map"), TABLES / "map")


def _ranks() -> list[str]:
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


def _variants(name: str, *agents: str) -> list[str]:
    """Values of a base and its variants, in brackets their change, bold where its interval excludes zero."""
    study = load_ablation(PRESETS / f"{name}.toml")
    keys = ("agent", "variant", "task", "metric")
    values = dict(_intervals(f"{name}.csv", *keys))
    changes = dict(_intervals(f"{name}.csv", *keys, columns=("change", "change_half_width")))
    ranks = dict(_intervals(f"{name}.csv", "agent", "variant", columns=("rank", "rank_half_width")))
    shown = [key for key in ranks if not agents or key[0] in agents]
    ranked = not all(math.isnan(ranks[key].mean) for key in shown)
    columns = [(task, metric) for task in ("I", "II") for metric in METRICS]
    headings = ["Agent", "", *(["Rank"] if ranked else [])]
    headings += [f"Task {task}: {metric_name(metric)}" for task, metric in columns]
    lines = ["| " + " | ".join(headings) + " |", "|---|---|" + "---:|" * (len(headings) - 2)]
    for agent, variant in shown:
        title = study.title if variant == BASE else study.variants[variant].title
        rank = ranks[agent, variant]
        cells = ["" if math.isnan(rank.mean) else f"{rank:.1f}"] if ranked else []
        for column in columns:
            value = values[agent, variant, *column]
            change = f"{value.mean:.2f} ({markdown_difference(changes[agent, variant, *column])})"
            cells.append(str(value) if variant == BASE else change)
        lines.append(f"| {agent} | {title} | " + " | ".join(cells) + " |")
    return lines


def _peers() -> list[str]:
    """Rates of this package and of the peer, and their ratio."""
    rows = read_table(TABLES / "speed-peers.csv")
    lines = ["| | | Here, per second | Peer | Its rate | Ratio |", "|---|---|---:|---|---:|---:|"]
    columns = (rows[name] for name in ("part", "unit", "ours", "peer", "theirs", "ratio"))
    for part, unit, ours, peer, theirs, ratio in zip(*columns, strict=True):
        rates = [three_digits(float(value)) for value in (ours, theirs, ratio)]
        lines.append(f"| {part} | {unit} | {rates[0]} | {peer} | {rates[1]} | {rates[2]} |")
    return [f"{rows['computer'][0]}:", "", *lines]


def _scaling() -> list[str]:
    """Updates on several virtual devices."""
    rows = read_table(TABLES / "speed-scaling.csv")
    measured = zip(*([float(x) for x in rows[name]] for name in ("devices", "workers", "update_seconds")), strict=True)
    lines = ["| Devices | Workers | Update | Ratio |", "|---:|---:|---:|---:|"]
    one = float(rows["update_seconds"][0]) / float(rows["devices"][0])
    for devices, workers, seconds in measured:
        lines.append(f"| {devices:.0f} | {workers:.0f} | {1e3 * seconds:.0f} ms | {seconds / (one * devices):.2f} |")
    return lines


def _trainings(device: str) -> list[str]:
    """Trainings of all agents on a kind of device."""
    rows = read_table(TABLES / f"speed-trainings-{device}.csv")
    lines = [
        "| Agent, method | Workers | Frames/s | Frames | Seconds | Compiling and first frames, in seconds |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    names = ("agent", "method", "workers", "frames_per_second", "frames", "other_chunks_seconds", "first_chunk_seconds")
    for agent, method, workers, rate, frames, seconds, first in zip(*(rows[name] for name in names), strict=True):
        cells = (
            workers,
            three_digits(float(rate)),
            three_digits(float(frames)),
            f"{float(seconds):.1f}",
            f"{float(first):.0f}",
        )
        lines.append(f"| {agent}, {method_name(method)} | " + " | ".join(cells) + " |")
    return [f"{rows['computer'][0]}:", "", *lines]


def _maps(name: str) -> list[str]:
    """The mapping agent in unseen recorded maps."""
    return maps_table(saved_rows(TABLES / name), TABLES / name)


KINDS: dict[str, Callable[..., list[str]]] = {
    "tasks": _tasks,
    "differences": _differences,
    "summary": _summary,
    "rooms": _rooms,
    "all-tasks": _all_tasks,
    "contributions": lambda: contributions_table(read_table(TABLES / "contributions.csv")),
    "search": _search,
    "ranks": _ranks,
    "variants": _variants,
    "selections": lambda: selections_table(TABLES / "elm-selections.csv"),
    "stability": lambda: stability_table(TABLES / "stability.csv"),
    "peers": _peers,
    "trainings": _trainings,
    "scaling": _scaling,
    "maps": _maps,
}
"""What fills a table, by kind."""


def main(arguments: Sequence[str]) -> None:
    """Copy the tables of the named studies, draw the figure over training rooms, and write the pages."""
    for study in arguments:
        copy_tables(Path(study))
    rooms = unseen_by_rooms(*(read_table(TABLES / f"{name}.csv") for name in ("unseen", "many-rooms")))
    write_bytes(ROOT / "docs" / "training-rooms.png", as_png(rooms_figure(rooms)))
    for page in PAGES:
        text = page.read_text()
        if (new := written(text)) != text:
            write_bytes(page, new.encode())


if __name__ == "__main__":
    main(sys.argv[1:])
