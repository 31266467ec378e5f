"""Makes the agent that a configuration names; the only code that depends on the name."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from relm_irl_jax.agents.map.agent import MapAgent, Views
from relm_irl_jax.agents.map.network import VIEW
from relm_irl_jax.agents.map.training_rooms import GeneratedRooms
from relm_irl_jax.agents.map.weights import SHIPPED, load_weights
from relm_irl_jax.agents.metric.agent import MetricAgent
from relm_irl_jax.agents.recurrent.agent import RecurrentAgent
from relm_irl_jax.agents.savn.agent import SavnAgent
from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.agents.siamese.behaviour_cloning import BehaviourCloningAgent
from relm_irl_jax.config import MAP_METHODS, Config, Method, Task
from relm_irl_jax.errors import InputError
from relm_irl_jax.results import LEARNED
from relm_irl_jax.scenes.settings import ROOMS
from relm_irl_jax.scenes.views import scene_views
from relm_irl_jax.types import Agent, Parameters


def make_agent(config: Config, method: Method) -> Agent:
    """The agent that a method trains.

    Args:
        config: the configuration.
        method: the method; behaviour cloning has a separate agent.

    Returns:
        The agent.
    """
    greedy = config.evaluation.policy == "greedy"
    if method == "bc":
        return BehaviourCloningAgent(config.siamese, greedy)
    if config.agent == "metric":
        return MetricAgent(config.metric, greedy)
    if config.agent == "map":
        return _mapping_agent(config)
    if config.agent == "recurrent":
        return RecurrentAgent(config.recurrent, greedy)
    if config.agent == "savn":
        return SavnAgent(config.savn, greedy, config.evaluation.inner_steps)
    return SiameseAgent(config.siamese, greedy)


def _mapping_agent(config: Config) -> MapAgent:
    """The mapping agent, with its views, and with trained weights or rooms to train on."""
    config = config.resolved()
    views, weights = partial(scene_views, config.scenes, config.scene, VIEW), config.map.weights
    if weights != "train":
        path = SHIPPED if weights == "package" else Path(weights)
        return MapAgent(views, config.map, trained=lambda: load_weights(path)[0])
    rooms = GeneratedRooms(config.map.rooms, config.scene.size) if config.scenes == ROOMS else None
    return MapAgent(views, config.map, rooms)


def packaged_agent(views: Callable[[int], Views]) -> tuple[MapAgent, Parameters]:
    """The mapping agent with the weights of the package, for scenes that belong to no run.

    Args:
        views: returns RGB views of a scene's states, given their rows and columns.

    Returns:
        The agent and its parameters.
    """
    return MapAgent(lambda _: views(VIEW)), load_weights()[0]


def trains(config: Config) -> bool:
    """Whether the agent is trained in this run.

    Args:
        config: the configuration.

    Returns:
        False for the mapping agent with given weights.
    """
    return config.agent != "map" or config.resolved().map.weights == "train"


def needs_features(config: Config) -> bool:
    """Whether a method's agent or reward needs the features of views.

    Args:
        config: the configuration.

    Returns:
        Whether views must be encoded.
    """
    if set(config.chosen_methods()) & set(LEARNED):
        return True
    return "features" in make_agent(config, "rl").requires


def training_rooms_count(config: Config) -> int:
    """Number of built-in rooms that an agent trains on, or trained on where it comes with its weights.

    Args:
        config: the configuration.

    Returns:
        The number.
    """
    return config.map.rooms if config.agent == "map" else config.scene.training_rooms


def check_targets(config: Config) -> None:
    """Refuse fewer training targets than built-in rooms, before the rooms are rendered: targets of Task II are drawn
    near the training targets of every room.

    Args:
        config: the configuration.

    Raises:
        InputError: a training room would have no training target.
    """
    rooms, targets = config.scene.training_rooms, config.tasks.training_targets
    if config.scenes == ROOMS and targets < rooms:
        raise InputError(
            f"tasks.training_targets: {targets} leave some of the {rooms} training rooms without a target; give at "
            "least as many as rooms, or lower scene.training_per_type."
        )


def check_agent(config: Config, tasks: Sequence[Task]) -> None:
    """Raise an InputError for combinations of agent, methods and tasks that cannot work.

    Args:
        config: the configuration.
        tasks: the tasks to evaluate.

    Raises:
        InputError: the combination cannot work.
    """
    if config.agent != "siamese" and "bc" in config.chosen_methods():
        raise InputError("methods: bc clones the siamese agent's policy; leave it out, or use --agent siamese.")
    if config.agent == "map" and config.goals.arrival != "told":
        raise InputError(
            "goals.arrival: the mapping agent is trained on no reward; leave it out, or use --agent metric."
        )
    if config.agent == "map" and (unused := set(config.chosen_methods()) - set(MAP_METHODS)):
        raise InputError(
            f"methods: {', '.join(sorted(unused))} trains on a reward, which the mapping agent does not; "
            "give random and rl."
        )
    if config.agent == "map" and not trains(config) and (weights := config.resolved().map.weights) != "package":
        load_weights(Path(weights))  # raises before the work
    heads = {"siamese": config.siamese.heads, "recurrent": config.recurrent.heads, "savn": config.savn.heads}
    if heads.get(config.agent) == "scene" and "III" in tasks:
        raise InputError(
            f"{config.agent}.heads: scene has no head for the unseen scenes of task III; use room_type or shared."
        )
