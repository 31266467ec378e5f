"""Commands of `relm-irl`: their arguments, as they are read and as `--help` describes them.

`commands_of_scenes` has those of scenes and encoders, `config` those of `train`. Importing this module loads neither
JAX nor settings of other commands, so that help is quick.
"""

from pathlib import Path
from typing import Literal

import tyro
from pydantic.dataclasses import dataclass

from relm_irl_jax.bounds import NonNegativeInt, PositiveInt, Seed
from relm_irl_jax.features.settings import Observed
from relm_irl_jax.results import Method, Task


@dataclass(frozen=True)
class Evaluate:
    """Evaluate the agents of a run on a task."""

    run: tyro.conf.Positional[Path]
    """Run folder."""
    task: Task = "II"
    """Task to evaluate."""
    policy: str | None = None
    """Your own policy, which gets a row beside the run's: module:function of a batch of observations, or module:class,
    which is called with the seed."""
    results: Path | None = None
    """Your own results, which get rows beside the run's: a file in the form of results.json."""
    name: str | None = None
    """Name of your policy or results in the tables; by default the function's name, or the names in the file."""
    obs: Observed = "features"
    """What your policy observes of views."""
    history: PositiveInt = 1
    """Number of last views that your policy observes, the latest first."""


@dataclass(frozen=True)
class Report:
    """Write the report of a run again."""

    run: tyro.conf.Positional[Path]
    """Run folder."""


@dataclass(frozen=True)
class Play:
    """Save animations of an agent (GIF files in the run folder), or navigate by keyboard."""

    run: tyro.conf.Positional[Path | None] = None
    """Run folder; without it, you navigate by keyboard."""
    method: Method = "relm-irl"
    """Method that trained the agent."""
    task: Task = "I"
    """Task, which determines scenes and targets."""
    seed: Seed = 0
    """Seed of the agent."""
    episode: NonNegativeInt = 0
    """Number of the episode, which determines start and target."""
    keyboard: bool = False
    """Navigate to a target of the task by keyboard."""
    agent: Literal["map"] | None = None
    """Without a run: the mapping agent, with the weights of the package, searches in the scene. A terminal shows it
    step by step; the animation goes to `runs/play`."""
    scene: str | None = None
    """With a run: the name of one of its scenes; by default all are drawn, and the keyboard begins in the first.
    Without: a scene file or a built-in room, by default bathroom-0, for an agent bathroom-50."""
    target: str | None = None
    """Category of the target object without a run; by default a random one."""
    record: Path | None = None
    """File of demonstrations (JSON lines, as `--irl.demonstrations` reads them) to which a walk by keyboard is added
    if it reaches its target."""


@dataclass(frozen=True)
class Record:
    """Write demonstrations of a run as JSON lines, which `--irl.demonstrations` reads, or for other libraries."""

    run: tyro.conf.Positional[Path]
    """Run folder."""
    out: Path
    """File; for Minari a folder whose name ends in a version, such as datasets/expert-v0."""
    format: Literal["jsonl", "minari", "imitation"] = "jsonl"
    """JSON lines of states and actions; or what an agent of RelmIrl/Task-v0 observes, does and is paid, as a dataset of
    Minari or as trajectories of the imitation library (.npz)."""
    method: Method | None = None
    """Method whose agent's episodes are written, as far as they reach their target; by default the demonstrations that
    the run's rewards are learned from."""
    task: Task = "I"
    """Task of the agent's episodes."""
    seed: Seed = 0
    """Seed of the run."""
    episodes: PositiveInt = 20
    """Episodes of the agent in each scene."""


@dataclass(frozen=True)
class Bench:
    """Measure speed on this computer."""

    name: tyro.conf.Positional[
        Literal["commands", "peers", "trainings", "gym", "agent", "scaling", "elm", "irl", "encoder"]
    ]
    """The benchmark."""
    out: Path = Path("runs/bench")
    """Output folder, with a sub-folder for each benchmark. The encoder's benchmark writes no files."""
