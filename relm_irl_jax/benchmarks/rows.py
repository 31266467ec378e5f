"""Tables of measurements as CSV files."""

import math
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from relm_irl_jax.files import write_table


def write_rows(path: Path, rows: Sequence[Any]) -> None:
    """Write measurements as CSV.

    Args:
        path: the file.
        rows: instances of one dataclass, whose fields are the columns; None leaves a cell empty.
    """
    columns = [field.name for field in fields(rows[0])]
    values = {name: [getattr(row, name) for row in rows] for name in columns}
    write_table(path, {name: ["" if value is None else value for value in of_rows] for name, of_rows in values.items()})


def three_digits(value: float) -> str:
    """Write a rate or a ratio with three significant digits.

    Args:
        value: the number, not 0.

    Returns:
        The number, without an exponent and with commas between thousands.
    """
    places = 2 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):,.{max(0, places)}f}"
