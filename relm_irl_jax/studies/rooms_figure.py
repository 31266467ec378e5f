"""The figure of success in unseen rooms against the number of training rooms."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from relm_irl_jax.report.names import metric_name
from relm_irl_jax.studies.ablation import METRICS, AblationRow


def rooms_figure(rows: Sequence[AblationRow]) -> Figure:
    """Draw SR and SPL on Task III against the number of training rooms, one line for each agent.

    Args:
        rows: rows of studies that differ in the number of training rooms.

    Returns:
        The figure; bars are 95% intervals over seeds.
    """
    figure = Figure(figsize=(9.2, 3.6), layout="constrained")
    panels = figure.subplots(1, len(METRICS))
    for panel, metric in zip(panels, METRICS, strict=True):
        for number, line in enumerate(dict.fromkeys(row.line for row in rows)):
            of_line = sorted((row for row in rows if row.line == line), key=lambda row: row.rooms)
            values = [row.value["III", metric] for row in of_line]
            panel.errorbar(
                [row.rooms for row in of_line],
                [value.mean for value in values],
                [value.half_width for value in values],
                color=f"C{number}",
                marker="o",
                ms=4,
                lw=1.3,
                capsize=2,
                label=line,
            )
        panel.set(
            xscale="log", xlabel="training rooms", ylabel=f"{metric_name(metric)} in unseen rooms", ylim=(0, 1.02)
        )
        counts = sorted({row.rooms for row in rows})
        panel.set_xticks(counts, [str(count) for count in counts])
        panel.minorticks_off()
    panels[-1].legend(frameon=False, fontsize=7.5)
    return figure
