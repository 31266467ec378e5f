"""Weights of the mapping agent as a file: safetensors in half precision, with where they come from."""

from collections.abc import Mapping
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from flax.traverse_util import flatten_dict, unflatten_dict

from relm_irl_jax.agents.map.loss import initial_parameters
from relm_irl_jax.agents.map.network import MapNetwork
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import load_arrays_and_metadata, save_arrays
from relm_irl_jax.types import Parameters

SHIPPED = Path(__file__).with_name("weights.safetensors")
"""Weights that come with the package: trained in two stages, as their provenance says, and to be replaced by one run of
`make weights`."""


def save_weights(path: Path, parameters: Parameters, provenance: Mapping[str, str]) -> None:
    """Write parameters in half precision.

    Args:
        path: the file.
        parameters: the agent's parameters.
        provenance: how they were trained: command, rooms, version of the generator, duration.
    """
    flat = flatten_dict(dict(parameters), sep="/")
    save_arrays(path, {str(name): np.asarray(leaf, np.float16) for name, leaf in flat.items()}, provenance)


def load_weights(path: Path = SHIPPED) -> tuple[Parameters, dict[str, str]]:
    """Read parameters.

    Args:
        path: a file that `save_weights` wrote, or the network of a run of this agent.

    Returns:
        The parameters in single precision, and their provenance.

    Raises:
        InputError: the file is missing, damaged, or holds another network's weights.
    """
    flat, provenance = load_arrays_and_metadata(path)
    parameters = unflatten_dict({name: jnp.asarray(leaf, jnp.float32) for name, leaf in flat.items()}, sep="/")
    form = jax.eval_shape(lambda: initial_parameters(MapNetwork()))
    if jax.tree.map(np.shape, parameters) != jax.tree.map(np.shape, form):
        raise InputError(f"{path}: the weights do not fit the mapping agent's network; give a file of its weights.")
    return parameters, provenance
