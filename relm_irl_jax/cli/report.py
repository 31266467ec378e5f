"""The command `relm-irl report`."""

from relm_irl_jax.cli.output import show_results
from relm_irl_jax.commands import Report
from relm_irl_jax.report.run_report import write_report
from relm_irl_jax.report.run_settings import load_run_settings
from relm_irl_jax.results import load_results
from relm_irl_jax.run_config import locked
from relm_irl_jax.run_folder import RunFolder


def execute(command: Report) -> None:
    """Write the report of a run again.

    Args:
        command: the arguments.
    """
    folder = RunFolder(command.run)
    load_run_settings(folder)  # refuses other folders before the lock is created there
    with locked(folder):
        write_report(folder)
    show_results(load_results(folder), folder.path)
