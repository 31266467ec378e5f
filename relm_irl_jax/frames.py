"""Numbers of training frames, as written in settings files and on the command line: 5000000, 5e6, 5M or 600k."""

import re
from decimal import Decimal
from typing import Annotated, Any

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError
from tyro.constructors import PrimitiveConstructorSpec

_SUFFIXES = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9}
"""Factor of each suffix."""

_NUMBER = re.compile(r"(?P<number>\d[\d_]*(\.\d+)?(e\+?\d{1,2})?)(?P<suffix>[kmg]?)", re.IGNORECASE)


def parse_frames(value: Any) -> Any:
    """Read a number of frames.

    Args:
        value: a number, or a string such as `5000000`, `5_000_000`, `5e6`, `1.5M` or `600k`.

    Returns:
        The number for a string; any other value unchanged, for pydantic to check.

    Raises:
        PydanticCustomError: the string is not a whole number of frames, or the value is a bool.
    """
    if not isinstance(value, str | bool):
        return value
    match = _NUMBER.fullmatch(str(value).strip())
    if match is not None:
        frames = Decimal(match["number"]) * _SUFFIXES[match["suffix"].lower()]
        if frames == frames.to_integral_value():
            return int(frames)
    raise PydanticCustomError("frames", "a whole number is needed, such as 5000000, 5e6, 5M or 600k")


Frames = Annotated[
    int,
    BeforeValidator(parse_frames),
    Field(gt=0, le=10**15),
    # The command line passes the string on, so that there is one parser and one error message.
    PrimitiveConstructorSpec(
        nargs=1,
        metavar="INT|5e6|5M|600k",
        instance_from_str=lambda arguments: arguments[0],
        is_instance=lambda value: isinstance(value, int),
        str_from_instance=lambda frames: [str(frames)],
    ),
]
"""A positive number of frames: the type of a settings field."""
