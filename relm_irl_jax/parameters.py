"""Files of network weights."""

from pathlib import Path

import numpy as np
from flax.traverse_util import flatten_dict, unflatten_dict

from relm_irl_jax.errors import DivergenceError, InputError
from relm_irl_jax.files import load_arrays, save_arrays
from relm_irl_jax.types import Parameters


def save_parameters(path: Path, parameters: Parameters) -> None:
    """Write a network's parameters as safetensors.

    Args:
        path: the file.
        parameters: nested dictionaries of arrays.

    Raises:
        DivergenceError: a number is not finite.
    """
    arrays = {key: np.asarray(value) for key, value in flatten_dict(parameters, sep="/").items()}
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise DivergenceError(f"{path}: the trained weights `{name}` are not finite; give a smaller learning rate.")
    save_arrays(path, arrays)


def load_parameters(path: Path) -> Parameters:
    """Read a network's parameters.

    Args:
        path: the file.

    Returns:
        Nested dictionaries of arrays.

    Raises:
        InputError: the file is missing or damaged, or a weight is not finite.
    """
    arrays = load_arrays(path)
    for name, array in arrays.items():
        if not np.issubdtype(array.dtype, np.number) or not np.isfinite(array).all():
            raise InputError(f"{path}: tensor `{name}` is not finite; remove the file, and train the agent again.")
    try:
        return unflatten_dict(arrays, sep="/")
    except (TypeError, ValueError, AttributeError) as error:  # names of which one is a part of another
        raise InputError(f"{path}: {error}; remove the file, and train the agent again.") from error
