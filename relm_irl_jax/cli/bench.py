"""The command `relm-irl bench`."""

from importlib import import_module

from relm_irl_jax.commands import Bench
from relm_irl_jax.files import ensure_writable


def execute(command: Bench) -> None:
    """Run a benchmark.

    Args:
        command: the arguments.
    """
    if command.name != "encoder":
        ensure_writable(command.out)
    benchmark = import_module(f"relm_irl_jax.benchmarks.{command.name}")
    benchmark.main(*(() if command.name == "encoder" else (command.out / command.name,)))
