"""Weights of the mapping agent as a file: safetensors in half precision, with where they come from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax.traverse_util import flatten_dict, unflatten_dict
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from relm_irl_jax.agents.map.network import MapNetwork
from relm_irl_jax.agents.map.train import initial_parameters
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import whole_file
from relm_irl_jax.types import Parameters

SHIPPED = Path(__file__).with_name("weights.safetensors")
"""Weights that come with the package: trained in two stages, as their provenance says, and to be replaced by one run of
`experiments/map_weights.py`."""


def _flat(parameters: Parameters) -> dict[str, Any]:
    """Parameters by their path."""
    return {str(name): leaf for name, leaf in flatten_dict(dict(parameters), sep="/").items()}


def save_weights(path: Path, parameters: Parameters, provenance: Mapping[str, str]) -> None:
    """Write parameters in half precision.

    Args:
        path: the file.
        parameters: the agent's parameters.
        provenance: how they were trained: command, rooms, version of the generator, scores.
    """
    flat = {name: np.asarray(leaf, np.float16) for name, leaf in _flat(parameters).items()}
    with whole_file(path) as temporary:
        save_file(flat, temporary, metadata=dict(provenance))


def load_weights(path: Path = SHIPPED) -> tuple[Parameters, dict[str, str]]:
    """Read parameters.

    Args:
        path: a file that `save_weights` wrote.

    Returns:
        The parameters in single precision, and their provenance.

    Raises:
        InputError: the file is missing, damaged, or holds another network's weights.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; train the mapping agent's weights with experiments/map_weights.py.")
    try:
        with safe_open(path, "np") as file:
            flat = {name: jnp.asarray(file.get_tensor(name), jnp.float32) for name in file.keys()}  # noqa: SIM118
            provenance = file.metadata() or {}
    except SafetensorError as error:
        raise InputError(f"{path}: no safetensors file ({error}).") from error
    expected = _flat(jax.eval_shape(lambda: initial_parameters(MapNetwork())))
    shapes = {name: leaf.shape for name, leaf in flat.items()}
    if shapes != {name: leaf.shape for name, leaf in expected.items()}:
        raise InputError(f"{path}: the weights do not fit the mapping agent's network; train them again.")
    return unflatten_dict(flat, sep="/"), provenance
