"""The figure of the paper's claims: success on every task, of the paper and of the pieces that repeat it."""

import math
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from result_tables import CLAIM_PIECES, by_method

from relm_irl_jax.report.figures import method_colour
from relm_irl_jax.report.names import TASK_NAMES, in_order, method_name, metric_name
from relm_irl_jax.report.tables import MEAN, paper_value
from relm_irl_jax.results import TASKS

METRIC_OF_TASK = {"I": "spl", "II": "sr", "III": "sr"}
"""What is drawn: nearly every agent finds trained targets, by paths of different length."""

MARKS = (("D", False), ("o", False), ("o", True))
"""Shapes of the pieces' marks, and whether they are filled."""


def claims_figure() -> Figure:
    """Draw each method's metric on the three tasks, for every piece of the claims.

    Returns:
        The figure: one panel for each task, one line for each method, one mark with its 95% interval for each piece
        that has the method; a cross where the paper reports a mean.
    """
    marks = dict(zip(CLAIM_PIECES, MARKS, strict=True))
    figure = Figure(figsize=(10.4, 3.4), layout="constrained")
    for panel, task in zip(figure.subplots(1, len(TASKS), sharey=True), TASKS, strict=True):
        metric = METRIC_OF_TASK[task]
        pieces = {name: by_method(name, task) for name in marks}
        methods = in_order(set().union(*pieces.values()))
        for line, method in enumerate(methods):
            colour = method_colour(method)
            for number, (name, mark) in enumerate(marks.items()):
                if method not in pieces[name]:
                    continue
                value = pieces[name][method][metric]
                height = line + 0.26 * (number - (len(marks) - 1) / 2)
                panel.errorbar(value.mean, height, xerr=value.half_width, ms=6, capsize=2, **_style(mark, colour))
            if not math.isnan(reported := paper_value(task, method, metric, MEAN)):
                panel.plot(reported, line, color=colour, marker="x", ms=8, ls="none")
        panel.set_yticks(range(len(methods)), [method_name(method) for method in methods])
        panel.set(xlim=(0, 1.02), ylim=(len(methods) - 0.5, -0.5), xlabel=metric_name(metric))
        panel.set_title(f"Task {task}: {TASK_NAMES[task]}", fontsize=9.5)
        panel.grid(axis="x", alpha=0.3)
    legend = {"In the paper": ("x", True)} | {heading: marks[name] for name, heading in CLAIM_PIECES.items()}
    handles = [Line2D([], [], ls="none", **_style(mark, "black")) for mark in legend.values()]
    figure.legend(handles, list(legend), loc="outside lower center", ncols=len(legend), frameon=False)
    return figure


def _style(mark: tuple[str, bool], colour: str) -> dict[str, Any]:
    """How a mark is drawn in a colour."""
    shape, filled = mark
    return {"color": colour, "marker": shape, "mfc": colour if filled else "white"}
