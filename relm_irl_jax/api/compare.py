"""Several results in one table."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_json
from relm_irl_jax.report.tables import console_table, markdown_table
from relm_irl_jax.results import ResultRow, Results, Task, load_results, read_results, results_to_dict
from relm_irl_jax.run_folder import RunFolder


@dataclass(frozen=True, eq=False)
class Comparison:
    """Results side by side; notebooks show it as a table, `print` shows it in a terminal.

    Attributes:
        results: the rows of all of them.
    """

    results: Results

    def __str__(self) -> str:
        """The table for a terminal: means over seeds, with 95% intervals where there are several seeds."""
        from rich.console import Console

        console = Console(width=120, markup=False, emoji=False)
        with console.capture() as capture:
            console.print(console_table(self.results))
        return capture.get()

    def _repr_markdown_(self) -> str:
        return markdown_table(self.results)

    def save(self, path: str | Path) -> None:
        """Write all rows in the form of `results.json`, which `relm-irl evaluate --results` and `compare` read.

        Args:
            path: the file.
        """
        write_json(Path(path), results_to_dict(self.results))


def compare(*results: Results | Comparison | str | Path, task: Task | None = None) -> Comparison:
    """Put results into one table.

    Args:
        results: what `evaluate` returned, run folders, or files in the form of `results.json`.
        task: task of which run folders' results are read; by default the one evaluated last.

    Returns:
        The comparison.

    Raises:
        InputError: a file cannot be read, two results have a method's name in common, or they were not measured alike:
            with the same task, cap, scenes, seeds and numbers of episodes.
    """
    loaded = [_loaded(given, task) for given in results]
    if not loaded:
        raise InputError("compare: there is nothing to compare; give results of evaluate, or run folders.")
    return Comparison(joined(loaded))


def _loaded(given: Results | Comparison | str | Path, task: Task | None) -> Results:
    if isinstance(given, Comparison):
        return given.results
    if isinstance(given, Results):
        return given
    path = Path(given)
    return load_results(RunFolder(path), task) if path.is_dir() else read_results(path)


def joined(results: Iterable[Results]) -> Results:
    """Rows of several results, after checking that they were measured alike.

    Args:
        results: at least one.

    Returns:
        All rows; where encoders differ, all their names.

    Raises:
        InputError: see `compare`.
    """
    first, *others = results
    rows, encoders = list(first.rows), {first.encoder: None}
    for other in others:
        for field in ("task", "cap"):
            ours, theirs = getattr(first, field), getattr(other, field)
            if ours != theirs:
                raise InputError(f"compare: {field} is {ours} in one and {theirs} in the other; evaluate both alike.")
        if both := {row.method for row in rows} & {row.method for row in other.rows}:
            raise InputError(f"compare: {min(both)} is in both; give one of them another name.")
        if difference := _measured(first.rows) ^ _measured(other.rows):
            scene, seed, episodes = min(difference)
            raise InputError(
                f"compare: only one of them has {episodes} episodes in {scene} with seed {seed}; evaluate both on the "
                "same scenes, seeds and numbers of episodes."
            )
        rows += other.rows
        encoders[other.encoder] = None
    return replace(first, encoder=", ".join(encoders), rows=tuple(rows))


def _measured(rows: Iterable[ResultRow]) -> set[tuple[str, int, int]]:
    return {(row.scene, row.seed, row.episodes) for row in rows}
