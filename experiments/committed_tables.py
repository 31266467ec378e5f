"""The committed tables of the documentation, and what copies those of a study there."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import read_table, write_table
from relm_irl_jax.hardware import load_stage_times
from relm_irl_jax.report.tables import MEAN, interval_of, methods_of
from relm_irl_jax.results import read_results
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.studies.ablation import METRICS
from relm_irl_jax.studies.page import RUN_TITLES, STUDY_TEXTS

ROOT = Path(__file__).parents[1]
TABLES = ROOT / "docs" / "tables"


def copy_tables(study: Path) -> None:
    """Copy a study's tables into `docs/tables`, and its figures into `docs`.

    Args:
        study: folder of the study.
    """
    for name in RUN_TITLES:
        # The last bits differ between processors and GPUs, and so do agents; their tables stand side by side.
        copied = f"{name}-gpu" if _on_accelerator(study / name) else name
        for path in sorted((study / name / "tables").glob("*.csv")):
            if path.stem == "differences" or path.stem.startswith("task-"):
                shutil.copyfile(path, TABLES / f"{copied}-{path.name}")
    for name, keys in MERGED.items():
        if (path := study / "tables" / f"{name}.csv").is_file():
            committed = TABLES / path.name
            write_table(committed, merged(read_table(committed) if committed.exists() else {}, read_table(path), keys))
    if rows := [row for path in sorted((study / "examples").glob("*.json")) for row in _example_rows(path)]:
        write_table(
            TABLES / "examples.csv", dict(zip(EXAMPLE_COLUMNS, zip(*dict.fromkeys(rows), strict=True), strict=True))
        )
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
    "times": ("piece",),
}
"""Tables of a study of which parts can be measured, and what names their parts."""

FILES = {
    "tables/task-II.csv": "tables/default-task-II.csv",
    "reward-ranks/reward-ranks.csv": "tables/reward-ranks.csv",
    "elm/choices.csv": "tables/elm-selections.csv",
    "stability/stability.csv": "tables/stability.csv",
    "peers/peers.csv": "tables/speed-peers.csv",
    "scaling/scaling.csv": "tables/speed-scaling.csv",
    "commands/commands.csv": "tables/speed-commands.csv",
    "gym/gym.csv": "tables/speed-gym.csv",
    "chaos.csv": "tables/chaos.csv",
    "fuzz.csv": "tables/fuzz.csv",
    "elm/figure-7.csv": "tables/elm-neurons.csv",
    "elm/figure-7.png": "elm-neurons.png",
    "elm/figure-8-10.png": "elm-predictions.png",
    "elm/figure-9.png": "elm-press.png",
}
"""Single tables and figures of a study, and their places in `docs`."""

EXAMPLE_COLUMNS = ("agent", "task", *METRICS)
"""Columns of the table of agents of other programs."""


def _on_accelerator(run: Path) -> bool:
    """Whether a run was made with an accelerator."""
    path = RunFolder(run).hardware
    return path.is_file() and list(load_stage_times(path).hardware.devices) != ["cpu"]


def _example_rows(path: Path) -> list[tuple[str | float, ...]]:
    """Agent, task, SR and SPL of each agent of a file of results, means over room types and seeds."""
    results = read_results(path)
    return [
        (method, results.task, *(interval_of(results.rows, method, metric, MEAN).mean for metric in METRICS))
        for method in methods_of(results.rows)
    ]
