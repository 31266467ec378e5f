"""The report's part on the mapping agent in unseen scenes: tables of its rows and of the episodes that fail."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from relm_irl_jax.files import read_numbers, read_table
from relm_irl_jax.report.comparison import markdown_difference
from relm_irl_jax.report.intervals import paired_difference
from relm_irl_jax.report.names import heading
from relm_irl_jax.report.tables import MEAN, by_seed, columns_of, interval_of
from relm_irl_jax.results import ResultRow, Task
from relm_irl_jax.scenes.settings import ROOM_TYPES
from relm_irl_jax.studies.ablation import COMPARED_METRICS

METRIC_COLUMNS = ("seed", "scene", "room_type", "episodes", "sr", "ple", "spl")
"""Columns of a row's file: one line for each scene and seed."""

FAILURE_COLUMNS = ("seed", "scene", "category", "target", "start", "shortest")
"""Columns of the file of a row's failed episodes."""

NAMES = {
    "map": "Mapping agent",
    "package": "Mapping agent, weights of the built-in rooms",
    "random": "Random",
    "oracle": "Oracle: shortest paths",
    "explorer": "Systematic exploration, no network",
    "memoryless": "Memoryless: a map of the current view alone",
    "rl-prices": "Every step alike, as under RL's reward",
    "elm-irl-prices": "ELM-IRL's reward prices steps",
    "relm-irl-prices": "RELM-IRL's reward prices steps",
    "relm-irl-prior": "RELM-IRL's reward as a prior of places",
}
"""What is measured, by name."""

ORDER = (
    *("oracle", "map", "package", "memoryless", "explorer", "random"),
    *("rl-prices", "elm-irl-prices", "relm-irl-prices", "relm-irl-prior"),
)

ALIKE, LEARNED = "rl-prices", ("elm-irl-prices", "relm-irl-prices", "relm-irl-prior")
"""The search as it is, and with learned rewards, on the same episodes."""


@dataclass(frozen=True)
class SearchRow:
    """One row of the study.

    Attributes:
        agent: a name in `NAMES`.
        task: the task.
        first_room: number of the first room of each type.
        memory: memory at the start, `empty` or `filled`.
        episodes: episodes of each scene and seed.
    """

    agent: str
    task: Task
    first_room: int
    memory: Literal["empty", "filled"]
    episodes: int

    def path(self, out: Path) -> Path:
        """File of the row's metrics in the study's folder."""
        return out / f"{self.agent}-{self.task}-{self.first_room}-{self.memory}.csv"

    def failures(self, out: Path) -> Path:
        """File of the row's failed episodes."""
        return out / "failures" / self.path(out).name


def search_section(out: Path) -> list[str]:
    """The tables of the rows that are there.

    Args:
        out: folder of the rows.

    Returns:
        Lines of Markdown; none without rows.
    """
    found = saved_rows(out)
    if not found:
        return []
    return [
        "## The mapping agent in rooms never seen",
        "",
        "Success rate / SPL, means over seeds ± half of the 95% interval (Student's t). Its weights were trained on "
        "600 generated rooms that no task uses. It is told no pose, no map and no distance, and uses no learned "
        "reward but in the rows that name one.",
        "",
        *search_table(found, out),
        "",
        *learned_rewards_table(found, out),
        "",
        *failure_table([row for row in found if row.agent == "map"], out),
        "",
    ]


def maps_section(out: Path) -> list[str]:
    """The table of recorded maps, if its rows are there.

    Args:
        out: folder of the rows.

    Returns:
        Lines of Markdown; none without rows.
    """
    found = saved_rows(out)
    if not found:
        return []
    return [
        "## The mapping agent in recorded maps never seen",
        "",
        "Success rate / SPL. The agent was trained on the other maps of the same folder, with one seed.",
        "",
        *maps_table(found, out),
        "",
    ]


def maps_table(rows: Sequence[SearchRow], out: Path) -> list[str]:
    """A table of success rate and SPL by scene, and their means over scenes.

    Args:
        rows: the rows, all with the same scenes.
        out: folder of the rows.

    Returns:
        Lines of Markdown.
    """
    tables = [read_table(row.path(out)) for row in rows]
    lines = ["| | Episodes | " + " | ".join(tables[0]["scene"]) + " | Mean |", "|---|---:|"]
    lines[1] += "---:|" * (len(tables[0]["scene"]) + 1)
    for row, table in zip(rows, tables, strict=True):
        values = np.array([table["sr"], table["spl"]], float)
        cells = [f"{sr:.2f} / {spl:.2f}" for sr, spl in (*values.T, values.mean(1))]
        lines.append(f"| {NAMES[row.agent]} | {sum(map(int, table['episodes'])):,} | " + " | ".join(cells) + " |")
    return lines


def saved_rows(out: Path) -> list[SearchRow]:
    """The rows whose metrics are in a folder.

    Args:
        out: the folder.

    Returns:
        The rows in the order of tables, Task III first.
    """
    found = [_row_of(path) for path in out.glob("*-*-*-*.csv")]
    return sorted(
        found, key=lambda row: (row.task != "III", row.task, row.first_room, ORDER.index(row.agent), row.memory)
    )


def search_table(rows: Sequence[SearchRow], out: Path) -> list[str]:
    """A table of success rate and SPL by room type.

    Args:
        rows: the rows.
        out: folder of the rows.

    Returns:
        Lines of Markdown.
    """
    columns = (*ROOM_TYPES, MEAN)
    lines = ["| Task | Rooms | | Episodes | " + " | ".join(heading(column) for column in columns) + " |"]
    lines.append("|---|---|---|---:|" + "---|" * len(columns))
    for row in rows:
        results = _results(row, out)
        values = [
            " / ".join(str(interval_of(results, row.agent, metric, column)) for metric in COMPARED_METRICS)
            if column in columns_of(results)
            else ""
            for column in columns
        ]
        scenes = sorted({int(result.scene.rsplit("-", 1)[1]) for result in results})
        name = NAMES[row.agent] + (", memory filled" if row.memory == "filled" else "")
        runs = sum(result.episodes for result in results)
        lines.append(f"| {row.task} | {scenes[0]}–{scenes[-1]} | {name} | {runs:,} | " + " | ".join(values) + " |")
    return lines


def learned_rewards_table(rows: Sequence[SearchRow], out: Path) -> list[str]:
    """A table of what learned rewards change in the search, paired over seeds.

    Args:
        rows: the rows.
        out: folder of the rows.

    Returns:
        Lines of Markdown; none where the row without a learned reward, or those with one, are missing.
    """
    results = {row.agent: _results(row, out) for row in rows if row.agent in (ALIKE, *LEARNED)}
    if ALIKE not in results or len(results) == 1:
        return []
    lines = ["| Minus the search without a learned reward | SR | SPL |", "|---|---:|---:|"]
    for agent in LEARNED:
        if agent in results:
            pairs = [
                [by_seed(results[name], name, metric, MEAN) for name in (agent, ALIKE)] for metric in COMPARED_METRICS
            ]
            cells = [markdown_difference(paired_difference(*pair)[0]) for pair in pairs]
            lines.append(f"| {NAMES[agent]} | " + " | ".join(cells) + " |")
    return lines


def failed_rooms_table(rows: Sequence[SearchRow], out: Path, shown: int = 3) -> list[str]:
    """A table of the rooms in which most episodes fail.

    Args:
        rows: the rows to count.
        out: folder of the rows.
        shown: number of rooms; the others are one line.

    Returns:
        Lines of Markdown.
    """
    failed, episodes = Counter[str](), Counter[str]()
    for result in (result for row in rows for result in _results(row, out)):
        episodes[result.scene] += result.episodes
        failed[result.scene] += round(result.episodes * (1 - result.sr))
    most = failed.most_common(shown)
    others = {scene: number for scene, number in failed.items() if scene not in dict(most) and number}
    lines = ["| Room | Failed | Episodes |", "|---|---:|---:|"]
    lines += [f"| `{scene}` | {number:,} | {episodes[scene]:,} |" for scene, number in most]
    if others:
        number, runs = sum(others.values()), sum(episodes[scene] for scene in others)
        lines.append(f"| {len(others)} others | {number:,} | {runs:,} |")
    lines.append(f"| all {len(episodes)} | {failed.total():,} | {episodes.total():,} |")
    return lines


def failure_table(rows: Sequence[SearchRow], out: Path) -> list[str]:
    """A table of the failed episodes by room and by what the target shows.

    Args:
        rows: the rows.
        out: folder of the rows.

    Returns:
        Lines of Markdown.
    """
    if not rows:
        return []
    lines = ["| Task | Memory | Rooms | Failed | Where | What the target shows |", "|---|---|---|---:|---|---|"]
    for row in rows:
        table, metrics = read_table(row.failures(out)), read_table(row.path(out))
        total = sum(map(int, metrics["episodes"]))
        table = table or {name: [] for name in FAILURE_COLUMNS}
        count = lambda name, table=table: ", ".join(  # noqa: E731
            f"{what or 'no object'} {n}" for what, n in Counter(table[name]).most_common(5)
        )
        failed = f"{len(table['scene'])} of {total:,}"
        where = f"from {row.first_room}"
        lines.append(f"| {row.task} | {row.memory} | {where} | {failed} | {count('scene')} | {count('category')} |")
    return lines


def _results(row: SearchRow, out: Path) -> list[ResultRow]:
    """A row's metrics by scene and seed, as results of its agent."""
    path = row.path(out)
    words, numbers = read_table(path), read_numbers(path, ("seed", "episodes", "sr", "ple", "spl"))
    places = zip(*(words.get(name, [""] * len(numbers["sr"])) for name in ("scene", "room_type")), strict=True)
    return [
        ResultRow(
            method=row.agent,
            scene=scene,
            room_type=room_type,
            seed=int(seed),
            episodes=int(episodes),
            sr=float(sr),
            ple=float(ple),
            spl=float(spl),
        )
        for (scene, room_type), seed, episodes, sr, ple, spl in zip(places, *numbers.values(), strict=True)
    ]


def _row_of(path: Path) -> SearchRow:
    agent, task, first, memory = path.stem.rsplit("-", 3)
    episodes = int(read_numbers(path, ["episodes"])["episodes"].max(initial=0))
    return SearchRow(agent, task, int(first), memory, episodes)  # pyrefly: ignore
