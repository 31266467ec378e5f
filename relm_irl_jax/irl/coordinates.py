"""Coordinates of the rewards that a scene's features can express, from one factorisation per scene.

Every reward w·φ is a point of the range of Φ, so the program is stated over the reward, and w is recovered
from it as the weights of least norm. In the cost form only differences w·(φ(s) − φ(g)) matter. They do not
change when the features are centred, and the weights of least norm that give them are the centred features'
pseudo-inverse times r, for every target g: the one factorisation serves all targets of the scene.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Real

from relm_irl_jax.errors import InputError
from relm_irl_jax.irl.problem import Form

RANK_TOLERANCE = 1e-9
"""Singular values below this share of the largest count as zero."""


@dataclass(frozen=True)
class Coordinates:
    """The range of a scene's features, centred in the cost form: features = left · diag(singular) · right.

    Attributes:
        left: orthonormal basis of the rewards that can be expressed.
        singular: singular values, descending, none negligible.
        right: orthonormal rows that span the features' row space; None where only rewards are needed.
        full: whether every reward, relative to the target's in the cost form, can be expressed.
    """

    left: Float64[np.ndarray, "states rank"]
    singular: Float64[np.ndarray, "rank"]
    right: Float64[np.ndarray, "rank d"] | None
    full: bool

    @cached_property
    def penalty(self) -> Float64[np.ndarray, "states states"]:
        """The matrix G of ‖w‖² = rᵀGr, for the weights of least norm."""
        scaled = self.left / self.singular
        return scaled @ scaled.T

    def lift(self, rewards: Float64[np.ndarray, "problems states"]) -> Float64[np.ndarray, "problems d"]:
        """The weights of least norm for each reward.

        Args:
            rewards: rewards of all states, one row per problem.

        Returns:
            Weights, one row per problem.
        """
        assert self.right is not None
        return (rewards @ self.left / self.singular) @ self.right

    def rewards(self, weights: Float64[np.ndarray, "problems d"]) -> Float64[np.ndarray, "problems states"]:
        """The reward of all states under each w, in the cost form up to a constant.

        Args:
            weights: weights, one row per problem.

        Returns:
            Rewards, one row per problem.
        """
        assert self.right is not None
        return (weights @ self.right.T * self.singular) @ self.left.T


def factorise(features: Real[np.ndarray, "states d"], form: Form) -> Coordinates:
    """Factorise a scene's features.

    Args:
        features: φ(s) for all states.
        form: the form of the reward, which decides whether the features are centred.

    Returns:
        The coordinates.

    Raises:
        InputError: the features are not all finite.
    """
    exact = np.asarray(features, np.float64)
    if not np.isfinite(exact).all():
        raise InputError("the scene's features are not all finite; encode the scene again.")
    centred = exact - exact.mean(axis=0) if form == "cost" else exact
    left, singular, right = np.linalg.svd(centred, full_matrices=False)
    rank = int(np.sum(singular > RANK_TOLERANCE * singular[0])) if singular[0] > 0.0 else 0
    full = rank == len(exact) - (form == "cost")
    return Coordinates(left[:, :rank], singular[:rank], right[:rank], full)
