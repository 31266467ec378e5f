"""Several results in one table."""

from dataclasses import dataclass
from pathlib import Path

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_json
from relm_irl_jax.report.tables import console_table, markdown_table
from relm_irl_jax.results import Results, Task, join_results, load_results, read_results, results_to_dict
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
    return Comparison(join_results(loaded))


def _loaded(given: Results | Comparison | str | Path, task: Task | None) -> Results:
    if isinstance(given, Comparison):
        return given.results
    if isinstance(given, Results):
        return given
    path = Path(given)
    return load_results(RunFolder(path), task) if path.is_dir() else read_results(path)
