"""Arrays of different sizes in one array, and scenes of similar size, which need little padding."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int


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


def divide_by_size(
    sizes: Int[np.ndarray, "scenes"], scene_head: Int[np.ndarray, "scenes"], at_once: int
) -> list[Int[np.ndarray, "_"]]:
    """Divide scenes into classes of similar size, each of one head and of about equally many scenes.

    Args:
        sizes: number of states of each scene.
        scene_head: head of each scene.
        at_once: number of classes; at least one for each head.

    Returns:
        Numbers of the scenes of each class.
    """
    if len(sizes) <= at_once:
        return [np.asarray([number]) for number in range(len(sizes))]
    classes = []
    for head in np.unique(scene_head):
        scenes = np.flatnonzero(scene_head == head)
        by_size = scenes[np.argsort(sizes[scenes], kind="stable")]
        classes += np.array_split(by_size, max(1, round(at_once * len(scenes) / len(sizes))))
    return [np.sort(scenes) for scenes in classes]
