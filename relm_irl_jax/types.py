"""The interfaces between the parts: what is to be learned, what learns it, and what acts.

    TrainingProblem ── Agent.train ──> parameters ── Agent.policy ──> Policy ── evaluation, play, report

An `Agent` is a value that turns a `TrainingProblem` into network parameters, and parameters into a `Policy`. Whatever
evaluates or shows behaviour knows `Policy` alone. A new agent implements these two protocols in a folder of
`relm_irl_jax.agents`; beside it, its name and settings go into `config.py`, and `stages/make_agent.py` makes it.

Batches have two axes, `scenes batch`: row i of every array acts in scene i of the world.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeVar, runtime_checkable

import jax
from jaxtyping import Array, Bool, Int32, PRNGKeyArray

from relm_irl_jax.rewards.functions import RewardFunction
from relm_irl_jax.rewards.goals import Goals
from relm_irl_jax.world import Targets, World

Parameters = Mapping[str, Any]
"""A network's parameters θ: nested dictionaries of arrays."""

Memory = Any
"""What a policy remembers within an episode: a tree of arrays whose leading axes are `scenes batch`; may be empty."""

NO_MEMORY: Memory = ()
"""Memory of a policy that remembers nothing."""

Row = Mapping[str, float]
"""One row of a learning curve: a number for each column."""

State = TypeVar("State")
"""Everything that a training carries from chunk to chunk: a tree of arrays."""

Requirement = Literal["goals", "demonstrations"]
"""An optional part of a `TrainingProblem`."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Observation:
    """What an agent observes before it acts.

    Attributes:
        view: row of the world's table of views that is seen. It serves as a look-up key into tables computed from
            views; its value carries no meaning, and renumbering all states changes no action.
        collided: whether the last action left the agent where it was; False at the start of an episode.
    """

    view: Int32[Array, "scenes batch"]
    collided: Bool[Array, "scenes batch"]


@runtime_checkable
class Policy(Protocol):
    """A trained agent, ready to act in the scenes and towards the targets that it was made for; a tree of arrays."""

    def init(self, shape: tuple[int, ...]) -> Memory:
        """Return the memory of `shape` = (scenes, batch) agents before their first observation."""
        ...

    def act(
        self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Int32[Array, "scenes batch"]
    ) -> tuple[Memory, Int32[Array, "scenes batch"]]:
        """Choose one action for each agent.

        Args:
            key: source of randomness.
            memory: what `init` or the last call returned.
            observation: what is observed now.
            target: rows of the `Targets` that the policy was made for.

        Returns:
            The next memory, and the numbers of the actions.
        """
        ...


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Demonstrations:
    """Demonstrated decisions, those of one trajectory in order.

    Attributes:
        state: states of the world in which an action was demonstrated.
        target: row of `Targets` that the demonstration leads to.
        action: the action demonstrated.
        step: number of the decision within its trajectory, from 0.
    """

    state: Int32[Array, "decisions"]
    target: Int32[Array, "decisions"]
    action: Int32[Array, "decisions"]
    step: Int32[Array, "decisions"]


@dataclass(frozen=True)
class TrainingProblem:
    """What is to be learned, for one method and seed.

    Attributes:
        world: the training scenes.
        targets: the training targets; training sees no others.
        reward: pays every transition.
        cap: number of steps after which an episode is truncated.
        frames: environment steps of all workers together; agents round up to whole updates.
        return_scale: size of a typical return; agents that learn values divide rewards by it.
        goals: states that may serve as targets after the fact, and the cost of every state with each; only for agents
            that require "goals".
        demonstrations: the expert's decisions; only for agents that require "demonstrations".
    """

    world: World
    targets: Targets
    reward: RewardFunction
    cap: int
    frames: int
    return_scale: float = 1.0
    goals: Goals | None = None
    demonstrations: Demonstrations | None = None


class TrainingLog:
    """Receives the progress of a training and restores an interrupted one; this one keeps nothing."""

    def resume(self, state: State) -> tuple[State, list[Row]]:
        """Restore the last state that was kept.

        Args:
            state: the state before the first chunk of updates.

        Returns:
            The state to continue from, and the rows of the chunks before it.
        """
        return state, []

    def add(self, state: State, rows: list[Row]) -> None:
        """Take note of a chunk of updates.

        Args:
            state: the state after it.
            rows: the rows of all chunks so far.
        """


@runtime_checkable
class Agent(Protocol):
    """Something that learns: settings, and two functions."""

    @property
    def name(self) -> str:
        """Name of the agent in tables."""
        ...

    @property
    def requires(self) -> frozenset[Requirement]:
        """Optional parts of a `TrainingProblem` that `train` needs."""
        ...

    def train(self, key: PRNGKeyArray, problem: TrainingProblem, log: TrainingLog) -> tuple[Parameters, Any]:
        """Train on a problem.

        Args:
            key: source of all randomness of the training.
            problem: what is to be learned.
            log: receives the progress, and restores an interrupted training.

        Returns:
            The parameters, and the learning curve: a dataclass of equally long columns, one of them named `frames`.

        Raises:
            InputError: the settings do not suit the problem.
        """
        ...

    def policy(self, parameters: Parameters, world: World, targets: Targets) -> Policy:
        """Make a policy for scenes and targets.

        Args:
            parameters: the result of `train`.
            world: the scenes to act in.
            targets: the targets to find.

        Returns:
            The policy.

        Raises:
            InputError: the agent cannot act in these scenes.
        """
        ...


@runtime_checkable
class MultiSeedAgent(Agent, Protocol):
    """An agent that can train several seeds in one compiled program."""

    def prefers_joint_training(self) -> bool:
        """Whether that is faster on the devices at hand."""
        ...

    def train_jointly(
        self, keys: Sequence[PRNGKeyArray], problems: Sequence[TrainingProblem], log: TrainingLog
    ) -> list[tuple[Parameters, Any]]:
        """Train one network for each seed, see `Agent.train`."""
        ...
