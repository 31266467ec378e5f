"""Policies see observations alone: renumbering every state of a world changes no action of any agent."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny import RECURRENT, SAVN, SMALL, TARGETS, problem, two_rooms

from relm_irl_jax.agents.map.agent import MapAgent
from relm_irl_jax.agents.map.loss import initial_parameters
from relm_irl_jax.agents.map.network import VIEW, MapNetwork
from relm_irl_jax.agents.metric.agent import MetricAgent
from relm_irl_jax.agents.random_agent import RandomPolicy
from relm_irl_jax.agents.recurrent.agent import RecurrentAgent
from relm_irl_jax.agents.savn.agent import SavnAgent
from relm_irl_jax.agents.settings import MetricSettings
from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.agents.siamese.behaviour_cloning import BehaviourCloningAgent
from relm_irl_jax.evaluation import trace_episodes
from relm_irl_jax.rewards.goals import manual_goals
from relm_irl_jax.rewards.settings import ManualSettings
from relm_irl_jax.tasks import TaskSplit
from relm_irl_jax.types import TrainingLog
from relm_irl_jax.world import Targets, World

CAP = 20
METRIC = MetricSettings(width=8, dimension=4, groups=2, workers=8, t_max=4, states=8, goals=8)


@dataclasses.dataclass(frozen=True)
class RandomAgent:
    requires = frozenset()

    def train(self, key, problem, log):
        return {}, None

    def policy(self, parameters, world, targets):
        return RandomPolicy()


def mapping_agent(order: np.ndarray) -> MapAgent:
    """The mapping agent, untrained, in two rooms of noise whose states have the numbers of `order`."""
    images = np.random.default_rng(3).integers(0, 255, (40, VIEW, VIEW, 3)).astype(np.uint8)[order]
    network = MapNetwork(width=16, channels=8)
    views = {"bathroom-0": images[:16], "bedroom-0": images[16:]}.__getitem__
    return MapAgent(views, trained=lambda: initial_parameters(network), network=network)


AGENTS = {
    "random": RandomAgent(),
    "siamese": SiameseAgent(SMALL),
    "siamese, three views": SiameseAgent(dataclasses.replace(SMALL, history=3)),
    "behaviour cloning": BehaviourCloningAgent(SMALL),
    "metric": MetricAgent(METRIC),
    "recurrent": RecurrentAgent(RECURRENT),
    "map": mapping_agent(np.arange(40)),
    "savn": SavnAgent(SAVN),
}


def renumbered(world: World, targets: Targets, order: np.ndarray) -> tuple[World, Targets]:
    """The same world; what was state order[i] is now state i. Scenes stay where they are."""
    new = np.argsort(order)
    as_states = lambda old: jnp.asarray(new[np.asarray(old)], jnp.int32)  # noqa: E731
    local = np.asarray(world.local)
    first = np.searchsorted(np.asarray(world.scene), np.asarray(targets.scene))
    distance = np.asarray(targets.distance).copy()
    for row, start in enumerate(first):
        size = int((np.asarray(world.scene) == int(targets.scene[row])).sum())
        distance[row, :size] = distance[row, local[order[start : start + size]]]
    valid = np.arange(targets.start.shape[1]) < np.asarray(targets.n_starts)[:, None]
    return (
        dataclasses.replace(world, successor=as_states(world.successor)[order], features=world.features[order]),
        dataclasses.replace(
            targets,
            state=as_states(targets.state),
            start=jnp.where(valid, as_states(targets.start), 0),
            distance=jnp.asarray(distance),
        ),
    )


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n == "savn" else n for n in AGENTS])
def test_renumbering_all_states_changes_no_action(name):
    agent, given = AGENTS[name], problem(frames=256)
    if "goals" in agent.requires:
        split = TaskSplit(tuple(TARGETS), (), (), ())
        given = dataclasses.replace(given, goals=manual_goals(two_rooms(), split, "strict", ManualSettings()))
    parameters, _ = agent.train(jax.random.key(0), given, TrainingLog())
    generator = np.random.default_rng(1)
    order = np.concatenate([generator.permutation(16), 16 + generator.permutation(24)])
    world, targets = renumbered(given.world, given.targets, order)
    same = mapping_agent(order) if name == "map" else agent  # its views are not among the world's features
    key = jax.random.key(2)
    before, row = trace_episodes(
        key, agent.policy(parameters, given.world, given.targets), given.world, given.targets, CAP
    )
    after, same_row = trace_episodes(key, same.policy(parameters, world, targets), world, targets, CAP)
    np.testing.assert_array_equal(row, same_row)
    np.testing.assert_array_equal(order[after], before)
    assert len(np.unique(before)) > 4  # the agents move
