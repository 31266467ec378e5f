"""The committed tables of the documentation, and what copies those of a study there."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import compress
from pathlib import Path

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import columns_of_rows, read_table, write_bytes, write_table
from relm_irl_jax.hardware import load_stage_times
from relm_irl_jax.report.tables import MEAN, interval_of, methods_of
from relm_irl_jax.results import read_results
from relm_irl_jax.run_config import load_run_config
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.studies.ablation import BASE, COMPARED_METRICS
from relm_irl_jax.studies.page import RUN_TITLES, STUDY_TEXTS

ROOT = Path(__file__).parents[1]
TABLES = ROOT / "docs" / "tables"


def copy_tables(study: Path) -> None:
    """Copy a study's tables into `docs/tables`, and its figures into `docs`.

    Args:
        study: folder of the study.

    Raises:
        InputError: the folder holds no table that the pages show, or those of tiny rooms.
    """
    copied = [*_tables_of_runs(study), *_single_files(study)]
    tables = [(path, keys) for name, keys in MERGED.items() if (path := study / "tables" / f"{name}.csv").is_file()]
    # The committed times are those of two cores.
    if any(_on_accelerator(RunFolder(study / name)) for name in RUN_TITLES):
        tables = [(path, keys) for path, keys in tables if path.stem != "times"]
    examples = [row for path in sorted(study.glob("*.json")) if study.name == "examples" for row in _example_rows(path)]
    if not (copied or tables or examples):
        raise InputError(f"{study}: there is no table of the documentation; give the folder of a study or benchmark.")
    for path, target in copied:
        write_bytes(target, path.read_bytes())
    for path, keys in tables:
        table = read_table(path)
        _merge(path.name, _whole_pieces(table) if path.stem == "times" else table, keys)
    if examples:
        _merge("examples.csv", columns_of_rows(EXAMPLE_COLUMNS, dict.fromkeys(examples)), ("agent", "task"))


def _whole_pieces(times: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """The times of pieces that ran as a whole; those of variants alone are named after a colon."""
    whole = [":" not in piece for piece in times["piece"]]
    return {name: list(compress(column, whole)) for name, column in times.items()}


def _tables_of_runs(study: Path) -> Iterator[tuple[Path, Path]]:
    """The tables of a study's runs, and where they are committed."""
    for name in RUN_TITLES:
        run = RunFolder(study / name)
        if run.config.is_file() and load_run_config(run).scene.size == "tiny":
            raise InputError(f"{study}: {name} ran in tiny rooms, whose numbers mean nothing; give another study.")
        # The last bits differ between processors and GPUs, and so do agents; their tables stand side by side.
        committed = f"{name}-gpu" if _on_accelerator(run) else name
        for path in sorted((run.path / "tables").glob("*.csv")):
            if path.stem == "differences" or path.stem.startswith("task-"):
                yield path, TABLES / f"{committed}-{path.name}"


def _single_files(study: Path) -> Iterator[tuple[Path, Path]]:
    """Other tables and figures of a study, and where they are committed."""
    for name in ("map", "map-vizdoom"):
        for path in sorted((study / name).glob("*.csv")):
            yield path, TABLES / name / path.name
    for path, name in FILES.items():
        if (study / path).is_file():
            yield study / path, ROOT / "docs" / name
    if (path := study / "trainings" / "trainings.csv").is_file():
        on_cpu = read_table(path)["computer"][0].endswith("on cpu")
        yield path, TABLES / f"speed-trainings-{'cpu' if on_cpu else 'gpu'}.csv"


def _merge(name: str, new: Mapping[str, list[str]], keys: Sequence[str]) -> None:
    """Replace the rows of a committed table that another one has measured again."""
    committed = TABLES / name
    old = read_table(committed) if committed.exists() else {}
    table = merged(old, new, keys)
    write_table(committed, without_stale_changes(old, new, table) if "change" in table else table)


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
    return columns_of_rows(list(new), lines)


def without_stale_changes(
    old: Mapping[str, list[str]], new: Mapping[str, list[str]], table: dict[str, list[str]]
) -> dict[str, list[str]]:
    """Leave out changes from a base that was measured again with other results, where the variant was not.

    Args:
        old: columns of a committed table of a base and its variants.
        new: columns of the rows that were measured.
        table: both, as `merged` returns them.

    Returns:
        The columns; the changes of these variants are NaN.
    """

    def of_base(columns: Mapping[str, list[str]], agent: str) -> list[tuple[str, ...]]:
        rows = zip(*(columns.get(name, ()) for name in ("agent", "variant", "task", "metric", "mean")), strict=True)
        return [row for row in rows if row[:2] == (agent, BASE)]

    measured = set(zip(new["agent"], new["variant"], strict=True))
    other = {agent for agent, variant in measured if variant == BASE and of_base(old, agent) != of_base(new, agent)}
    rows = zip(table["agent"], table["variant"], strict=True)
    stale = [agent in other and (agent, variant) not in measured for agent, variant in rows]
    for name in ("change", "change_half_width"):
        table[name] = ["nan" if unknown else value for unknown, value in zip(stale, table[name], strict=True)]
    return table


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

EXAMPLE_COLUMNS = ("agent", "task", *COMPARED_METRICS)
"""Columns of the table of agents of other programs."""


def _on_accelerator(run: RunFolder) -> bool:
    """Whether a run was made with an accelerator."""
    path = run.hardware
    computers = load_stage_times(path).computers if path.is_file() else ()
    return any(set(computer.devices) != {"cpu"} for computer in computers)


def _example_rows(path: Path) -> list[tuple[str, ...]]:
    """Agent, task, SR and SPL of each agent of a file of results, means over room types and seeds."""
    results = read_results(path)
    return [
        (
            method,
            results.task,
            *(str(interval_of(results.rows, method, metric, MEAN).mean) for metric in COMPARED_METRICS),
        )
        for method in methods_of(results.rows)
    ]
