"""Training of an agent with a reward of the user's choice."""

import dataclasses
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import jax
import jax.numpy as jnp
import numpy as np

from relm_irl_jax.agents.map.agent import MapAgent
from relm_irl_jax.agents.map.network import VIEW
from relm_irl_jax.api.scenes import Scenes, config_of
from relm_irl_jax.api.setting import ListedViews, Setting, prepare
from relm_irl_jax.config import METHODS, Config, Method, overlay
from relm_irl_jax.errors import InputError
from relm_irl_jax.irl import WeightsOf
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.results import LEARNED
from relm_irl_jax.rewards.functions import OwnReward
from relm_irl_jax.stages.make_agent import check_agent, make_agent, trains
from relm_irl_jax.stages.rewards import learn
from relm_irl_jax.stages.training import SeedInputs, training_problem
from relm_irl_jax.stages.worlds import EvaluationTask
from relm_irl_jax.tasks import draw_split
from relm_irl_jax.transitions import FeatureReward
from relm_irl_jax.types import Agent, Parameters, Policy, Row, State, TrainingLog, TrainingProblem
from relm_irl_jax.world import scene_offsets

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Curve = dict[str, np.ndarray]
"""A learning curve: columns of equal length, one of them named `frames`."""


@dataclass(frozen=True, eq=False)
class Trained:
    """A trained agent; `relm_irl_jax.evaluate` takes it.

    Attributes:
        name: its name in tables.
        agent: the agent.
        setting: the training scenes.
        parameters: the network of each seed.
        curves: the learning curve of each seed.
    """

    name: str
    agent: Agent
    setting: Setting
    parameters: dict[int, Parameters]
    curves: dict[int, Curve]

    @property
    def curve(self) -> Curve:
        """The learning curve of the first seed."""
        return next(iter(self.curves.values()))

    def policy(self, task: EvaluationTask) -> Policy:
        """The policy of a task's seed for its scenes and targets."""
        return self.agent.policy(self.parameters[task.seed], task.world, task.targets)

    def plot(self) -> "Figure":
        """The learning curve: path length error, success rate and SPL, with 95% intervals over several seeds.

        Raises:
            InputError: the agent's learning curve has no such columns, or it was not trained.
        """
        from relm_irl_jax.report.learning_curves import TrainingCurve, learning_figure  # loads matplotlib

        if "ipykernel" in sys.modules:  # figures are then shown below cells, also where nobody imported pyplot
            import_module("matplotlib_inline.backend_inline")
        names = [column.name for column in dataclasses.fields(TrainingCurve)]
        missing = [name for name in names if name not in self.curve]
        if missing or not len(self.curve["frames"]):
            raise InputError(
                f"plot: the learning curve has no {missing[0] if missing else 'rows'}; draw `curve` yourself."
            )
        drawn = {seed: TrainingCurve(**{n: curve[n] for n in names}) for seed, curve in self.curves.items()}
        return learning_figure({self.name: drawn})


def train(
    scenes: Scenes = "rooms",
    agent: str | Agent = "siamese",
    reward: str | FeatureReward = "rl",
    frames: int | str | None = None,
    *,
    seeds: int | Sequence[int] = 1,
    targets: int | None = None,
    irl: WeightsOf | None = None,
    name: str | None = None,
    config: Config | None = None,
) -> Trained:
    """Train an agent to find targets in scenes.

    Args:
        scenes: the training scenes: a list, `rooms` or a folder.
        agent: `siamese`, `recurrent`, `savn`, `metric` or `map`; or an object with the protocol
            `relm_irl_jax.types.Agent`.
        reward: a pure function of `relm_irl_jax.transitions.TransitionFeatures` that JAX can trace; or a method of the
            paper: `rl` (hand-made), `irl`, `elm-irl` or `relm-irl`.
        frames: training frames for each seed, such as `300k` or 5e6; by default the agent's.
        seeds: number of seeds 0, 1, ..., or the seeds. Each draws targets of its own and trains a network of its own.
        targets: number of training targets; by default 20 in six scenes, and as many for a scene in other lists.
        irl: with `irl`, `elm-irl` or `relm-irl`, your own source of the weights w: a function of a
            `relm_irl_jax.irl.MaxMarginProblem`, called for every target. By default the configuration's method.
        name: its name in tables; by default the reward's.
        config: all other settings; by default those of `relm-irl train`. The mapping agent trains on listed scenes,
            unless `map.weights` names its weights (`package` for built-in rooms).

    Returns:
        The trained agent. Evaluation targets of its seeds, and unseen scenes, were not used.

    Raises:
        InputError: an argument or the scenes cannot be used.
        DivergenceError: the training diverged.
    """
    settings = config_of(scenes, config, targets)
    method = _method(reward)
    changes: dict[str, Any] = {"methods": [method]}
    if isinstance(agent, str):
        changes["agent"] = agent
    if frames is not None:
        changes["frames"] = frames if isinstance(frames, str) else int(frames)
    settings = overlay(settings, changes, "train")
    if settings.siamese.observe_reward:
        raise InputError("config: siamese.observe_reward needs a run folder; use `relm-irl train`.")
    if isinstance(agent, str):
        check_agent(settings, ("I",))
    learner = make_agent(settings, method) if isinstance(agent, str) else agent
    if isinstance(learner, MapAgent) and not isinstance(scenes, str | Path):
        learner = replace(learner, views=ListedViews(scenes, VIEW))
    if callable(reward) and (learner.name == "map" or "goals" in learner.requires):
        raise InputError(
            f"reward: the agent {learner.name} plans with costs of states, and trains on no reward of transitions; "
            "give another agent, such as siamese."
        )
    if irl is not None and method not in LEARNED:
        raise InputError(f"irl: {method} learns no weights; give reward={', '.join(map(repr, LEARNED))}.")
    setting = prepare(scenes, settings)
    title = name or (method if isinstance(reward, str) else getattr(reward, "__name__", "own reward").strip("<>"))
    parameters, curves = {}, {}
    for seed in numbered(seeds):
        problem = _problem(setting, method, seed, learner, (reward, irl))
        trained = not isinstance(agent, str) or trains(settings)  # the mapping agent may come with weights
        with progress_bar(f"training {title}, seed {seed}" if trained else None, problem.frames, "frames") as advance:
            parameters[seed], curve = learner.train(jax.random.key(seed), problem, _BarLog(advance))
        curves[seed] = {c.name: np.asarray(getattr(curve, c.name)) for c in dataclasses.fields(curve)}
    return Trained(title, learner, setting, parameters, curves)


def numbered(seeds: int | Sequence[int]) -> list[int]:
    """The seeds 0, 1, ... of a number, or the seeds themselves.

    Args:
        seeds: a number, or seeds.

    Returns:
        At least one seed.

    Raises:
        InputError: there is none, or one is negative.
    """
    chosen = list(range(seeds)) if isinstance(seeds, int) else [int(seed) for seed in seeds]
    if not chosen or min(chosen) < 0:
        raise InputError(f"seeds: {seeds} is refused; give a number of seeds, or a list of numbers from 0 on.")
    return chosen


def _method(reward: str | FeatureReward) -> Method:
    """The method whose problem the training starts from."""
    if callable(reward):
        return "rl"
    if reward not in METHODS or reward == "random":
        allowed = ", ".join(method for method in METHODS if method != "random")
        raise InputError(
            f"reward: {reward!r} is none; give one of {allowed}, or a function of a transition's features."
        )
    return cast(Method, reward)


def _problem(
    setting: Setting, method: Method, seed: int, agent: Agent, own: tuple[str | FeatureReward, WeightsOf | None]
) -> TrainingProblem:
    scenes, config, (reward, irl) = setting.training.scenes, setting.config, own
    split = draw_split(scenes, (), config.tasks, seed)
    learned = learn(config, scenes, split, seed, weights_of=irl) if method in LEARNED else None
    problem = training_problem(config, method, SeedInputs(seed, scenes, split, learned), agent)
    if isinstance(reward, str):
        return problem
    paid = OwnReward(jnp.asarray(np.concatenate([scene.encoded for scene in scenes])), reward)
    assert len(paid.features) == scene_offsets(scenes)[-1] + scenes[-1].n_states
    return replace(problem, reward=paid)


class _BarLog(TrainingLog):
    """Moves a progress bar."""

    def __init__(self, advance: Callable[[int], None]):
        self._advance, self._frames = advance, 0.0

    def add(self, state: State, rows: list[Row]) -> None:
        """Move the bar to the frames of the last row."""
        self._advance(int(rows[-1]["frames"] - self._frames))
        self._frames = rows[-1]["frames"]
