"""Time of whole commands, each from nothing: an empty folder, empty caches, and a process of its own.

Writes `commands.csv` and prints the table. Packages are installed; rooms, features and compiled programs are not there.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from relm_irl_jax.benchmarks.rows import write_rows
from relm_irl_jax.benchmarks.timing import describe_computer
from relm_irl_jax.progress import progress_bar

COMMANDS = (("train", "--task", "II"), ("train", "--task", "III", "--agent", "map"))
"""The default run, and the mapping agent in unseen rooms."""


@dataclass(frozen=True)
class CommandTime:
    """How long a command took.

    Attributes:
        command: its words.
        seconds: duration.
        processor_seconds: what all its processes used of the cores.
        computer: processor, cores, load before it began, JAX version and device.
    """

    command: str
    seconds: float
    processor_seconds: float
    computer: str


def measure(words: Sequence[str]) -> CommandTime:
    """Time one command.

    Args:
        words: the words after `relm-irl`.

    Returns:
        The row.

    Raises:
        subprocess.CalledProcessError: the command failed.
    """
    computer = describe_computer()
    with tempfile.TemporaryDirectory(prefix="relm-irl-") as empty:
        environment = {name: value for name, value in os.environ.items() if not name.startswith("JAX_COMPILATION")}
        environment |= {"XDG_CACHE_HOME": f"{empty}/cache"}
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "relm_irl_jax", *words, "--run", f"{empty}/run"],
            check=True,
            env=environment,
            stdout=subprocess.DEVNULL,
        )
        seconds, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return CommandTime(f"relm-irl {' '.join(words)}", round(seconds, 1), round(used, 1), computer)


def main(
    folder: Path = Path("runs/bench/commands"), commands: Sequence[Sequence[str]] = COMMANDS
) -> tuple[CommandTime, ...]:
    """Run the benchmark.

    Args:
        folder: output folder of the table.
        commands: the words of each command.

    Returns:
        The rows.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[CommandTime] = []
    with progress_bar("whole commands", len(commands), "commands") as advance:
        for words in commands:
            rows.append(measure(words))
            write_rows(folder / "commands.csv", rows)
            advance(1)
    table = Table(title=rows[0].computer, padding=(0, 0))
    for heading in ("command", "s", "s of the cores"):
        table.add_column(heading, justify="left" if heading == "command" else "right")
    for row in rows:
        table.add_row(row.command, f"{row.seconds:.0f}", f"{row.processor_seconds:.0f}")
    Console().print(table)
    return tuple(rows)
