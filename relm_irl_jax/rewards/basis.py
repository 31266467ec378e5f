"""Reward features φ(s): principal components of the training scenes' view features.

    φ(s) = C (x(s) − x̄)

with x(s) the encoder's features of the view of s, x̄ their mean over the training scenes and C the loadings of the
first principal components. A common factor scales φ so that ‖φ(s)‖² has mean d over the training scenes; the effect of
the inverse problem's regulariser then does not depend on the units of x.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from sklearn.decomposition import PCA
from threadpoolctl import threadpool_limits

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.scene import Scene


@dataclass(frozen=True)
class RewardBasis:
    """The linear map from view features to reward features.

    Attributes:
        mean: x̄.
        components: C, transposed, including the common factor.
    """

    mean: Float64[np.ndarray, "feature"]
    components: Float64[np.ndarray, "feature d"]

    def phi(self, scene: Scene) -> Float64[np.ndarray, "states d"]:
        """Reward features of every state of a scene.

        Args:
            scene: the scene, encoded.

        Returns:
            φ.
        """
        return (scene.encoded - self.mean) @ self.components


def fit_basis(scenes: Sequence[Scene], dimension: int) -> RewardBasis:
    """Fit φ on the views of the training scenes.

    Args:
        scenes: encoded training scenes.
        dimension: number of principal components; 0 for as many as the rank of the features.

    Returns:
        The basis.

    Raises:
        InputError: `dimension` exceeds the rank of the features.
    """
    features = np.concatenate([np.asarray(scene.encoded, np.float64) for scene in scenes])
    # With one thread, since sums over views are added in another order by two: rewards would depend on the cores.
    with threadpool_limits(1):
        pca = PCA(svd_solver="covariance_eigh").fit(features)  # pyrefly: ignore  its types lack this solver
    variance = pca.explained_variance_
    rank = int((variance > variance[0] * 1e-12).sum())
    if dimension > rank:
        raise InputError(
            f"irl.dimension: {dimension} exceeds {rank}, the rank of the training views' features; lower it."
        )
    n_components = dimension or rank
    # The mean of ‖φ‖² divides by the number of views, PCA's variance by one less.
    scale = np.sqrt(n_components / (variance[:n_components].sum() * (len(features) - 1) / len(features)))
    return RewardBasis(pca.mean_, pca.components_[:n_components].T * scale)
