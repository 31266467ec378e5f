"""Makes the agent that a configuration names; the only code that depends on the name."""

from collections.abc import Sequence

from relm_irl_jax.agents.metric.agent import MetricAgent
from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.agents.siamese.behaviour_cloning import BehaviourCloningAgent
from relm_irl_jax.config import Config, Method, Task
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import Agent


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
    return SiameseAgent(config.siamese, greedy)


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
    if config.agent == "siamese" and config.siamese.heads == "scene" and "III" in tasks:
        raise InputError("siamese.heads: scene has no head for the unseen scenes of task III; use room_type or shared.")
