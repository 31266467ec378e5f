"""Settings of the training of encoders; importing them does not load JAX."""

from pathlib import Path

from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt
from pydantic.dataclasses import dataclass

from relm_irl_jax.scenes.settings import ROOMS, SceneSettings


@dataclass(frozen=True)
class TrainingSettings:
    """How the small encoder is trained."""

    steps: PositiveInt = 1500
    """Updates."""
    groups: PositiveInt = 24
    """Groups of views of an update; the views of a group are of one scene."""
    members: int = Field(default=8, ge=4)
    """Views of a group."""
    pool: PositiveInt = 48
    """Scenes in memory."""
    turn: PositiveInt = 3
    """Updates after which one scene in memory makes way for the next."""
    learning_rate: PositiveFloat = 2e-3
    """Largest learning rate of AdamW; it rises over the first 100 updates and falls to 0 along a cosine."""
    weight_decay: float = Field(default=2e-2, ge=0)
    """Weight decay of AdamW."""
    clip: PositiveFloat = 2.0
    """Greatest norm of a gradient."""


@dataclass(frozen=True)
class EncoderTraining:
    """Train the small encoder on generated rooms or on your own scenes, and write its weights."""

    output: Path
    """File of weights to write, ending in .safetensors; `relm-irl train --encoder.weights FILE` uses it."""
    scenes: str = ROOMS
    """`rooms` for generated rooms that no task evaluates on, or a folder of HDF5 scene files."""
    rooms: PositiveInt = 600
    """Generated rooms, a third of each type."""
    scene: SceneSettings = SceneSettings()
    """Training scenes of a folder, as in `relm-irl train`. The others are left alone, so that Task III keeps them
    unseen."""
    paths: bool = False
    """Learn first actions and lengths of shortest paths as well."""
    seed: NonNegativeInt = 0
    """Seed of initial weights and draws."""
    training: TrainingSettings = TrainingSettings()
    """Training."""
