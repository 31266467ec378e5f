"""Paired differences between methods on the same seeds, and conclusions from their confidence intervals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from relm_irl_jax.report.intervals import MeanInterval, paired_difference
from relm_irl_jax.report.names import METHOD_NAMES, metric_name
from relm_irl_jax.report.tables import MEAN, by_seed, methods_of
from relm_irl_jax.results import Results, Task

OURS = "relm-irl"
"""The method that is compared with the baselines."""

BASELINES = ("rl", "constant", "irl", "elm-irl")
"""The methods with which it is compared."""

Verdict = Literal["ahead of", "behind", "not distinguishable from"]

SMALLEST_DIFFERENCE = 0.0005
"""Mean differences below this are printed as 0.000, and never count as significant."""


@dataclass(frozen=True)
class PairedDifference:
    """RELM-IRL minus another method, paired over seeds and averaged over room types.

    Attributes:
        task: `I`, `II` or `III`.
        baseline: the other method.
        metric: `sr` or `spl`; for both, larger is better.
        value: mean difference and its 95% interval.
        seeds: number of seeds that both methods have.
    """

    task: str
    baseline: str
    metric: str
    value: MeanInterval
    seeds: int

    @property
    def verdict(self) -> Verdict:
        """`ahead of` or `behind` if the difference is significant."""
        if not is_significant(self.value):
            return "not distinguishable from"
        return "ahead of" if self.value.mean > 0 else "behind"


def is_significant(difference: MeanInterval) -> bool:
    """Whether a difference is significant: its interval excludes zero, and it exceeds `SMALLEST_DIFFERENCE`.

    Args:
        difference: the difference; with one seed it has no interval and is not significant.

    Returns:
        Whether it is significant.
    """
    return abs(difference.mean) > max(difference.half_width, SMALLEST_DIFFERENCE)


def signed(difference: MeanInterval) -> str:
    """Format a difference with its sign.

    Args:
        difference: the difference.

    Returns:
        Text such as `+0.110 ± 0.062`.
    """
    text = f"{difference.mean:+.3f}".replace("-", "−")
    return text if np.isnan(difference.half_width) else f"{text} ± {difference.half_width:.3f}"


def markdown_difference(difference: MeanInterval) -> str:
    """Format a difference for a Markdown table, bold if it is significant.

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
        The differences of SR and SPL over at least two paired seeds.
    """
    paired = []
    for task, of_task in results.items():
        present = methods_of(of_task.rows)
        for baseline in BASELINES if OURS in present else ():
            if baseline not in present:
                continue
            for metric in ("sr", "spl"):
                ours, theirs = (by_seed(of_task.rows, method, metric, MEAN) for method in (OURS, baseline))
                value, seeds = paired_difference(ours, theirs)
                if seeds > 1:
                    paired.append(PairedDifference(task, baseline, metric, value, seeds))
    return paired


def difference_columns(paired: Sequence[PairedDifference]) -> dict[str, list]:
    """Differences as columns.

    Args:
        paired: the differences.

    Returns:
        Columns for `write_table`.
    """
    return {
        "task": [d.task for d in paired],
        "first": [OURS for _ in paired],
        "second": [d.baseline for d in paired],
        "metric": [d.metric for d in paired],
        "mean": [d.value.mean for d in paired],
        "half_width": [d.value.half_width for d in paired],
        "seeds": [d.seeds for d in paired],
    }


def difference_table(paired: Sequence[PairedDifference]) -> str:
    """Differences as a table of the report; significant ones are bold.

    Args:
        paired: the differences.

    Returns:
        A Markdown table.
    """
    values = {(d.task, d.baseline, d.metric): d.value for d in paired}
    lines = ["| Task | Difference | SR | SPL |", "|---|---|---:|---:|"]
    for task, baseline in dict.fromkeys((d.task, d.baseline) for d in paired):
        shown = [markdown_difference(values[task, baseline, metric]) for metric in ("sr", "spl")]
        lines.append(f"| {task} | {METHOD_NAMES[OURS]} − {METHOD_NAMES[baseline]} | {' | '.join(shown)} |")
    return "\n".join(lines)


def statement(paired: Sequence[PairedDifference]) -> list[str]:
    """Say for each task whether RELM-IRL is significantly ahead of or behind each baseline.

    Args:
        paired: the differences.

    Returns:
        One sentence for each task that has differences.
    """
    sentences = []
    for task in dict.fromkeys(d.task for d in paired):
        parts = []
        for baseline in dict.fromkeys(d.baseline for d in paired if d.task == task):
            by_verdict: dict[str, list[str]] = {}
            for d in paired:
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
