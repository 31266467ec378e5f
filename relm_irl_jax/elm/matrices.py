"""Preparation of the matrices of MRSR and PRESS: checks, centring or standardisation, and padding to a few shapes.

These functions run on the host, in float64. `float64` is the context in which the package calls its compiled functions.
"""

from typing import Any

import jax
import numpy as np
from jaxtyping import Float64
from sklearn.utils import check_array

from relm_irl_jax.errors import InputError


def float64() -> Any:
    """Context in which JAX computes in float64; it does not change the global configuration."""
    return jax.enable_x64(True)


def check_matrix(value: Any, name: str) -> Float64[np.ndarray, "rows columns"]:
    """Check that a value is a finite matrix; a vector counts as one column.

    Args:
        value: array-like of real numbers.
        name: name of the value in the message.

    Returns:
        The matrix in float64.

    Raises:
        InputError: the value is empty, not a matrix of real numbers, or contains NaN or infinity.
    """
    try:
        matrix = check_array(value, dtype=np.float64, ensure_2d=False, input_name=name)
    except (TypeError, ValueError) as error:
        message = str(error).splitlines()[0]
        raise InputError(f"{name} must be a finite matrix with one row per sample. {message}") from error
    return matrix[:, None] if matrix.ndim == 1 else matrix


def check_regression(
    H: Any, T: Any
) -> tuple[Float64[np.ndarray, "samples neurons"], Float64[np.ndarray, "samples outputs"]]:
    """Check regressors and targets, which must have the same number of rows.

    Args:
        H: regressors, one row per sample.
        T: targets, one row per sample; a vector counts as one output.

    Returns:
        Both as matrices in float64.

    Raises:
        InputError: either is unusable, or their numbers of rows differ.
    """
    H, T = check_matrix(H, "H"), check_matrix(T, "T")
    if len(H) != len(T):
        raise InputError(f"H has {len(H)} rows but T has {len(T)}; both need one row per sample.")
    return H, T


def centre_columns(
    matrix: Float64[np.ndarray, "rows columns"], mean: Float64[np.ndarray, "columns"] | None = None
) -> Float64[np.ndarray, "rows columns"]:
    """Subtract each column's mean; columns that are constant up to rounding become exactly zero.

    Args:
        matrix: one row per sample.
        mean: the means of the columns; computed if None.

    Returns:
        Columns of mean zero.
    """
    centred = matrix - (matrix.mean(axis=0) if mean is None else mean)
    rounding = 4 * np.finfo(np.float64).eps * np.abs(matrix).max(axis=0)
    return np.where(np.abs(centred).max(axis=0) <= rounding, 0, centred)


def standardise_columns(matrix: Float64[np.ndarray, "rows columns"]) -> Float64[np.ndarray, "rows columns"]:
    """Centre each column and divide it by its Euclidean norm; constant columns become zero.

    Args:
        matrix: one row per sample.

    Returns:
        Columns of mean zero and norm one, or zero.
    """
    centred = centre_columns(matrix)
    largest = np.abs(centred).max(axis=0)
    centred = centred / np.where(largest > 0, largest, 1)  # avoids underflow of the squares in the norm
    norm = np.linalg.norm(centred, axis=0)
    return centred / np.where(norm > 0, norm, 1)


def padded_length(length: int) -> int:
    """Number of rows or columns to pad to, so that problems of similar shape share one compiled function.

    Args:
        length: number of rows or columns.

    Returns:
        64, 256, or the next multiple of 16.
    """
    for short in (64, 256):
        if length <= short:
            return short
    return -(-length // 16) * 16


def pad_columns(H: Float64[np.ndarray, "samples neurons"]) -> Float64[np.ndarray, "rows columns"]:
    """Append zero rows and columns to regressors; they change neither the order of the columns nor any error.

    Args:
        H: regressors.

    Returns:
        The padded matrix.
    """
    return np.pad(H, [(0, padded_length(length) - length) for length in H.shape])


def pad_outputs(T: Float64[np.ndarray, "samples outputs"]) -> Float64[np.ndarray, "rows more_outputs"]:
    """Append zero rows to targets, as `pad_columns` does to regressors, and zero outputs up to a multiple of 16.

    Args:
        T: targets.

    Returns:
        The padded matrix; a single output is not padded.
    """
    samples, outputs = T.shape
    more = 0 if outputs == 1 else -outputs % 16
    return np.pad(T, ((0, padded_length(samples) - samples), (0, more)))
