"""What the mapping agent expects before it has seen anything: profiles over the distance from the start, as learned."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32

from relm_irl_jax.agents.map.geometry import Extent
from relm_irl_jax.agents.map.posterior import distance_bins
from relm_irl_jax.types import Parameters


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Prior:
    """Learned profiles, laid on the square of poses.

    Attributes:
        free: log odds that a place is free before anything is seen.
        pose: log probability of a pose at its distance from the start.
        scale: weight of the evidence that a place is free.
    """

    free: Float32[Array, "z x"]
    pose: Float32[Array, "z x"]
    scale: Float32[Array, ""]


def place_prior(parameters: Parameters, extent: Extent) -> Prior:
    """Lay the learned profiles on the square of poses.

    Args:
        parameters: the agent's parameters.
        extent: how far the map reaches.

    Returns:
        The prior.
    """
    bins = jnp.asarray(distance_bins(extent))
    prior = parameters["prior"]
    return Prior(jnp.asarray(prior["free"])[bins], jnp.asarray(prior["pose"])[bins], jnp.asarray(prior["scale"]))
