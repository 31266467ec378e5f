"""Singular value decomposition of a scene's features: the rewards that they can express, and the weights of a reward.

A reward w·φ lies in the range of Φ, so the maximum-margin program is stated over the reward instead of w, and w is
computed from the reward afterwards, as the weights of minimum norm Φ⁺r. In the cost form only the differences
w·(φ(s) − φ(g)) matter. These do not change if the features are centred, and the weights of minimum norm are then the
pseudo-inverse of the centred features times r, for every target g: one factorisation serves all targets of a scene.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Real

from relm_irl_jax.errors import InputError
from relm_irl_jax.irl.settings import Form

RANK_TOLERANCE = 1e-9
"""Singular values below this share of the largest one count as zero."""


@dataclass(frozen=True)
class FactorisedFeatures:
    """Φ = left_vectors · diag(singular_values) · right_vectors, where Φ is centred in the cost form.

    Attributes:
        left_vectors: orthonormal basis of the rewards that can be expressed.
        singular_values: descending, without those that count as zero.
        right_vectors: orthonormal rows that span the row space of Φ; None if weights are never computed.
        full_rank: whether every reward can be expressed; in the cost form, every reward relative to the target's.
    """

    left_vectors: Float64[np.ndarray, "states rank"]
    singular_values: Float64[np.ndarray, "rank"]
    right_vectors: Float64[np.ndarray, "rank d"] | None
    full_rank: bool

    @cached_property
    def norm_matrix(self) -> Float64[np.ndarray, "states states"]:
        """The matrix G with ‖w‖² = rᵀGr for the weights w of minimum norm of a reward r."""
        scaled = self.left_vectors / self.singular_values
        return scaled @ scaled.T

    def weights(self, rewards: Float64[np.ndarray, "problems states"]) -> Float64[np.ndarray, "problems d"]:
        """The weights of minimum norm of each reward, Φ⁺r.

        Args:
            rewards: rewards of all states, one row per problem.

        Returns:
            Weights, one row per problem.
        """
        assert self.right_vectors is not None
        return (rewards @ self.left_vectors / self.singular_values) @ self.right_vectors

    def rewards(self, weights: Float64[np.ndarray, "problems d"]) -> Float64[np.ndarray, "problems states"]:
        """The reward of all states under each w, Φw; in the cost form up to a constant.

        Args:
            weights: weights, one row per problem.

        Returns:
            Rewards, one row per problem.
        """
        assert self.right_vectors is not None
        return (weights @ self.right_vectors.T * self.singular_values) @ self.left_vectors.T


def factorise(features: Real[np.ndarray, "states d"], form: Form) -> FactorisedFeatures:
    """Factorise a scene's features.

    Args:
        features: φ(s) of all states.
        form: the form of the reward; the cost form centres the features.

    Returns:
        The factorisation.

    Raises:
        InputError: some feature is not finite.
    """
    exact = np.asarray(features, np.float64)
    if not np.isfinite(exact).all():
        raise InputError("the scene's features are not all finite; encode the scene again.")
    centred = exact - exact.mean(axis=0) if form == "cost" else exact
    left, singular, right = np.linalg.svd(centred, full_matrices=False)
    rank = int(np.sum(singular > RANK_TOLERANCE * singular[0])) if singular[0] > 0.0 else 0
    full_rank = rank == len(exact) - (form == "cost")
    return FactorisedFeatures(left[:, :rank], singular[:rank], right[:rank], full_rank)
