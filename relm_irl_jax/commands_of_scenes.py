"""Commands of `relm-irl` for scenes and encoders: their arguments, as they are read and as `--help` describes them."""

from pathlib import Path
from typing import Annotated, Literal

import tyro
from pydantic.dataclasses import dataclass

from relm_irl_jax.bounds import ImageSize, NonNegativeInt, PositiveInt
from relm_irl_jax.features.training.settings import EncoderTraining
from relm_irl_jax.scenes.recording.settings import ThorSettings, VizdoomSettings
from relm_irl_jax.scenes.settings import ROOM_TYPES


@dataclass(frozen=True)
class Generate:
    """Generate built-in rooms as scene files in the THOR v1 format."""

    out: Path
    """Output folder."""
    room_types: tuple[Literal["bathroom", "bedroom", "living_room"], ...] = ROOM_TYPES
    """Room types."""
    count: PositiveInt = 1
    """Rooms of each type."""
    first: NonNegativeInt = 0
    """Number of the first room of each type."""
    size: Literal["full", "tiny"] = "full"
    """The original scenes' state counts (full), or 12 to 20 places (tiny)."""
    image_size: ImageSize = 224
    """Rows and columns of a view."""


@dataclass(frozen=True)
class Check:
    """Check that scene files are consistent and usable for training."""

    files: tyro.conf.Positional[tuple[Path, ...]]
    """Scene files, or folders of them."""


@dataclass(frozen=True)
class ExportVizdoom:
    """Record maps of ViZDoom, which includes Freedoom's maps (pip install vizdoom)."""

    out: Path
    """Output folder. Existing files are kept; an interrupted recording continues."""
    maps: tuple[str, ...]
    """Maps: map01 to map32, or e1m1 to e4m9."""
    settings: Annotated[VizdoomSettings, tyro.conf.arg(name="")] = VizdoomSettings()
    """States and views."""


@dataclass(frozen=True)
class ExportThor:
    """Record scenes of AI2-THOR (pip install ai2thor)."""

    out: Path
    """Output folder. Existing files are kept; an interrupted recording continues."""
    scenes: tuple[str, ...]
    """iTHOR scenes, such as FloorPlan401, or JSON files of ProcTHOR houses."""
    settings: Annotated[ThorSettings, tyro.conf.arg(name="")] = ThorSettings()
    """Views."""


RecordedVizdoom = Annotated[ExportVizdoom, tyro.conf.subcommand("vizdoom", prefix_name=False)]
RecordedThor = Annotated[ExportThor, tyro.conf.subcommand("thor", prefix_name=False)]


@dataclass(frozen=True)
class Export:
    """Record scenes of another simulator as scene files in the THOR v1 format."""

    engine: Annotated[RecordedVizdoom | RecordedThor, tyro.conf.arg(name="")]


Generated = Annotated[Generate, tyro.conf.subcommand("generate", prefix_name=False)]
Checked = Annotated[Check, tyro.conf.subcommand("check", prefix_name=False)]
Exported = Annotated[Export, tyro.conf.subcommand("export", prefix_name=False)]


@dataclass(frozen=True)
class ShowEncoder:
    """Show how weights of the small encoder were trained."""

    weights: tyro.conf.Positional[str]
    """rooms, rooms-paths, or a file of weights."""


TrainedEncoder = Annotated[EncoderTraining, tyro.conf.subcommand("train", prefix_name=False)]
ShownEncoder = Annotated[ShowEncoder, tyro.conf.subcommand("show", prefix_name=False)]
