"""The mapping agent: trained on walks, it searches for targets in rooms that it has never seen.

See the modules beside this one: `network` looks at views, `memory` draws the map, `posterior` says where the target may
be, `planner` which way to search, `policy` puts them together, `loss`, `update`, `walks` and `training_rooms` teach the
network.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64, PRNGKeyArray, UInt8

from relm_irl_jax.agents.map.augmentation import draw_filter, gamma_corrected
from relm_irl_jax.agents.map.filled import fill_maps
from relm_irl_jax.agents.map.loss import Losses, initial_parameters
from relm_irl_jax.agents.map.network import VIEW, MapNetwork, look
from relm_irl_jax.agents.map.policy import MapPolicy, SearchSettings, map_policy
from relm_irl_jax.agents.map.rooms import Room, room_from_graph, world_extent
from relm_irl_jax.agents.map.training_rooms import GivenRooms, TrainingRooms
from relm_irl_jax.agents.map.update import Numbers, TrainState, make_optimizer, update
from relm_irl_jax.agents.map.walks import Walks, draw_walks
from relm_irl_jax.agents.map.weights import fits
from relm_irl_jax.agents.settings import MapSettings
from relm_irl_jax.agents.training import Chunks, curve_from_rows, run_chunks, split_into_chunks
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import Parameters, Requirement, TrainingLog, TrainingProblem
from relm_irl_jax.world import Targets, World

Views = UInt8[np.ndarray, "_ _ _ 3"]


@dataclass(frozen=True)
class MapCurve:
    """Progress of the training, one entry for each chunk of updates.

    Attributes:
        frames: views of all walks up to the end of the chunk.
        location_loss: cross-entropy of the target's pose in nats, mean over the prefixes of the walks.
        location_accuracy: share of targets whose pose is the most probable one, mean over the prefixes.
        last_location_loss: cross-entropy of the target's pose after whole walks, in nats.
        last_location_accuracy: share of targets whose pose is the most probable one after whole walks.
        free_loss: cross-entropy of a place's being free.
    """

    frames: Float64[np.ndarray, "chunks"]
    location_loss: Float64[np.ndarray, "chunks"]
    location_accuracy: Float64[np.ndarray, "chunks"]
    last_location_loss: Float64[np.ndarray, "chunks"]
    last_location_accuracy: Float64[np.ndarray, "chunks"]
    free_loss: Float64[np.ndarray, "chunks"]


@dataclass(frozen=True)
class MapAgent:
    """Draws a map while it searches.

    A `World` holds features, but this agent looks at pixels: it is given the views of all scenes beforehand.

    Attributes:
        views: returns RGB views of 64 × 64 pixels of a scene's states, given the scene's name.
        settings: how it is trained and how it searches.
        rooms: rooms to train on; None for the scenes of the problem.
        trained: returns trained parameters, which are used instead of training; None to train.
        network: what looks at views.
        name: the agent's name.
    """

    views: Callable[[str], Views]
    settings: MapSettings = field(default_factory=MapSettings)
    rooms: TrainingRooms | None = None
    trained: Callable[[], Parameters] | None = None
    network: MapNetwork = field(default_factory=MapNetwork)
    name: str = "map"

    @property
    def requires(self) -> frozenset[Requirement]:
        """Goals, whose states may be targets, to train on the scenes of a problem."""
        on_problem = self.rooms is None and self.trained is None
        return frozenset[Requirement](("goals",) if on_problem else ())

    def train(self, key: PRNGKeyArray, problem: TrainingProblem, log: TrainingLog) -> tuple[Parameters, MapCurve]:
        """Learn from walks, or return the trained parameters with an empty curve.

        Args:
            key: source of all randomness.
            problem: gives the number of frames, which are the views of walks, and the scenes and targets if `rooms` is
                None; its reward is not used.
            log: receives the progress, and restores an interrupted training.

        Returns:
            The parameters and the learning curve.

        Raises:
            InputError: a scene's views are missing or do not fit it.
        """
        if self.trained is not None:
            return self.trained(), curve_from_rows(MapCurve, [])
        rooms = self.rooms or GivenRooms(world_rooms(problem, world_views(self.views, problem.world)))
        return train_on_rooms(key, rooms, problem.frames, self.settings, log, self.network)

    def policy(self, parameters: Parameters, world: World, targets: Targets) -> MapPolicy:
        """Prepare the policy for a world.

        Args:
            parameters: trained parameters.
            world: the scenes.
            targets: the targets.

        Returns:
            The policy; in a world of training scenes alone, its memory may begin filled.

        Raises:
            InputError: a scene's views are missing or do not fit it.
            ValueError: the parameters are not those of the network.
        """
        if not fits(parameters, self.network):
            raise ValueError("the parameters do not fit the network")
        views = world_views(self.views, world)
        seen = gamma_corrected(views, self.settings.gamma)
        projections = look(self.network, parameters["network"], jnp.asarray(seen))
        known = self.settings.memory == "filled" and bool((np.asarray(world.training_scene) >= 0).all())
        extent = world_extent(world)
        filled = fill_maps(projections.record, views, world, extent) if known else None
        search, rows = search_settings(self.settings), np.asarray(targets.state)
        return map_policy(parameters, projections, rows, search, extent, filled)


def search_settings(settings: MapSettings) -> SearchSettings:
    """Numbers of the search as arrays, so that other numbers do not compile again.

    Args:
        settings: the agent's settings.

    Returns:
        The same as arrays.
    """
    return SearchSettings(
        discount=jnp.float32(settings.discount),
        caution=jnp.float32(settings.caution),
        confident=jnp.float32(settings.confident),
        turns=jnp.int32(settings.turns),
        temperature=jnp.float32(settings.temperature),
    )


def train_on_rooms(
    key: PRNGKeyArray,
    rooms: TrainingRooms,
    frames: int,
    settings: MapSettings,
    log: TrainingLog,
    network: MapNetwork,
) -> tuple[Parameters, MapCurve]:
    """Train on walks through rooms.

    Args:
        key: source of initial weights and walks.
        rooms: where to walk.
        frames: views of all walks; rounded up to whole chunks of updates.
        settings: the settings.
        log: receives the progress, and restores an interrupted training.
        network: the network.

    Returns:
        The parameters and the learning curve.
    """
    seed = int(jax.random.randint(key, (), 0, 2**31 - 1))
    chunks = split_into_chunks(frames, settings.walks * settings.views)
    numbers = Numbers(
        learning_rate=jnp.float32(settings.learning_rate),
        weight_decay=jnp.float32(settings.weight_decay),
        free_weight=jnp.float32(settings.free_weight),
        updates=jnp.float32(chunks.count * chunks.updates),
    )
    parameters = initial_parameters(network, seed)
    state = TrainState(parameters, jax.jit(make_optimizer(numbers).init)(parameters))
    ahead: dict[int, Future[list[Walks]]] = {}
    with ThreadPoolExecutor(1) as host:  # walks of the next chunk are drawn while this one is computed

        def chunk(state: TrainState, number: int) -> tuple[TrainState, dict[str, float]]:
            for wanted in (number, number + 1):
                if wanted < chunks.count and wanted not in ahead:
                    ahead[wanted] = host.submit(draw_chunk, rooms, settings, seed, wanted, chunks)
            losses = []
            for walks in ahead.pop(number).result():
                state, loss = update(state, walks, numbers, network)
                losses.append(loss)
            return state, _row(jax.device_get(losses), number, chunks)

        state, rows = run_chunks(state, chunk, chunks, log)
    return state.parameters, curve_from_rows(MapCurve, rows)


def draw_chunk(rooms: TrainingRooms, settings: MapSettings, seed: int, number: int, chunks: Chunks) -> list[Walks]:
    """Draw the walks of a chunk of updates.

    Args:
        rooms: where to walk.
        settings: how many walks, views and targets.
        seed: seed of all walks.
        number: index of the chunk, from 0.
        chunks: the chunks.

    Returns:
        Walks in one room for each update; a function of the arguments alone.
    """
    generator = np.random.default_rng([seed, 1, number])
    here = rooms.at(number / chunks.count)
    drawn = []
    for _ in range(chunks.updates):
        walks = draw_walks(
            here[int(generator.integers(len(here)))],
            generator,
            walks=settings.walks,
            steps=settings.views,
            targets=settings.targets,
            best_share=settings.best_share,
        )
        if settings.gamma != 1.0:  # otherwise views that an accelerator renders stay there
            walks = replace(
                walks,
                views=gamma_corrected(np.asarray(walks.views), settings.gamma),
                target_views=gamma_corrected(np.asarray(walks.target_views), settings.gamma),
            )
        if settings.augmentation == "random-convolution":
            walks = replace(walks, convolution=draw_filter(generator))
        drawn.append(walks)
    return drawn


def _row(losses: Sequence[Losses], number: int, chunks: Chunks) -> dict[str, float]:
    """The learning curve's row of a chunk."""
    pose, top = np.mean([loss.pose for loss in losses], 0), np.mean([loss.top for loss in losses], 0)
    return {
        "frames": float((number + 1) * chunks.frames),
        "location_loss": float(pose.mean()),
        "location_accuracy": float(top.mean()),
        "last_location_loss": float(pose[-1]),
        "last_location_accuracy": float(top[-1]),
        "free_loss": float(np.mean([loss.free for loss in losses])),
    }


def world_views(views: Callable[[str], Views], world: World) -> Views:
    """Put the views of scenes in the order of a world's states.

    Args:
        views: returns views of a scene's states, given the scene's name.
        world: the scenes.

    Returns:
        View of each state of the world.

    Raises:
        InputError: a scene's views are missing or do not fit it.
    """
    sizes = np.bincount(np.asarray(world.scene), minlength=world.n_scenes)
    parts = [views(name) for name in world.names]
    for name, size, part in zip(world.names, sizes.tolist(), parts, strict=True):
        if part.shape != (size, VIEW, VIEW, 3):
            raise InputError(
                f"{name}: the mapping agent needs {size} RGB views of {VIEW} × {VIEW} pixels, "
                f"not an array of shape {part.shape}."
            )
    return np.concatenate(parts)


def world_rooms(problem: TrainingProblem, views: Views) -> Sequence[Room]:
    """Take a problem's world apart into the rooms that walks need; poses are counted along its graph.

    Args:
        problem: training scenes, training targets, which become the rooms' best views, and goals, which say which
            states may be targets.
        views: view of each state of the world.

    Returns:
        One room a scene.
    """
    assert problem.goals is not None
    world, goals = problem.world, problem.goals
    scene, successor, target = np.asarray(world.scene), np.asarray(world.successor), np.asarray(problem.targets.state)
    rooms = []
    for number in range(world.n_scenes):
        states = np.flatnonzero(scene == number)
        first = int(states[0])
        best = target[scene[target] == number] - first
        allowed = np.asarray(goals.state)[number, : int(goals.count[number])]
        rooms.append(room_from_graph(views[states], successor[states] - first, best, allowed))
    return rooms
