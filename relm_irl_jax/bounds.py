"""Bounded numbers: the types of the fields of settings.

Every number of a configuration has a lower and an upper bound, and is finite. A value outside is refused when it is
read, before any work, instead of overflowing or exhausting the memory hours later. Numbers are strict: `true` and
"3" are refused where a number is needed.
"""

from typing import Annotated

from pydantic import Field

LARGEST = 1e6
"""Largest magnitude of a real number."""

SMALLEST = 1e-12
"""Smallest positive real number; much smaller ones are zero in float32."""

MOST = 1_000_000
"""Largest count."""

RealNumber = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
PositiveFloat = Annotated[float, Field(strict=True, ge=SMALLEST, le=LARGEST, allow_inf_nan=False)]
NonNegativeFloat = Annotated[float, Field(strict=True, ge=0, le=LARGEST, allow_inf_nan=False)]
UnitInterval = Annotated[float, Field(strict=True, ge=0, le=1, allow_inf_nan=False)]
Discount = Annotated[float, Field(strict=True, gt=0, lt=1, allow_inf_nan=False)]
PositiveInt = Annotated[int, Field(strict=True, ge=1, le=MOST)]
NonNegativeInt = Annotated[int, Field(strict=True, ge=0, le=MOST)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**31)]
ImageSize = Annotated[int, Field(strict=True, ge=1, le=2048)]
"""Rows and columns of an image."""
