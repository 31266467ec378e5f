"""The settings of a run that its report mentions, read from `config.json` without the rest of the configuration.

The report can therefore be made again after other fields of the configuration were renamed or removed.
"""

from typing import Annotated, Literal

from pydantic import AliasChoices, AliasPath, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from relm_irl_jax.errors import InputError, first_fault
from relm_irl_jax.run_folder import RunFolder


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """Some fields of a run's configuration.

    Attributes:
        scenes: `rooms`, or a folder of scene files.
        frames: training frames of each method and seed.
        agent: kind of agent.
        weights: weights of the encoder.
        new_targets: how Task II's targets were drawn, `paper` or `uniform`.
        policy: whether actions were drawn (`sample`) or the most probable ones (`greedy`).
        imagine: which imagined targets the siamese agent trains on; `none` if the configuration does not say.
        map_weights: weights of the mapping agent: `package`, `train` or a file; empty if not given.
        map_memory: memory of the mapping agent at the start of an episode in a training scene, `empty` or `filled`.
        hindsight: which states could be goals; empty if the configuration does not say.
    """

    scenes: str
    frames: int
    agent: str
    weights: Annotated[str, Field(validation_alias=AliasPath("encoder", "weights"))]
    new_targets: Annotated[str, Field(validation_alias=AliasPath("evaluation", "new_targets"))]
    policy: Annotated[str, Field(validation_alias=AliasPath("evaluation", "policy"))]
    imagine: Annotated[
        Literal["none", "told", "reward-alone"], Field(validation_alias=AliasPath("siamese", "imagine"))
    ] = "none"
    map_weights: Annotated[str, Field(validation_alias=AliasPath("map", "weights"))] = ""
    map_memory: Annotated[str, Field(validation_alias=AliasPath("map", "memory"))] = "empty"
    hindsight: Annotated[
        str,
        Field(validation_alias=AliasChoices(AliasPath("goals", "hindsight"), AliasPath("metric", "hindsight"))),
    ] = ""

    @property
    def imagined(self) -> Literal["none", "told", "reward-alone"]:
        """Which imagined targets the run's agent trains on."""
        return self.imagine if self.agent == "siamese" else "none"

    @property
    def training(self) -> str:
        """What was trained, as a part of a sentence."""
        if self.agent == "map" and self.map_weights == "package":
            return "weights that come with the package, trained on other rooms"
        if self.agent == "map" and self.map_weights != "train":
            return f"weights of {self.map_weights}"
        return f"{self.frames:,} training frames per method"


_ADAPTER = TypeAdapter(RunSettings)


def load_run_settings(folder: RunFolder) -> RunSettings:
    """Read the settings that the report mentions.

    Args:
        folder: the run folder.

    Returns:
        The settings.

    Raises:
        InputError: `config.json` is missing or damaged.
    """
    try:
        return _ADAPTER.validate_json(folder.config.read_bytes())
    except OSError as error:
        raise InputError(
            f"run: {folder.config} cannot be read ({error.strerror}); give the folder of a run made by "
            "`relm-irl train`."
        ) from error
    except ValidationError as error:
        raise InputError(f"{folder.config}: {first_fault(error)} Restore the file.") from error
