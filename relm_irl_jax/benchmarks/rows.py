"""Tables of measurements as CSV files."""

import csv
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any


def write_rows(path: Path, rows: Sequence[Any]) -> None:
    """Write measurements as CSV.

    Args:
        path: the file.
        rows: instances of one dataclass, whose fields are the columns.
    """
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def three_digits(value: float) -> str:
    """Write a rate or a ratio with three significant digits.

    Args:
        value: the number, not 0.

    Returns:
        The number, without an exponent and with commas between thousands.
    """
    places = 2 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):,.{max(0, places)}f}"
