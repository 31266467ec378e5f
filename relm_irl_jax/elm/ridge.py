"""PRESS of several penalties for all columns at once, from one singular value decomposition.

With H = U S Vᵀ, centred, the hat matrix of penalty λ is U diag(s²/(s² + λ)) Uᵀ + 1/N, and the residuals of a group B
that is left out are (I - hat_BB)⁻¹ r_B. Where no prefix is to be chosen, this takes seconds instead of a factorisation
for every penalty.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Float64, Int

from relm_irl_jax.elm.groups import members_of
from relm_irl_jax.elm.linear import centred, finite_pair, float64, rank_tolerance


@jax.jit
def _errors(
    H: Float[Array, "samples neurons"],
    T: Float[Array, "samples outputs"],
    members: Int[Array, "groups most"],
    penalties: Float[Array, "penalties"],
) -> tuple[Float[Array, "penalties"], Int[Array, ""]]:
    """Squared errors summed over samples and outputs, and the rank; both matrices are centred."""
    U, S, _ = jnp.linalg.svd(H, full_matrices=False)
    image = U.T @ T
    U_own, T_own = (jnp.pad(z, ((0, 1), (0, 0)))[members] for z in (U, T))
    present = members >= 0
    among = present[:, :, None] & present[:, None]
    sound = rank_tolerance(*H.shape) * S.max() < S

    def one(penalty):
        share = jnp.where(sound, S**2 / jnp.where(sound, S**2 + penalty, 1), 0)
        own = jnp.einsum("gik,k,gjk->gij", U_own, share, U_own) + among / len(H)
        residual = T_own - U_own @ (share[:, None] * image)
        return (jnp.linalg.solve(jnp.eye(own.shape[1]) - own, residual) ** 2).sum()

    return lax.map(one, penalties), sound.sum()


def penalty_errors(H: Any, T: Any, penalties: Sequence[float], groups: Any = None) -> Float64[np.ndarray, "penalties"]:
    """Mean squared leave-one-out error, over samples and outputs, of the model with all columns and an intercept.

    Args:
        H: regressors, one row per sample.
        T: targets, one row per sample.
        penalties: λ on the squared coefficients, never on the intercept.
        groups: one label per sample; samples of one label are left out together. None leaves out one at a time.

    Returns:
        One error a penalty; infinite where what is left determines nothing.

    Raises:
        InputError: unusable H, T or groups.
    """
    H, T = finite_pair(H, T)
    members = members_of(np.arange(len(H)) if groups is None else groups, len(H))
    with float64():
        sums, rank = _errors(centred(H), centred(T), members, np.asarray(penalties, float))
    # Without penalty, as many columns as samples that are left fit them exactly.
    left = len(H) - 1 - (members >= 0).sum(axis=1).max()
    exact = (np.asarray(penalties) == 0) & (int(rank) > left)
    return np.where(exact, np.inf, np.asarray(sums) / T.size)
