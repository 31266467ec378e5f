"""Log axes whose numbers are the measured sizes."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator


def log_axes(axes: Axes, sizes: Sequence[float]) -> None:
    """Write measured sizes beside the x axis of a log-log plot, and plain numbers beside the y axis.

    Args:
        axes: the plot.
        sizes: sizes to write.
    """
    axes.grid(alpha=0.3, which="both")
    axes.set_xticks(sorted(set(sizes)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda size, _: f"{size:g}"))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    low, high = axes.get_ylim()
    # Within less than a decade there may be no major number at all.
    minor = FuncFormatter(lambda value, _: f"{value:g}") if high / low < 10 else NullFormatter()
    axes.yaxis.set_minor_formatter(minor)
    axes.tick_params(labelsize=8)
    axes.tick_params(axis="x", rotation=45)
