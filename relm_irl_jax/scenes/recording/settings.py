"""Settings of the recording of other simulators; importing them loads neither NumPy nor a simulator."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from relm_irl_jax.bounds import ImageSize, PositiveInt
from relm_irl_jax.scenes.recording.vizdoom_engine import RESOLUTIONS
from relm_irl_jax.scenes.settings import ROOM_TYPE_PATTERN


@dataclass(frozen=True)
class ThorSettings:
    """Views of AI2-THOR's scenes."""

    image_size: Annotated[ImageSize, Field(ge=8)] = 224
    """Rows and columns of a view."""
    cloud_rendering: bool = False
    """Render without a display, with Vulkan."""


@dataclass(frozen=True, config={"regex_engine": "python-re"})
class VizdoomSettings:
    """States and views of ViZDoom's maps."""

    states: Annotated[PositiveInt, Field(ge=8)] = 600
    """Largest number of states of a scene, four for each place; the original scenes have 180 to 900."""
    map_units: PositiveInt = 32
    """Map units in one step of 0.5 m."""
    image_size: Annotated[ImageSize, Field(ge=8, le=RESOLUTIONS[-1][1])] = 224
    """Rows and columns of a view."""
    start: Literal["player", "objects"] = "player"
    """Start the region at the player's start (`player`), or where the most kinds of objects are (`objects`)."""
    room_type: str = Field(default="doom", pattern=f"^{ROOM_TYPE_PATTERN}$")
    """Room type of the scenes. The siamese agent has a head for each room type, and Task III uses categories that were
    trained in scenes of the same room type."""
    wad: Path | None = None
    """WAD file with the maps; by default Freedoom's in the wheel."""
