"""The figure of success in unseen rooms against the number of training rooms."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from relm_irl_jax.report.intervals import MeanInterval, intervals_of_rows
from relm_irl_jax.report.names import metric_name
from relm_irl_jax.studies.ablation import COMPARED_METRICS

ByRooms = dict[str, dict[int, dict[str, MeanInterval]]]
"""Metrics in unseen rooms, by the line of the figure and the number of training rooms."""


def unseen_by_rooms(*tables: Mapping[str, Sequence]) -> ByRooms:
    """Collect SR and SPL on Task III from tables of studies.

    Args:
        tables: columns as `ablation_columns` returns them, or as they are read from a file.

    Returns:
        The metrics of each line, in the order of the tables.
    """
    found: ByRooms = {}
    for table in tables:
        for (line, rooms, task, metric), value in intervals_of_rows(table, "line", "rooms", "task", "metric"):
            if task == "III":
                found.setdefault(line, {}).setdefault(int(rooms), {})[metric] = value
    return found


def counts_of_rooms(lines: ByRooms) -> list[list[int]]:
    """Numbers of training rooms, those that differ by at most a hundredth together, such as 200 and 201.

    Args:
        lines: the metrics.

    Returns:
        The numbers in ascending order, in groups.
    """
    groups: list[list[int]] = []
    for count in sorted({count for by_rooms in lines.values() for count in by_rooms}):
        if groups and count <= 1.01 * groups[-1][0]:
            groups[-1].append(count)
        else:
            groups.append([count])
    return groups


def rooms_figure(lines: ByRooms) -> Figure:
    """Draw SR and SPL on Task III against the number of training rooms, one line for each agent.

    Args:
        lines: the metrics.

    Returns:
        The figure; bars are 95% intervals over seeds.
    """
    figure = Figure(figsize=(10.4, 3.6), layout="constrained")
    panels = figure.subplots(1, len(COMPARED_METRICS))
    for panel, metric in zip(panels, COMPARED_METRICS, strict=True):
        for number, (line, by_rooms) in enumerate(lines.items()):
            values = [by_rooms[count][metric] for count in sorted(by_rooms)]
            panel.errorbar(
                sorted(by_rooms),
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
        counts = [group[0] for group in counts_of_rooms(lines)]
        panel.set_xticks(counts, [str(count) for count in counts])
        panel.minorticks_off()
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", frameon=False, fontsize=7.5)
    return figure
