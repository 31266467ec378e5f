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
    """Minimise ‖Hβ + b - T‖² + λ‖β‖²; if β is not unique, it is the solution of minimum norm, like H⁺T.

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
        # JAX and NumPy sum in different orders; JAX's mean gives the same bits of β as earlier versions.
        Hc = centre_columns(H, np.asarray(jnp.mean(H, axis=0)))
        if H.shape[1] and (ridge > 0 or H.shape[1] < len(H)):
            beta, well_conditioned = _solve_by_qr(Hc, T - T_mean, ridge, penalised=ridge > 0)
    if not well_conditioned:
        # Centring removes one direction up to rounding errors, which the default cut-off would not neglect.
        cutoff = rank_tolerance(*H.shape)
        beta = scipy.linalg.lstsq(Hc, T - T_mean, cond=cutoff, check_finite=False)[0]
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
    if penalised:  # rows of zeros would lead to denormal numbers in Householder's QR, thirty times as slow
        stacked = jnp.concatenate([H, jnp.sqrt(ridge) * jnp.eye(H.shape[1], dtype=H.dtype)])
    Q, R = jnp.linalg.qr(stacked)
    diagonal = jnp.abs(jnp.diagonal(R))
    well_conditioned = diagonal.min() > rank_tolerance(*H.shape) * diagonal.max()
    return jax.scipy.linalg.solve_triangular(R, Q[: len(H)].T @ T), well_conditioned
