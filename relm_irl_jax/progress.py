"""Progress bars on standard error: units done, rate and remaining time.

Where standard error is a file, a bar is one line when it ends, and work that takes longer prints lines in between.
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column
from rich.text import Text

IN_NOTEBOOK = "ipykernel" in sys.modules

console = Console(
    stderr=True,
    markup=False,
    emoji=False,
    force_jupyter=False,
    force_terminal=False if IN_NOTEBOOK else None,
    width=100 if IN_NOTEBOOK else None,
)
"""Standard error. Names and paths are printed as they are, not as markup. In notebooks, where rich would need a package
of its own to move a bar, a bar is one line of text when it ends."""


FIRST_LINE = 60.0
"""Seconds after which a bar that does not move prints a line of its progress; the next ones follow after twice the time
each."""


class _Rate(ProgressColumn):
    """Completed units per second; after completion, the mean over the whole run."""

    def render(self, task: Task) -> Text:
        """Return the rate with its unit, or a dash before the first unit is done."""
        rate = task.completed / task.finished_time if task.finished_time else task.speed
        if rate is None:
            return Text("-", style="cyan")
        return Text(f"{rate:,.{0 if rate >= 10 else 1}f} {task.fields['unit']}/s", style="cyan")


@contextmanager
def progress_bar(description: str | None, total: int, unit: str) -> Iterator[Callable[[int], None]]:
    """Show a bar while the block runs. If the block ends without an error and anything was done, the bar ends at 100%.

    Args:
        description: label of the bar, for example `rendering bathroom-0`; None for no bar.
        total: number of units in total.
        unit: plural name of the unit, for example `views`.

    Yields:
        A function that takes the number of units done since its last call.
    """
    columns = (
        TextColumn("{task.description:<25}", markup=False, table_column=Column(no_wrap=True)),
        BarColumn(bar_width=5),
        MofNCompleteColumn(table_column=Column(no_wrap=True)),
        _Rate(table_column=Column(no_wrap=True)),
        TimeElapsedColumn(table_column=Column(no_wrap=True)),
        TimeRemainingColumn(table_column=Column(no_wrap=True)),
    )
    with Progress(*columns, console=console, disable=description is None) as progress:
        task = progress.add_task(description or "", total=total, unit=unit)
        began, next_line = time.monotonic(), FIRST_LINE
        lines = description is not None and not console.is_terminal

        def advance(done: int) -> None:
            # Agents round frames to whole updates; a bar ends at 100% all the same.
            completed = min(int(progress.tasks[0].completed) + done, total)
            progress.update(task, completed=completed)
            nonlocal next_line
            elapsed = time.monotonic() - began
            if lines and elapsed >= next_line and 0 < completed < total:
                next_line = 2 * elapsed
                left = timedelta(seconds=round(elapsed * (total / completed - 1)))
                console.print(
                    f"{description}: {completed:,} of {total:,} {unit}, about {left} left",
                    highlight=False,
                    soft_wrap=True,
                )

        yield advance
        if done := progress.tasks[0].completed:
            progress.update(task, total=done)
