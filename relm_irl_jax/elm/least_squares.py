"""Output weights of an ELM: ridge regression with an unpenalised intercept (Equations 17 and 24)."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jaxtyping import Array, Bool, Float, Float64

from relm_irl_jax.elm.matrices import centre_columns, float64
from relm_irl_jax.elm.orthogonalisation import rank_tolerance


def solve_output_weights(
    H: Float64[np.ndarray, "samples neurons"], T: Float64[np.ndarray, "samples outputs"], ridge: float = 0.0
) -> tuple[Float64[np.ndarray, "neurons outputs"], Float64[np.ndarray, "outputs"]]:
    """Minimise ‖Hβ + b - T‖² + λ‖β‖²; β has the least norm where it is not unique, as H⁺T does.

    Args:
        H: hidden outputs.
        T: targets.
        ridge: penalty λ on the squared weights.

    Returns:
        β and b.
    """
    H_mean, T_mean = H.mean(axis=0), T.mean(axis=0)
    beta, well_conditioned = None, False
    with float64():
        # JAX and NumPy sum in different orders; with JAX's mean, β is to the bit what earlier versions found.
        Hc = centre_columns(H, np.asarray(jnp.mean(H, axis=0)))
        if H.shape[1] and (ridge > 0 or H.shape[1] < len(H)):
            beta, well_conditioned = _solve_by_qr(Hc, T - T_mean, ridge, penalised=ridge > 0)
    if not well_conditioned:
        # Centring took one direction away; rounding leaves a trace of it, which the default cut-off would keep.
        cut = rank_tolerance(*H.shape)
        beta = scipy.linalg.lstsq(Hc, T - T_mean, cond=cut, check_finite=False)[0]
    beta = np.asarray(beta)
    return beta, T_mean - H_mean @ beta


@partial(jax.jit, static_argnames="penalised")
def _solve_by_qr(
    H: Float[Array, "samples neurons"],
    T: Float[Array, "samples outputs"],
    ridge: Float[Array, ""] | float,
    *,
    penalised: bool,
) -> tuple[Float[Array, "neurons outputs"], Bool[Array, ""]]:
    """β of centred data, and whether the triangle of the QR factorisation is well conditioned."""
    stacked = H
    if penalised:  # rows of zeros would make Householder's QR work on denormal numbers, thirty times as slowly
        stacked = jnp.concatenate([H, jnp.sqrt(ridge) * jnp.eye(H.shape[1], dtype=H.dtype)])
    Q, R = jnp.linalg.qr(stacked)
    diagonal = jnp.abs(jnp.diagonal(R))
    well_conditioned = diagonal.min() > rank_tolerance(*H.shape) * diagonal.max()
    return jax.scipy.linalg.solve_triangular(R, Q[: len(H)].T @ T), well_conditioned
