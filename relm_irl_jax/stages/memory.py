"""Estimate of the memory that a run needs, so that absurd settings are refused before the work."""

from collections.abc import Sequence

from relm_irl_jax.agents.map.geometry import N_CELLS, Extent
from relm_irl_jax.agents.map.network import KERNEL, RECORD, VIEW
from relm_irl_jax.agents.map.rooms import places_along_side
from relm_irl_jax.config import Config
from relm_irl_jax.features.resnet import N_FEATURES
from relm_irl_jax.hardware import require_memory
from relm_irl_jax.results import PREDICTED
from relm_irl_jax.rewards.predicted import SCENES_AT_ONCE
from relm_irl_jax.scenes.scene import Scene, successors
from relm_irl_jax.scenes.selection import unseen_scenes
from relm_irl_jax.scenes.settings import ROOM_TYPES, ROOMS
from relm_irl_jax.stages.encoding import scene_settings
from relm_irl_jax.stages.make_agent import make_agent, needs_features, trains

LARGEST_ROOM = 876
"""Most states of a built-in room."""

FLOAT32, FLOAT64 = 4, 8
"""Bytes of a number."""

COPIES = 3
"""Arrays of the size of all features: as encoded, standardised, and on the device."""

COST_TABLES = 8
"""Arrays of costs of every state for every goal while costs to go are computed, one for each action among them."""

ACTIVATIONS = 4
"""Arrays of a training step with one row of a layer's width for each frame: three layers and a gradient."""

GATES = 4
"""Products of each unit of a recurrent memory."""

MATRICES = 3
"""Matrices of the size of the hidden layer's outputs while a regressor is fitted."""

MAPPED_VIEW = 2 * VIEW**2 * 3 + 2 * N_CELLS * (RECORD + KERNEL) * FLOAT32
"""Bytes of a state while the mapping agent looks at all views: its view, of its scene and among those of all, and what
the network says about it, in batches and together."""

MAPPED_CELL = 2 * (RECORD + KERNEL) * FLOAT32
"""Bytes of a cell of the map of an episode: its sums before and after a step, their means, and their Fourier
transform."""


def check_memory(config: Config) -> None:
    """Refuse a configuration that the memory does not suffice for.

    Args:
        config: the configuration.

    Raises:
        InputError: some part needs more memory than is available; names its settings.
    """
    for what, needed in estimates(config).items():
        require_memory(needed, what)


def check_scenes_memory(config: Config, scenes: Sequence[Scene]) -> None:
    """Refuse scenes that the memory does not suffice for.

    Args:
        config: the configuration.
        scenes: the training scenes.

    Raises:
        InputError: some part needs more memory than is available.
    """
    for what, needed in estimates_of_scenes(config, scenes).items():
        require_memory(needed, what)


def estimates_of_scenes(config: Config, scenes: Sequence[Scene]) -> dict[str, int]:
    """Lower bounds of the bytes that each part of a run needs, for scenes whose sizes are known.

    Args:
        config: the configuration.
        scenes: the training scenes.

    Returns:
        Bytes by the part of the run.
    """
    sizes = [scene.n_states for scene in scenes]
    needed = {}
    required = make_agent(config, "rl").requires
    if "goals" in required:
        what = f"training the {config.agent} agent on {max(sizes):,} states of a scene and as many goals"
        needed[what] = len(sizes) * max(sizes) ** 2 * COST_TABLES * FLOAT32
    if "features" not in required and config.scenes != ROOMS:  # an agent that looks at pixels
        evaluated = _evaluated(config, scenes)
        states = max(sum(sizes) if trains(config) else 0, sum(scene.n_states for scene in evaluated))
        needed[f"the mapping agent's look at the views of {states:,} states"] = states * MAPPED_VIEW
        places = max(places_along_side(successors(scene.graph)) for scene in evaluated)
        needed[f"the mapping agent's map of scenes up to {places:,} places wide"] = (
            len(evaluated) * Extent.of_places(places).grid ** 2 * MAPPED_CELL
        )
    if set(PREDICTED) & set(config.chosen_methods()):
        needed |= _predictions(config, sizes)
    return needed


def _evaluated(config: Config, scenes: Sequence[Scene]) -> Sequence[Scene]:
    """The scenes of a folder that are evaluated; of the training scenes, as small ones as the targets allow."""
    if config.task == "III":
        return [load(views=False) for load in unseen_scenes(config.scenes, scene_settings(config))]
    shown = config.tasks.training_targets if config.task == "I" else len(scenes)  # every scene has a new target
    return sorted(scenes, key=lambda scene: scene.n_states)[:shown]


def _predictions(config: Config, sizes: Sequence[int]) -> dict[str, int]:
    """Bytes of tables of predicted rewards."""
    siamese = config.siamese
    projected = sum(sorted(sizes)[-SCENES_AT_ONCE:])
    weights = config.tasks.training_targets * min(sizes) * (config.irl.dimension or 1)
    needed = {
        # Every view's as a start and as a target, their sum and its activation.
        f"elm.hidden: the neurons of {projected:,} states": 2 * (projected + max(sizes)) * config.elm.hidden * FLOAT64,
        "tasks.training_targets and irl.dimension: the predicted weights of every state": weights * COPIES * FLOAT32,
    }
    if "imagined" in make_agent(config, "relm-irl").requires:
        targets = max(size * min(siamese.imagined_targets, size // 2) for size in sizes)
        # A lower bound: the smallest scenes that an update may draw.
        drawn = sum(sorted(sizes)[: siamese.scenes_at_once])
        needed |= {
            "siamese.imagined_targets: their rewards": targets * 2 * FLOAT64,
            "siamese.targets_at_once and siamese.width: a training step": drawn
            * (siamese.targets_at_once * siamese.width * ACTIVATIONS * FLOAT32),
        }
    return needed


def estimates(config: Config) -> dict[str, int]:
    """Lower bounds of the bytes that each part of a run needs.

    Args:
        config: the configuration.

    Returns:
        Bytes by the settings that determine them.
    """
    needed = {}
    if config.scenes == ROOMS:
        if needs_features(config):
            states = _states_of_rooms(config, config.scene.training_per_type)
            needed["scene.training_per_type: features"] = states * N_FEATURES * COPIES * FLOAT32
        # Views are in memory for one room at a time.
        needed["scene.image_size: the views of a room"] = (
            LARGEST_ROOM * (scene_settings(config).image_size or 0) ** 2 * 3
        )
        if config.trained_agent == "map":
            per_type = "unseen_per_type" if config.task == "III" else "training_per_type"
            states = _states_of_rooms(config, getattr(config.scene, per_type))
            needed[f"scene.{per_type}: the mapping agent's look at the views of all rooms"] = states * MAPPED_VIEW
    needed |= _training_steps(config).get(config.trained_agent, {})
    if set(PREDICTED) & set(config.chosen_methods()):
        # `elm.pairs` is an upper bound, of which a run with few demonstrations has fewer.
        needed["elm.hidden and elm.pairs: fitting the regressor"] = (
            config.elm.hidden * min(config.elm.pairs, config.elm.hidden) * MATRICES * FLOAT64
        )
    return needed


def _states_of_rooms(config: Config, per_type: int) -> int:
    """States of built-in rooms."""
    return len(ROOM_TYPES) * per_type * (20 * 4 if config.scene.size == "tiny" else LARGEST_ROOM // 2)


def _training_steps(config: Config) -> dict[str, dict[str, int]]:
    """Bytes of a training step of each agent."""
    siamese, metric = config.siamese, config.metric
    frames = siamese.workers * siamese.t_max
    pairs = metric.states * metric.goals * metric.groups
    return {
        "siamese": {
            "siamese.workers, siamese.t_max and siamese.width: a training step": frames
            * (siamese.width * ACTIVATIONS * FLOAT32)
        },
        **{
            name: {
                f"{name}.workers, {name}.t_max and {name}.memory: a training step": settings.workers
                * settings.t_max
                * (settings.memory * GATES * ACTIVATIONS * FLOAT32)
            }
            for name, settings in (("recurrent", config.recurrent), ("savn", config.savn))
        },
        "metric": {
            "metric.states, metric.goals and metric.groups: a training step": pairs * ACTIVATIONS * FLOAT32,
            "metric.workers and metric.t_max: a training step": metric.workers * metric.t_max * ACTIVATIONS * FLOAT32,
        },
    }
