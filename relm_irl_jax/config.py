"""The configuration of a run: one frozen value, from defaults, a TOML file and the command line, in that order."""

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from relm_irl_jax.agents.settings import (
    FRAMES,
    LogSettings,
    MapSettings,
    MetricSettings,
    RecurrentSettings,
    SavnSettings,
    SiameseSettings,
)
from relm_irl_jax.bounds import PositiveInt
from relm_irl_jax.cluster import ClusterSettings
from relm_irl_jax.errors import InputError, first_fault
from relm_irl_jax.features.settings import EncoderSettings, settings_for
from relm_irl_jax.frames import Frames
from relm_irl_jax.inputs import refuse_device
from relm_irl_jax.results import BESIDE, Method, Task
from relm_irl_jax.rewards.settings import ElmSettings, GoalSettings, IrlSettings, ManualSettings
from relm_irl_jax.scenes.settings import ROOMS, SceneSettings
from relm_irl_jax.task_settings import EvaluationSettings, TaskSettings

AgentName = Literal["siamese", "metric", "map", "recurrent", "savn"]
BesideName = Literal["metric", "map"]
METHODS: tuple[Method, ...] = ("random", "bc", "rl", "constant", "irl", "elm-irl", "relm-irl")
"""Every method, in the order of the tables. `constant` is the control of learned rewards: every step costs the same."""

PAPER_METHODS: tuple[Method, ...] = ("random", "rl", "irl", "elm-irl", "relm-irl")
"""What `all` means: the methods of the paper."""

MAP_METHODS: tuple[Method, ...] = ("random", "rl")
"""What `all` means for the mapping agent, which plans with equal costs of all steps and learns no reward."""

METRIC_FRAMES_BESIDE = 1_000_000
"""Most training frames of the metric agent beside another agent, so that a run of all agents takes minutes."""

MAP_EPISODES_BESIDE = 200
"""Most episodes of the mapping agent in each scene beside another agent; it takes milliseconds to decide."""

NOT_TRAINED = ("task", "methods", "seeds", "run", "beside", "evaluation", "cluster", "log")
"""Fields on which trained agents do not depend; a run can only be continued if all others are unchanged."""


# Validators of the whole are built when they are first used: `--help` needs none.
@dataclass(frozen=True, config={"defer_build": True})
class Config:
    """One run: scenes, targets, rewards, agents, evaluation."""

    task: Task = "II"
    """Task to evaluate after training; training does not depend on it."""
    methods: Annotated[
        tuple[Literal["all", "random", "bc", "rl", "constant", "irl", "elm-irl", "relm-irl"], ...], Field(min_length=1)
    ] = ("all",)
    """Methods to train and evaluate. `all` means all except behaviour cloning, `bc`, and a constant cost of a step,
    `constant`, which must be named; for the mapping agent, it means random and rl."""
    scenes: str = ROOMS
    """`rooms` for the built-in scenes, or a folder of HDF5 scene files."""
    seeds: PositiveInt = 1
    """Number of seeds (0, 1, ...); each has its own targets, demonstrations, networks and episodes."""
    frames: Frames | None = None
    """Training frames for each method and seed; by default 6M for the paper's agent, 5M for the metric
    agent and 256k for the mapping agent."""
    run: Path | None = None
    """Run folder; by default a folder in `runs/` whose name depends on the configuration."""
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
    goals: GoalSettings = GoalSettings()
    """Goals of hindsight relabelling, for agents that use it."""
    agent: Literal["all"] | AgentName = "all"
    """`siamese` for the paper's actor-critic, `metric` for the agent that learns distances between views, `map` for the
    agent that draws a map while it searches, `recurrent` for the paper's network with recurrent memory, `savn` for one
    that also learns to change its weights during an episode. `all` means siamese, and with all methods on the built-in
    rooms metric and map beside it."""
    beside: tuple[BesideName, ...] = ()
    """Other agents in the same tables: metric, trained with RELM-IRL's reward, and map, which learns no reward. Each
    has a run of its own in the sub-folder of its name."""
    siamese: SiameseSettings = SiameseSettings()
    """The paper's agent."""
    metric: MetricSettings = MetricSettings()
    """The metric agent."""
    map: MapSettings = MapSettings()
    """The mapping agent."""
    recurrent: RecurrentSettings = RecurrentSettings()
    """The recurrent agent."""
    savn: SavnSettings = SavnSettings()
    """The agent that learns to adapt."""
    evaluation: EvaluationSettings = EvaluationSettings()
    """Evaluation."""
    log: LogSettings = LogSettings()
    """Checkpoints and TensorBoard files of running trainings."""
    cluster: ClusterSettings = ClusterSettings()
    """Other processes that share the siamese agent's training."""

    def chosen_methods(self) -> tuple[Method, ...]:
        """Methods to train and evaluate, in the order of the tables."""
        meant_by_all = MAP_METHODS if self.agent == "map" else PAPER_METHODS
        chosen = {*self.methods, *(meant_by_all if "all" in self.methods else ())}
        return tuple(m for m in METHODS if m in chosen)

    @property
    def training_frames(self) -> int:
        """Training frames for each method and seed."""
        return FRAMES[self.trained_agent] if self.frames is None else self.frames

    @property
    def trained_agent(self) -> AgentName:
        """The agent that the methods train."""
        return "siamese" if self.agent == "all" else self.agent

    def of_agent_beside(self, agent: BesideName) -> "Config":
        """The configuration of the run of an agent that is evaluated beside this configuration's.

        Args:
            agent: the agent.

        Returns:
            The configuration; the run folder is not set.
        """
        frames, evaluation = self.training_frames, self.evaluation
        if agent == "metric":
            frames = min(frames, METRIC_FRAMES_BESIDE)
        if agent == "map":
            evaluation = replace(evaluation, episodes=min(evaluation.episodes, MAP_EPISODES_BESIDE))
        settings = {"agent": agent, "methods": (BESIDE[agent],), "frames": frames, "evaluation": evaluation}
        return replace(self, **settings, beside=(), run=None)

    def resolved(self) -> "Config":
        """The same configuration with every default that depends on other fields in place of None or `auto`."""
        weights = self.map.weights
        if weights == "auto":
            weights = "package" if self.scenes == ROOMS else "train"
        encoder = settings_for(self.encoder, built_in=self.scenes == ROOMS)
        every = self.agent == "all" and "all" in self.methods and self.scenes == ROOMS and self.cluster.processes == 1
        return replace(
            self,
            agent=self.trained_agent,
            beside=get_args(BesideName) if every else self.beside,
            frames=self.training_frames,
            map=replace(self.map, weights=weights),
            encoder=encoder,
        )


_ADAPTER = TypeAdapter(Config)


def config_to_dict(config: Config) -> dict[str, Any]:
    """The configuration as plain values, ready for JSON.

    Args:
        config: the configuration.

    Returns:
        Nested dictionaries; `config_from_dict` reverses it.
    """
    return _ADAPTER.dump_python(config, mode="json")


def config_from_dict(fields: dict[str, Any], origin: str) -> Config:
    """Read a configuration from plain values; fields left out take their defaults.

    Args:
        fields: nested dictionaries.
        origin: name of the source in error messages.

    Returns:
        The configuration.

    Raises:
        InputError: a field is unknown or its value is refused.
    """
    return overlay(Config(), fields, origin)


def overlay(config: Config, changes: Mapping[str, Any], origin: str) -> Config:
    """Change some fields of a configuration.

    Args:
        config: the configuration.
        changes: nested dictionaries of the fields to change.
        origin: name of the source in error messages.

    Returns:
        The changed configuration.

    Raises:
        InputError: a field is unknown or its value is refused.
    """
    try:
        return _ADAPTER.validate_python(_merged(config_to_dict(config), changes), extra="forbid")
    except ValidationError as error:
        raise InputError(f"{origin}: {first_fault(error, config)}") from error


def load_config(path: Path) -> Config:
    """Read a configuration from a TOML file, or from a run folder's JSON file.

    Args:
        path: the file.

    Returns:
        The configuration; fields left out take their defaults.

    Raises:
        InputError: the file cannot be read, or a field in it is unknown or refused.
    """
    return config_from_dict(read_fields(path), str(path))


def read_fields(path: Path) -> dict[str, Any]:
    """Read the fields that a TOML or JSON file sets.

    Args:
        path: the file.

    Returns:
        Nested dictionaries.

    Raises:
        InputError: the file cannot be read.
    """
    refuse_device(path)
    try:
        text = path.read_text()
        values = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give an existing file.") from error
    except RecursionError as error:
        raise InputError(f"{path}: is nested too deeply; correct it.") from error
    except ValueError as error:
        raise InputError(f"{path}: is not valid {path.suffix.lstrip('.').upper()} ({error}); correct it.") from error
    if not isinstance(values, dict):
        raise InputError(f"{path}: must contain an object of fields; give the configuration of a run.")
    return values


def trained_part(config: Config) -> dict[str, Any]:
    """The fields on which trained agents depend.

    Args:
        config: the configuration.

    Returns:
        Flat dictionary from dotted field names to values.
    """
    return {k: v for k, v in _flat(config_to_dict(config), "").items() if k.split(".")[0] not in NOT_TRAINED}


def fingerprint(config: Config, recorded: str = "") -> str:
    """Eight hexadecimal digits of a checksum of the fields on which trained agents depend.

    Args:
        config: the configuration.
        recorded: checksum of the recorded demonstrations, if there are some.

    Returns:
        The digits.
    """
    described = json.dumps(trained_part(config), sort_keys=True) + recorded
    return hashlib.sha256(described.encode()).hexdigest()[:8]


def _flat(nested: dict[str, Any], prefix: str) -> dict[str, Any]:
    flat = {}
    for key, value in nested.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return flat


def _merged(whole: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """Apply changes to nested dictionaries; unknown fields are added, so that the validation reports them."""

    def merged(key: str, value: Any) -> Any:
        old = whole.get(key)
        return _merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value

    return {**whole, **{key: merged(key, value) for key, value in change.items()}}
