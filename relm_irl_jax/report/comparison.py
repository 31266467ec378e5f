"""Differences between methods on the same seeds, and what they allow to be said."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from relm_irl_jax.report.tables import METHOD_NAMES, METRIC_NAMES, Cell, by_seed, methods_of, summarise

OURS = "relm-irl"
"""The method that is compared."""

RIVALS = ("rl", "irl", "elm-irl")
"""The methods that it is compared with."""

Verdict = Literal["ahead of", "behind", "not distinguishable from"]

SMALLEST = 0.0005
"""A mean difference below this is shown as 0.000, and decides nothing."""


@dataclass(frozen=True)
class Difference:
    """RELM-IRL minus another method, paired over seeds.

    Attributes:
        task: `I`, `II` or `III`.
        rival: the other method.
        metric: `sr` or `spl`, more is better in both.
        value: mean difference and its 95% interval (Student's t over seeds).
        seeds: number of seeds that both have.
    """

    task: str
    rival: str
    metric: str
    value: Cell
    seeds: int

    @property
    def verdict(self) -> Verdict:
        """`ahead of` or `behind` where the difference is `decided`."""
        if not decided(self.value):
            return "not distinguishable from"
        return "ahead of" if self.value.mean > 0 else "behind"


def decided(value: Cell) -> bool:
    """Whether a difference's interval excludes zero, and the difference is not below `SMALLEST`.

    Args:
        value: the difference; one seed has no interval and decides nothing.

    Returns:
        Whether it does.
    """
    return abs(value.mean) > max(value.half_width, SMALLEST)


def marked(value: Cell) -> str:
    """A difference for a table, bold where it is `decided`.

    Args:
        value: the difference.

    Returns:
        Markdown.
    """
    return f"**{signed(value)}**" if decided(value) else signed(value)


def signed(value: Cell) -> str:
    """A difference with its sign.

    Args:
        value: the difference.

    Returns:
        Text such as `+0.110 ± 0.062`.
    """
    text = f"{value.mean:+.3f}".replace("-", "−")
    return text if np.isnan(value.half_width) else f"{text} ± {value.half_width:.3f}"


def paired(first: Mapping[int, float], second: Mapping[int, float]) -> tuple[Cell, int]:
    """Mean difference over the seeds that both have.

    Args:
        first: values by seed.
        second: values by seed, subtracted.

    Returns:
        The difference, and the number of seeds.
    """
    seeds = sorted(first.keys() & second.keys())
    return summarise([first[seed] - second[seed] for seed in seeds]), len(seeds)


def differences(results: Mapping[str, dict]) -> list[Difference]:
    """Compare RELM-IRL with every rival on every task.

    Args:
        results: contents of `results.json` by task.

    Returns:
        The differences of SR and SPL, averaged over room types.
    """
    found = []
    for task, record in results.items():
        rows = record["rows"]
        present = methods_of(rows)
        for rival in RIVALS if OURS in present else ():
            if rival not in present:
                continue
            for metric in ("sr", "spl"):
                value, seeds = paired(by_seed(rows, OURS, metric, "mean"), by_seed(rows, rival, metric, "mean"))
                found.append(Difference(task, rival, metric, value, seeds))
    return found


def difference_columns(found: Sequence[Difference]) -> dict[str, list]:
    """Differences as columns.

    Args:
        found: the differences.

    Returns:
        Columns for `write_table`.
    """
    return {
        "task": [d.task for d in found],
        "first": [OURS for _ in found],
        "second": [d.rival for d in found],
        "metric": [d.metric for d in found],
        "mean": [d.value.mean for d in found],
        "half_width": [d.value.half_width for d in found],
        "seeds": [d.seeds for d in found],
    }


def difference_table(found: Sequence[Difference]) -> str:
    """Differences for the report; those whose interval excludes zero are bold.

    Args:
        found: the differences.

    Returns:
        A Markdown table.
    """
    rows = dict.fromkeys((d.task, d.rival) for d in found)
    values = {(d.task, d.rival, d.metric): d for d in found}
    lines = ["| Task | Difference | SR | SPL |", "|---|---|---:|---:|"]
    for task, rival in rows:
        shown = [marked(values[task, rival, metric].value) for metric in ("sr", "spl")]
        lines.append(f"| {task} | {METHOD_NAMES[OURS]} − {METHOD_NAMES[rival]} | {' | '.join(shown)} |")
    return "\n".join(lines)


def statement(found: Sequence[Difference]) -> list[str]:
    """Say where RELM-IRL is ahead, behind, or neither, by the intervals alone.

    Args:
        found: the differences.

    Returns:
        One sentence a task; a single one where there are too few seeds.
    """
    if not found or min(d.seeds for d in found) < 2:
        return ["One seed says nothing about differences between methods; run more."]
    sentences = []
    for task in dict.fromkeys(d.task for d in found):
        parts = []
        for rival in dict.fromkeys(d.rival for d in found if d.task == task):
            own = [d for d in found if (d.task, d.rival) == (task, rival)]
            verdicts: dict[str, list[str]] = {}
            for d in own:
                name = METRIC_NAMES[d.metric].split()[0]
                verdicts.setdefault(d.verdict, []).append(f"{name} {signed(d.value)}")
            said = " and ".join(
                f"{verdict} {METHOD_NAMES[rival] if n == 0 else 'it'} ({', '.join(values)})"
                for n, (verdict, values) in enumerate(verdicts.items())
            )
            parts.append(said)
        sentences.append(f"Task {task}: {METHOD_NAMES[OURS]} is {'; '.join(parts)}.")
    return sentences
