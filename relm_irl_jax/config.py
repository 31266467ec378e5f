"""The configuration of a run: one frozen record, from defaults, a TOML file and the command line, in that order."""

import hashlib
import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import PositiveInt, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from relm_irl_jax.agent.settings import MetricSettings, RecordSettings, SiameseSettings
from relm_irl_jax.cluster import ClusterSettings
from relm_irl_jax.errors import InputError
from relm_irl_jax.features.settings import EncoderSettings
from relm_irl_jax.rewards.assemble import ManualSettings
from relm_irl_jax.rewards.demonstrations import IrlSettings
from relm_irl_jax.rewards.prediction import ElmSettings
from relm_irl_jax.scenes.selection import ROOMS, SceneSettings
from relm_irl_jax.tasks import EvaluationSettings, TaskSettings

Task = Literal["I", "II", "III"]
Agent = Literal["siamese", "metric"]
Method = Literal["random", "bc", "rl", "irl", "elm-irl", "relm-irl"]
METHODS: tuple[Method, ...] = ("random", "bc", "rl", "irl", "elm-irl", "relm-irl")
"""Every method, in the order of the tables."""

PAPER_METHODS: tuple[Method, ...] = ("random", "rl", "irl", "elm-irl", "relm-irl")
"""What `all` means: the methods of the paper."""

NOT_TRAINED = ("task", "methods", "seeds", "run", "evaluation", "cluster", "record")
"""Fields that trained agents do not depend on; the others must agree for a run folder to be continued."""


@dataclass(frozen=True)
class Config:
    """One run: scenes, targets, rewards, agents, evaluation."""

    task: Task = "II"
    """Task evaluated after training; training itself does not depend on it."""
    methods: tuple[Literal["all", "random", "bc", "rl", "irl", "elm-irl", "relm-irl"], ...] = ("all",)
    """Methods to train and evaluate: `all` of the paper's, and behaviour cloning, `bc`, where it is named."""
    scenes: str = ROOMS
    """`rooms` for the built-in scenes, or a folder of HDF5 scene files."""
    seeds: PositiveInt = 1
    """Number of seeds: 0, 1, ...; each draws its own targets, demonstrations, networks and episodes."""
    frames: PositiveInt = 5_000_000
    """Training frames for each method and seed."""
    run: Path | None = None
    """Run folder; by default one under `runs/`, named after the configuration."""
    scene: SceneSettings = SceneSettings()
    """Training and unseen scenes."""
    encoder: EncoderSettings = EncoderSettings()
    """Image encoder."""
    tasks: TaskSettings = TaskSettings()
    """Targets and episodes."""
    manual: ManualSettings = ManualSettings()
    """Reward of the RL baseline."""
    irl: IrlSettings = IrlSettings()
    """Demonstrations and inverse reinforcement learning."""
    elm: ElmSettings = ElmSettings()
    """Extreme learning machine."""
    agent: Agent = "siamese"
    """`siamese` for the paper's actor-critic, `metric` for the agent that learns distances between views."""
    siamese: SiameseSettings = SiameseSettings()
    """The paper's agent."""
    metric: MetricSettings = MetricSettings()
    """The metric agent."""
    evaluation: EvaluationSettings = EvaluationSettings()
    """Evaluation."""
    record: RecordSettings = RecordSettings()
    """Checkpoints and scalars of trainings that are under way."""
    cluster: ClusterSettings = ClusterSettings()
    """Other processes that share the siamese agent's training."""

    def chosen_methods(self) -> tuple[Method, ...]:
        """Methods asked for, in the order of the tables."""
        chosen = {*self.methods, *(PAPER_METHODS if "all" in self.methods else ())}
        return tuple(m for m in METHODS if m in chosen)


_ADAPTER = TypeAdapter(Config)


def config_record(config: Config) -> dict[str, Any]:
    """The configuration as plain values, ready for JSON.

    Args:
        config: the configuration.

    Returns:
        Nested dictionaries; `config_from_record` reverses it.
    """
    return _ADAPTER.dump_python(config, mode="json")


def config_from_record(record: dict[str, Any], origin: str) -> Config:
    """Read a configuration from plain values; fields left out take their defaults.

    Args:
        record: nested dictionaries.
        origin: file named in errors.

    Returns:
        The configuration.

    Raises:
        InputError: a field is unknown or its value is refused.
    """
    return overlay(Config(), record, origin)


def overlay(config: Config, record: Mapping[str, Any], origin: str) -> Config:
    """Change some fields of a configuration.

    Args:
        config: the configuration.
        record: nested dictionaries of the fields to change.
        origin: file named in errors.

    Returns:
        The configuration in which all other fields are as before.

    Raises:
        InputError: a field is unknown or its value is refused.
    """
    whole = config_record(config)
    _refuse_unknown(record, whole, origin, "")
    try:
        return _ADAPTER.validate_python(_merged(whole, record))
    except ValidationError as error:
        raise InputError(f"{origin}: {first_fault(error)}") from error


def load_config(path: Path) -> Config:
    """Read a configuration from a TOML file, or from the JSON that a run folder holds.

    Args:
        path: the file.

    Returns:
        The configuration; fields left out take their defaults.

    Raises:
        InputError: the file cannot be read, or a field in it is unknown or refused.
    """
    return config_from_record(read_record(path), str(path))


def read_record(path: Path) -> dict[str, Any]:
    """Read the fields that a TOML or JSON file sets.

    Args:
        path: the file.

    Returns:
        Nested dictionaries.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        text = path.read_text()
        return json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give an existing file.") from error
    except ValueError as error:
        raise InputError(f"{path}: is not valid {path.suffix.lstrip('.').upper()} ({error}); mend it.") from error


def first_fault(error: ValidationError) -> str:
    """One sentence on the first refused field.

    Args:
        error: what the validation found.

    Returns:
        Field, value and reason.
    """
    fault = error.errors(include_url=False)[0]
    field = ".".join(str(part) for part in fault["loc"])
    return f"{field} = {fault['input']!r} is refused: {fault['msg'][:1].lower()}{fault['msg'][1:]}."


def trained_part(config: Config) -> dict[str, Any]:
    """The fields on which trained agents depend.

    Args:
        config: the configuration.

    Returns:
        Flat dictionary from dotted field names to values.
    """
    return {k: v for k, v in _flat(config_record(config), "").items() if k.split(".")[0] not in NOT_TRAINED}


def fingerprint(config: Config) -> str:
    """Eight hexadecimal digits that differ between configurations whose agents differ.

    Args:
        config: the configuration.

    Returns:
        The digits.
    """
    return hashlib.sha256(json.dumps(trained_part(config), sort_keys=True).encode()).hexdigest()[:8]


def _flat(record: dict[str, Any], prefix: str) -> dict[str, Any]:
    flat = {}
    for key, value in record.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return flat


def _merged(whole: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    groups = {key: _merged(whole[key], value) for key, value in change.items() if isinstance(whole[key], Mapping)}
    return {**whole, **change, **groups}


def _refuse_unknown(record: Mapping[str, Any], known: dict[str, Any], origin: str, prefix: str) -> None:
    for key, value in record.items():
        if key not in known:
            raise InputError(f"{origin}: unknown field `{prefix}{key}`; known here are {', '.join(known)}.")
        if isinstance(known[key], dict):
            if not isinstance(value, Mapping):
                raise InputError(f"{origin}: `{prefix}{key}` is a group of fields; write `{prefix}{key}.FIELD`.")
            _refuse_unknown(value, known[key], origin, f"{prefix}{key}.")
