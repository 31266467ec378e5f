"""Differences between methods on the same seeds, and what they allow to be said."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from relm_irl_jax.report.intervals import MeanInterval, paired_difference
from relm_irl_jax.report.names import METHOD_NAMES, metric_name
from relm_irl_jax.report.tables import MEAN, by_seed, methods_of
from relm_irl_jax.results import Results, Task

OURS = "relm-irl"
"""The method that is compared."""

BASELINES = ("rl", "irl", "elm-irl")
"""The methods that it is compared with."""

Verdict = Literal["ahead of", "behind", "not distinguishable from"]

SMALLEST_DIFFERENCE = 0.0005
"""A mean difference below this is shown as 0.000, and decides nothing."""


@dataclass(frozen=True)
class PairedDifference:
    """RELM-IRL minus another method, paired over seeds and averaged over room types.

    Attributes:
        task: `I`, `II` or `III`.
        baseline: the other method.
        metric: `sr` or `spl`, more is better in both.
        value: mean difference and its 95% interval.
        seeds: number of seeds that both have.
    """

    task: str
    baseline: str
    metric: str
    value: MeanInterval
    seeds: int

    @property
    def verdict(self) -> Verdict:
        """`ahead of` or `behind` where the difference is significant."""
        if not is_significant(self.value):
            return "not distinguishable from"
        return "ahead of" if self.value.mean > 0 else "behind"


def is_significant(difference: MeanInterval) -> bool:
    """Whether a difference's interval excludes zero, and the difference is not below `SMALLEST_DIFFERENCE`.

    Args:
        difference: the difference; one seed has no interval and decides nothing.

    Returns:
        Whether it does.
    """
    return abs(difference.mean) > max(difference.half_width, SMALLEST_DIFFERENCE)


def signed(difference: MeanInterval) -> str:
    """A difference with its sign.

    Args:
        difference: the difference.

    Returns:
        Text such as `+0.110 ± 0.062`.
    """
    text = f"{difference.mean:+.3f}".replace("-", "−")
    return text if np.isnan(difference.half_width) else f"{text} ± {difference.half_width:.3f}"


def markdown_difference(difference: MeanInterval) -> str:
    """A difference for a table, bold where it is significant.

    Args:
        difference: the difference.

    Returns:
        Markdown.
    """
    return f"**{signed(difference)}**" if is_significant(difference) else signed(difference)


def differences(results: Mapping[Task, Results]) -> list[PairedDifference]:
    """Compare RELM-IRL with every baseline on every task.

    Args:
        results: metrics by task.

    Returns:
        The differences of SR and SPL over at least two paired seeds; one seed decides nothing.
    """
    found = []
    for task, of_task in results.items():
        present = methods_of(of_task.rows)
        for baseline in BASELINES if OURS in present else ():
            if baseline not in present:
                continue
            for metric in ("sr", "spl"):
                ours, theirs = (by_seed(of_task.rows, method, metric, MEAN) for method in (OURS, baseline))
                value, seeds = paired_difference(ours, theirs)
                if seeds > 1:
                    found.append(PairedDifference(task, baseline, metric, value, seeds))
    return found


def difference_columns(found: Sequence[PairedDifference]) -> dict[str, list]:
    """Differences as columns.

    Args:
        found: the differences.

    Returns:
        Columns for `write_table`.
    """
    return {
        "task": [d.task for d in found],
        "first": [OURS for _ in found],
        "second": [d.baseline for d in found],
        "metric": [d.metric for d in found],
        "mean": [d.value.mean for d in found],
        "half_width": [d.value.half_width for d in found],
        "seeds": [d.seeds for d in found],
    }


def difference_table(found: Sequence[PairedDifference]) -> str:
    """Differences for the report; significant ones are bold.

    Args:
        found: the differences.

    Returns:
        A Markdown table.
    """
    values = {(d.task, d.baseline, d.metric): d.value for d in found}
    lines = ["| Task | Difference | SR | SPL |", "|---|---|---:|---:|"]
    for task, baseline in dict.fromkeys((d.task, d.baseline) for d in found):
        shown = [markdown_difference(values[task, baseline, metric]) for metric in ("sr", "spl")]
        lines.append(f"| {task} | {METHOD_NAMES[OURS]} − {METHOD_NAMES[baseline]} | {' | '.join(shown)} |")
    return "\n".join(lines)


def statement(found: Sequence[PairedDifference]) -> list[str]:
    """Say where RELM-IRL is ahead, behind, or neither, by the intervals alone.

    Args:
        found: the differences.

    Returns:
        One sentence a task; a single one where there are too few seeds.
    """
    if not found:
        return ["One seed says nothing about differences between methods; run more."]
    sentences = []
    for task in dict.fromkeys(d.task for d in found):
        parts = []
        for baseline in dict.fromkeys(d.baseline for d in found if d.task == task):
            by_verdict: dict[str, list[str]] = {}
            for d in found:
                if (d.task, d.baseline) == (task, baseline):
                    by_verdict.setdefault(d.verdict, []).append(f"{metric_name(d.metric)} {signed(d.value)}")
            parts.append(
                " and ".join(
                    f"{verdict} {METHOD_NAMES[baseline] if number == 0 else 'it'} ({', '.join(values)})"
                    for number, (verdict, values) in enumerate(by_verdict.items())
                )
            )
        sentences.append(f"Task {task}: {METHOD_NAMES[OURS]} is {'; '.join(parts)}.")
    return sentences
