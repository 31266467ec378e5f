"""The mapping agent: trained on walks, it searches for targets in rooms that it has never seen.

See the modules beside this one: `network` looks at views, `memory` draws the map, `posterior` says where the target may
be, `planner` which way to search, `policy` puts them together, `train` and `training_data` teach the network.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PRNGKeyArray, UInt8

from relm_irl_jax.agents.map.network import VIEW, MapNetwork, look
from relm_irl_jax.agents.map.policy import MapPolicy, SearchSettings, map_policy
from relm_irl_jax.agents.map.train import Curve, MapSettings, train_map
from relm_irl_jax.agents.map.training_data import Room, room_from_graph
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import Parameters, Requirement, TrainingLog, TrainingProblem
from relm_irl_jax.world import Targets, World

Views = UInt8[np.ndarray, "_ _ _ 3"]


@dataclass(frozen=True)
class MapAgent:
    """Draws a map while it searches.

    A `World` holds features, but this agent looks at pixels: it is given the views of all scenes beforehand.

    Attributes:
        views: RGB views of 64 × 64 pixels of each scene's states, by the scene's name.
        settings: how it is trained.
        search: how it searches.
        network: what looks at views.
        name: the agent's name.
        requires: nothing optional of a training problem.
    """

    views: Mapping[str, Views]
    settings: MapSettings = field(default_factory=MapSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    network: MapNetwork = field(default_factory=MapNetwork)
    name: str = "map"
    requires: frozenset[Requirement] = frozenset()

    def train(self, key: PRNGKeyArray, problem: TrainingProblem, log: TrainingLog) -> tuple[Parameters, Curve]:
        """Learn from walks through the training scenes, for `settings.steps` updates.

        Args:
            key: source of all randomness.
            problem: the training scenes and targets; its reward and its number of frames are not used.
            log: not used yet: an interrupted training begins again.

        Returns:
            The parameters and the curve of losses.

        Raises:
            InputError: a scene's views are missing or do not fit it, or it is too large.
        """
        seed = int(jax.random.randint(key, (), 0, 2**31 - 1))
        rooms = world_rooms(problem.world, problem.targets, world_views(self.views, problem.world))
        return train_map(rooms, self.settings, seed, self.network)

    def policy(self, parameters: Parameters, world: World, targets: Targets) -> MapPolicy:
        """Prepare the policy for a world.

        Args:
            parameters: trained parameters.
            world: the scenes.
            targets: the targets.

        Returns:
            The policy.

        Raises:
            InputError: a scene's views are missing or do not fit it.
        """
        projections = look(self.network, parameters["network"], jnp.asarray(world_views(self.views, world)))
        return map_policy(parameters, projections, np.asarray(targets.state), traced(self.search))


def traced(search: SearchSettings) -> SearchSettings:
    """Search settings as arrays, so that other numbers do not compile again.

    Args:
        search: the settings.

    Returns:
        The same as arrays.
    """
    return jax.tree.map(lambda x: jnp.asarray(x, jnp.int32 if isinstance(x, int) else jnp.float32), search)


def world_views(views: Mapping[str, Views], world: World) -> Views:
    """Put the views of scenes in the order of a world's states.

    Args:
        views: views of each scene's states, by the scene's name.
        world: the scenes.

    Returns:
        View of each state of the world.

    Raises:
        InputError: a scene's views are missing or do not fit it.
    """
    sizes = np.bincount(np.asarray(world.scene), minlength=world.n_scenes)
    for name, size in zip(world.names, sizes.tolist(), strict=True):
        if name not in views:
            raise InputError(f"{name}: the mapping agent needs the scene's views; load the scene with views.")
        if views[name].shape != (size, VIEW, VIEW, 3):
            raise InputError(
                f"{name}: the mapping agent needs {size} RGB views of {VIEW} × {VIEW} pixels, "
                f"not an array of shape {views[name].shape}."
            )
    return np.concatenate([views[name] for name in world.names])


def world_rooms(world: World, targets: Targets, views: Views) -> Sequence[Room]:
    """Take a world apart into the rooms that walks need; poses are counted along its graph.

    Args:
        world: the training scenes.
        targets: the training targets, which become the rooms' best views.
        views: view of each state of the world.

    Returns:
        One room a scene.
    """
    scene, successor, goal = np.asarray(world.scene), np.asarray(world.successor), np.asarray(targets.state)
    rooms = []
    for number in range(world.n_scenes):
        states = np.flatnonzero(scene == number)
        first = int(states[0])
        best = goal[scene[goal] == number] - first
        rooms.append(room_from_graph(views[states], successor[states] - first, best))
    return rooms
