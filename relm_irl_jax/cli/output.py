"""What commands print: text as it is, and the table and finding of a run."""

from pathlib import Path

from rich.console import Console

from relm_irl_jax.results import Results
from relm_irl_jax.run_folder import RunFolder


def standard_output() -> Console:
    """Standard output; names and paths are printed as they are, not as markup."""
    return Console(markup=False, emoji=False)


def show_results(results: Results, folder: Path) -> None:
    """Print a run's table, what was found, and where its report is.

    Args:
        results: the results of one task.
        folder: the run folder.
    """
    # Imported here, since commands that print no results load statistics for nothing.
    from relm_irl_jax.report.finding import finding
    from relm_irl_jax.report.tables import console_table

    console = standard_output()
    console.print(console_table(results))
    console.print(" ".join(finding(results)), highlight=False)
    console.print(f"Report: {RunFolder(folder).report}", highlight=False, soft_wrap=True)
