"""Estimate of the memory that a run needs, so that absurd settings are refused before the work."""

from collections.abc import Sequence

from relm_irl_jax.agents.map.network import VIEW
from relm_irl_jax.config import Config
from relm_irl_jax.features.resnet import N_FEATURES
from relm_irl_jax.hardware import require_memory
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.settings import ROOM_TYPES, ROOMS
from relm_irl_jax.stages.encoding import scene_settings
from relm_irl_jax.stages.make_agent import make_agent, needs_features

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


def check_memory(config: Config) -> None:
    """Refuse a configuration that the memory does not suffice for.

    Args:
        config: the configuration.

    Raises:
        InputError: some part needs more memory than is available; names its settings.
    """
    for what, needed in estimates(config).items():
        require_memory(needed, what)


def check_goals_memory(config: Config, scenes: Sequence[Scene]) -> None:
    """Refuse scenes that are too large for an agent that learns the costs of every state for every goal.

    Args:
        config: the configuration.
        scenes: the training scenes.

    Raises:
        InputError: the costs need more memory than is available.
    """
    if "goals" not in make_agent(config, "rl").requires:
        return
    largest = max(scene.n_states for scene in scenes)
    needed = len(scenes) * largest**2 * COST_TABLES * FLOAT32
    require_memory(needed, f"training the {config.agent} agent on {largest:,} states of a scene and as many goals")


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
            needed["scene.training_per_type: features"] = _training_states(config) * N_FEATURES * COPIES * FLOAT32
        # Views are in memory for one room at a time.
        needed["scene.image_size: the views of a room"] = (
            LARGEST_ROOM * (scene_settings(config).image_size or 0) ** 2 * 3
        )
    needed |= _training_steps(config).get(config.trained_agent, {})
    if {"elm-irl", "relm-irl"} & set(config.chosen_methods()):
        # `elm.pairs` is an upper bound, of which a run with few demonstrations has fewer.
        needed["elm.hidden and elm.pairs: fitting the regressor"] = (
            config.elm.hidden * min(config.elm.pairs, config.elm.hidden) * MATRICES * FLOAT64
        )
    return needed


def _training_states(config: Config) -> int:
    """States of all training scenes, if they are built-in rooms."""
    if config.scenes != ROOMS:
        return 0
    rooms = len(ROOM_TYPES) * config.scene.training_per_type
    return rooms * (20 * 4 if config.scene.size == "tiny" else LARGEST_ROOM // 2)


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
        "map": {"scene.training_per_type: views of the mapping agent": _training_states(config) * VIEW**2 * 3},
    }
