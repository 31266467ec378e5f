"""The interfaces between the parts of the package: learning problem, agent and policy.

    TrainingProblem ── Agent.train ──> parameters ── Agent.policy ──> Policy ── evaluation, play, report

An `Agent` turns a `TrainingProblem` into network parameters, and parameters into a `Policy`. Code that evaluates or
displays behaviour uses `Policy` only. A new agent implements these two protocols in a folder of `relm_irl_jax.agents`
and is added to `relm_irl_jax.stages.make_agent` and `relm_irl_jax.config`.

Batches have two axes, `scenes batch`: row i of every array acts in scene i of the world.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeVar, runtime_checkable

import jax
import numpy as np
from jaxtyping import Array, Bool, Float32, Int32, PRNGKeyArray

from relm_irl_jax.rewards.functions import RewardFunction
from relm_irl_jax.rewards.goals import Goals
from relm_irl_jax.rewards.imagined import ImaginedTargets
from relm_irl_jax.world import Targets, World

Parameters = Mapping[str, Any]
"""A network's parameters θ: nested dictionaries of arrays."""

Memory = Any
"""What a policy remembers within an episode: a pytree of arrays with leading axes `scenes batch`; may be empty."""

NO_MEMORY: Memory = ()
"""Memory of a policy without memory."""

Row = Mapping[str, float]
"""One row of a learning curve: a number for each column."""

State = TypeVar("State")
"""Everything that a training carries from chunk to chunk: a pytree of arrays."""

Requirement = Literal["features", "goals", "imagined", "demonstrations"]
"""An optional part of a `TrainingProblem`; without `features`, those of its world have no columns."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Observation:
    """An agent's observation before an action.

    Attributes:
        view: row of the observed view in the world's table of views. It is only a key into tables computed from views:
            renumbering all states changes no action.
        collided: whether the last action left the state unchanged; False at the start of an episode.
        running: whether the action will be taken; what a policy answers elsewhere is dropped. None where all are taken.
    """

    view: Int32[Array, "scenes batch"]
    collided: Bool[Array, "scenes batch"]
    running: Bool[Array, "scenes batch"] | None = None


@runtime_checkable
class Policy(Protocol):
    """A trained agent for given scenes and targets; a pytree of arrays."""

    def init(self, shape: tuple[int, ...]) -> Memory:
        """Return the memory of `shape` = (scenes, batch) agents before their first observation."""
        ...

    def act(
        self, key: PRNGKeyArray, memory: Memory, observation: Observation, target: Int32[Array, "scenes batch"]
    ) -> tuple[Memory, Int32[Array, "scenes batch"]]:
        """Choose one action for each agent.

        Args:
            key: source of randomness.
            memory: the memory from `init` or the previous call.
            observation: the current observation.
            target: rows of the policy's `Targets`.

        Returns:
            The next memory and the action numbers.
        """
        ...


@runtime_checkable
class DeterministicPolicy(Policy, Protocol):
    """A policy that can say that its actions do not depend on the key: equal observations get equal actions."""

    @property
    def deterministic(self) -> bool:
        """Whether they do not. Episodes of equal start and target are then run once."""
        ...


def is_deterministic(policy: Policy) -> bool:
    """Whether a policy says that it is deterministic.

    Args:
        policy: any policy.
    """
    return isinstance(policy, DeterministicPolicy) and policy.deterministic


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Belief:
    """What a policy believes about the target and the room, on a square of places in a frame of its own.

    Attributes:
        pose: heading in right angles clockwise, z and x in cells from the middle of the square: where it stands.
        probability: of each pose to be the target's, by heading, z and x.
        free: log odds that each place can be stood on.
        coverage: how much was seen of each place, from 0 to 1.
    """

    pose: Int32[Array | np.ndarray, "*batch 3"]
    probability: Float32[Array | np.ndarray, "*batch 4 z x"]
    free: Float32[Array | np.ndarray, "*batch z x"]
    coverage: Float32[Array | np.ndarray, "*batch z x"]


@runtime_checkable
class SearchingPolicy(Policy, Protocol):
    """A policy that can say where it believes the target to be."""

    def belief(self, memory: Memory, target: Int32[Array, "scenes batch"]) -> Belief:
        """The belief by which the last action was chosen.

        Args:
            memory: the memory that `act` returned.
            target: rows of the policy's `Targets`.

        Returns:
            The belief of each agent.
        """
        ...


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Demonstrations:
    """Demonstrated decisions; those of a trajectory are consecutive and in order.

    Attributes:
        state: states of the world in which an action was demonstrated.
        target: row in `Targets` of the demonstration's target.
        action: the demonstrated action.
        step: index of the decision within its trajectory, from 0.
    """

    state: Int32[Array, "decisions"]
    target: Int32[Array, "decisions"]
    action: Int32[Array, "decisions"]
    step: Int32[Array, "decisions"]


@dataclass(frozen=True)
class TrainingProblem:
    """A learning problem, for one method and seed.

    Attributes:
        world: the training scenes.
        targets: the training targets; the problem contains no others.
        reward: the reward function.
        cap: number of steps after which an episode is truncated.
        frames: total environment steps of all workers; agents round up to whole updates.
        return_scale: size of a typical return; agents that learn values divide rewards by it.
        goals: states that hindsight relabelling may use as targets, and the cost of every state for each; only for
            agents that require "goals".
        imagined: targets to train on instead of `targets` and `reward`; only for agents that require "imagined",
            and None for methods that cannot imagine.
        demonstrations: the expert's decisions; only for agents that require "demonstrations".
    """

    world: World
    targets: Targets
    reward: RewardFunction
    cap: int
    frames: int
    return_scale: float = 1.0
    goals: Goals | None = None
    imagined: ImaginedTargets | None = None
    demonstrations: Demonstrations | None = None


class TrainingLog:
    """Receives the progress of a training and restores an interrupted one; this base class stores nothing."""

    def resume(self, state: State) -> tuple[State, list[Row]]:
        """Restore the last stored state.

        Args:
            state: the state before the first chunk of updates.

        Returns:
            The state to continue from, and the rows of the chunks before it; `state` and no rows if nothing is stored.
        """
        return state, []

    def add(self, state: State, rows: list[Row]) -> None:
        """Report a finished chunk of updates.

        Args:
            state: the state after the chunk.
            rows: the rows of all chunks so far.
        """

    def stop(self, state: State, rows: list[Row]) -> None:
        """Store the last valid state of a training that stops before its end.

        Args:
            state: the state after the last valid chunk.
            rows: the rows of all chunks up to it.
        """


@runtime_checkable
class Agent(Protocol):
    """A learning agent: its settings, a function that trains, and a function that makes a policy."""

    @property
    def name(self) -> str:
        """Name of the agent in tables."""
        ...

    @property
    def requires(self) -> frozenset[Requirement]:
        """Optional parts of a `TrainingProblem` that `train` needs; `policy` needs `features` if `train` does."""
        ...

    def train(self, key: PRNGKeyArray, problem: TrainingProblem, log: TrainingLog) -> tuple[Parameters, Any]:
        """Train on a problem.

        Args:
            key: source of all randomness of the training.
            problem: the learning problem.
            log: receives the progress, and restores an interrupted training.

        Returns:
            The parameters, and the learning curve: a dataclass of columns of equal length, one of them named `frames`.

        Raises:
            InputError: the settings do not suit the problem.
        """
        ...

    def policy(self, parameters: Parameters, world: World, targets: Targets) -> Policy:
        """Make a policy for scenes and targets.

        Args:
            parameters: the result of `train`.
            world: the scenes.
            targets: the targets.

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
        """Whether joint training is faster on the available devices."""
        ...

    def train_jointly(
        self, keys: Sequence[PRNGKeyArray], problems: Sequence[TrainingProblem], log: TrainingLog
    ) -> list[tuple[Parameters, Any]]:
        """Train one network for each seed; see `Agent.train`."""
        ...
