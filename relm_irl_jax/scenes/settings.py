"""Choice of scenes, and the names of room types; importing them loads neither NumPy nor JAX."""

from typing import Literal

from pydantic.dataclasses import dataclass

from relm_irl_jax.bounds import ImageSize, NonNegativeInt, PositiveInt

ROOM_TYPES = ("bathroom", "bedroom", "living_room")
"""The room types that the paper reports."""

ROOM_TYPE_PATTERN = r"(?!(?i:mean)$)\w[\w.+-]*"
"""Pattern of room types, which become parts of file names and columns of tables: `mean` is the last column's name."""

ROOMS = "rooms"
"""Value of the setting `scenes` that selects the built-in rooms instead of a folder."""


@dataclass(frozen=True)
class SceneSettings:
    """Training scenes, unseen scenes, and the size of the built-in rooms."""

    training_per_type: PositiveInt = 2
    """Training scenes of each room type. In a folder, these are the first ones in the order of file names."""
    training: tuple[str, ...] = ()
    """Names of the training scenes in a folder, instead of the first ones; all other scenes are unseen."""
    unseen_per_type: PositiveInt = 3
    """Unseen scenes of each room type for Task III. In a folder, these follow the training scenes; one is enough."""
    size: Literal["full", "tiny"] = "full"
    """Size of the built-in rooms: the state counts of the original scenes (`full`), or 12 to 20 places (`tiny`)."""
    image_size: ImageSize | None = None
    """Rows and columns of the views of built-in rooms; by default as many as the encoder takes."""
    first_room: NonNegativeInt = 0
    """Number of the first built-in room of each type; training rooms come first, then unseen rooms."""
    first_unseen: NonNegativeInt | None = None
    """Number of the first unseen built-in room of each type, so that other training rooms leave the unseen ones the
    same; by default they follow the training rooms."""

    @property
    def training_rooms(self) -> int:
        """Number of built-in rooms to train on."""
        return self.training_per_type * len(ROOM_TYPES)
