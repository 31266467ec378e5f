"""The figure of the paper's claims: success on every task, of the paper and of the pieces that repeat it."""

import math
from collections.abc import Mapping

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from result_tables import SHORT, Values, by_method

from relm_irl_jax.report.figures import method_colour
from relm_irl_jax.report.names import TASK_NAMES, method_name, metric_name
from relm_irl_jax.report.tables import MEAN, paper_value
from relm_irl_jax.results import TASKS

METRIC_OF_TASK = {"I": "spl", "II": "sr", "III": "sr"}
"""What is drawn: nearly every agent finds trained targets, by paths of different length."""


def claims_figure(*names: str) -> Figure:
    """Draw each method's metric on the three tasks.

    Args:
        names: the pieces, in the order of their frames.

    Returns:
        The figure: one panel for each task, one line for each method, one circle with its 95% interval for each piece,
        filled for the last one; a cross where the paper reports a mean.
    """
    figure = Figure(figsize=(10.4, 3.4), layout="constrained")
    for panel, task in zip(figure.subplots(1, len(TASKS), sharey=True), TASKS, strict=True):
        metric = METRIC_OF_TASK[task]
        pieces: Mapping[str, Values] = {name: by_method(name, task) for name in names}
        methods = list(pieces[names[0]])
        for line, method in enumerate(methods):
            colour = method_colour(method)
            for number, found in enumerate(pieces.values()):
                value = found[method][metric]
                last = number == len(names) - 1
                height = line + 0.26 * (number - (len(names) - 1) / 2)
                panel.errorbar(
                    value.mean,
                    height,
                    xerr=value.half_width,
                    color=colour,
                    marker="o",
                    ms=6,
                    mfc=colour if last else "white",
                    capsize=2,
                )
            if not math.isnan(reported := paper_value(task, method, metric, MEAN)):
                panel.plot(reported, line, color=colour, marker="x", ms=8, ls="none")
        panel.set_yticks(range(len(methods)), [method_name(method) for method in methods])
        panel.set(xlim=(0, 1.02), ylim=(len(methods) - 0.5, -0.5), xlabel=metric_name(metric))
        panel.set_title(f"Task {task}: {TASK_NAMES[task]}", fontsize=9.5)
        panel.grid(axis="x", alpha=0.3)
    marks = {"In the paper": ("x", None)} | {
        SHORT[name]: ("o", "black" if name == names[-1] else "white") for name in names
    }
    handles = [Line2D([], [], color="black", marker=mark, mfc=fill, ls="none") for mark, fill in marks.values()]
    figure.legend(handles, list(marks), loc="outside lower center", ncols=len(marks), frameon=False)
    return figure
