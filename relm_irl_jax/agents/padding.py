"""Arrays of different sizes in one array."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array


def pad_and_stack(arrays: Sequence[Array | np.ndarray]) -> Array:
    """Stack arrays on a new first axis, on the host; padding compiles nothing, whatever the sizes.

    Args:
        arrays: arrays of one type and rank; smaller ones are padded with zeros at their ends.

    Returns:
        The stacked arrays.
    """
    shape = [max(sizes) for sizes in zip(*(array.shape for array in arrays), strict=True)]
    stacked = np.zeros((len(arrays), *shape), arrays[0].dtype)
    for row, array in zip(stacked, arrays, strict=True):
        row[tuple(map(slice, array.shape))] = array
    return jnp.asarray(stacked)
