"""Logarithmic axes with labels at the measured sizes."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator


def label_log_axes(axes: Axes, sizes: Sequence[int]) -> None:
    """Label the x axis of a log-log plot with measured sizes, and its y axis with plain numbers.

    Args:
        axes: the plot.
        sizes: the measured sizes, in any order.
    """
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    axes.grid(alpha=0.3, which="both")
    axes.set_xticks(sorted(set(sizes)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(plain)
    axes.yaxis.set_major_formatter(plain)
    low, high = axes.get_ylim()
    # An axis that covers less than a decade may have no major tick.
    axes.yaxis.set_minor_formatter(plain if high / low < 10 else NullFormatter())
    axes.tick_params(labelsize=8)
    axes.tick_params(axis="x", rotation=45)
