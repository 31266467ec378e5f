"""Means over seeds and their 95% intervals (Student's t)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy import stats

LEVEL = 0.95
"""Confidence level of all intervals."""


@dataclass(frozen=True)
class MeanInterval:
    """A mean over seeds with its confidence interval.

    Attributes:
        mean: the mean; NaN without values.
        half_width: half of its 95% interval; NaN with fewer than two values.
    """

    mean: float
    half_width: float

    def __format__(self, form: str) -> str:
        """The mean and, if defined, the interval, both in a format such as `.1f`; the default is `.2f`."""
        numbers = (self.mean,) if np.isnan(self.half_width) else (self.mean, self.half_width)
        return " ± ".join(format(number, form or ".2f") for number in numbers)

    def __str__(self) -> str:
        """The mean and, if defined, the interval."""
        return format(self)


def mean_intervals(
    values: Float64[np.ndarray, "seeds columns"],
) -> tuple[Float64[np.ndarray, "columns"], Float64[np.ndarray, "columns"]]:
    """Mean and half of the 95% interval of each column: t(n − 1) · s / √n over its n known values.

    Args:
        values: one row for each seed; entries that are not finite are unknown and do not count.

    Returns:
        Means, NaN for columns without known values; half widths, NaN for columns with fewer than two known values.
    """
    known = np.ma.masked_invalid(values)
    count = known.count(axis=0)
    mean = np.ma.filled(known.mean(axis=0), np.nan)
    error = np.ma.filled(known.std(axis=0, ddof=1), np.nan) / np.sqrt(np.maximum(count, 1))
    quantile = stats.t.ppf((1 + LEVEL) / 2, np.maximum(count - 1, 1))
    return mean, np.where(count > 1, quantile * error, np.nan)


def mean_interval(values: Sequence[float]) -> MeanInterval:
    """Mean and 95% interval over seeds.

    Args:
        values: one value for each seed.

    Returns:
        The mean and its interval.
    """
    mean, half_width = mean_intervals(np.asarray(values, np.float64).reshape(-1, 1))
    return MeanInterval(float(mean[0]), float(half_width[0]))


def intervals_of_rows(
    table: Mapping[str, Sequence], *keys: str, columns: tuple[str, str] = ("mean", "half_width")
) -> Iterator[tuple[tuple, MeanInterval]]:
    """The means and intervals of a table that has one in each row.

    Args:
        table: columns by name, as they are written to a file or read from it.
        keys: columns that say what a row is of.
        columns: columns of the mean and of half of the interval.

    Yields:
        The row's keys, and its interval.
    """
    names = zip(*(table[key] for key in keys), strict=True)
    for key, mean, half_width in zip(names, *(table[column] for column in columns), strict=True):
        yield key, MeanInterval(float(mean), float(half_width))


def paired_difference(first: Mapping[int, float], second: Mapping[int, float]) -> tuple[MeanInterval, int]:
    """Mean difference over the seeds that both methods have.

    Args:
        first: values by seed.
        second: values by seed, subtracted.

    Returns:
        The difference, and the number of seeds.
    """
    seeds = sorted(first.keys() & second.keys())
    return mean_interval([first[seed] - second[seed] for seed in seeds]), len(seeds)
