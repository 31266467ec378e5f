"""Features on disk. The file name is a checksum of the views and the encoder's fingerprint."""

import hashlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float32
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from relm_irl_jax.errors import InputError
from relm_irl_jax.features.encoder import Encoder, Views, encode
from relm_irl_jax.files import cache_folder, write_bytes
from relm_irl_jax.progress import console
from relm_irl_jax.scenes.scene import Scene


def encode_cached(
    views: Views, encoder: Encoder, folder: Path, description: str = "encoding views"
) -> Float32[np.ndarray, "view feature"]:
    """Read the features of views from the cache folder, or encode the views and save their features there.

    If a file cannot be read or does not match its checksum, the features are computed again, with a notice. Files are
    written atomically, so several processes can share a folder.

    Args:
        views: views of one size.
        encoder: the encoder.
        folder: the cache folder; created if missing.
        description: label of the progress bar.

    Returns:
        One vector for each view.
    """
    path = folder / f"{cache_key(views, encoder)}.safetensors"
    if path.exists():
        try:
            return _load(path, (len(views), encoder.n_features))
        except (SafetensorError, OSError, ValueError) as error:
            console.print(
                f"{path.name}: features are damaged ({error}); encoding again", style="yellow", highlight=False
            )
    features = encode(encoder, views, description)
    with suppress(OSError):  # without a cache folder, the features are computed again
        _save(features, path)
    return features


def encode_scene(scene: Scene, encoder: Encoder) -> Scene:
    """Add features to a scene, with the user's cache folder.

    Args:
        scene: the scene with its views.
        encoder: the encoder.

    Returns:
        The scene with features.

    Raises:
        InputError: a feature is not finite.
    """
    features = encode_cached(scene.views, encoder, cache_folder() / "features", f"encoding {scene.name}")
    if not np.isfinite(features).all():
        view = int(np.flatnonzero(~np.isfinite(features).all(1))[0])
        raise InputError(
            f"{scene.name}: the features of view {view} are not finite; give other encoder.weights than {encoder.name}."
        )
    return replace(scene, features=features, encoder=encoder.name)


def cache_key(views: Views, encoder: Encoder) -> str:
    """Name of the file of features: 32 hexadecimal digits.

    Args:
        views: views of one size.
        encoder: the encoder.
    """
    digest = hashlib.sha256(f"{encoder.fingerprint} {views.shape}".encode())
    digest.update(np.ascontiguousarray(views).data)
    return digest.hexdigest()[:32]


def _load(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """Read features; raises ValueError if their shape, type or checksum is wrong."""
    with safe_open(path, framework="numpy") as file:
        features, checksum = file.get_tensor("features"), (file.metadata() or {}).get("sha256")
    if features.shape != shape or features.dtype != np.float32:
        raise ValueError(f"shape {features.shape} and type {features.dtype}")
    if hashlib.sha256(features.data).hexdigest() != checksum:
        raise ValueError("checksum")
    return features


def _save(features: np.ndarray, path: Path) -> None:
    """Write features with their checksum."""
    write_bytes(path, save({"features": features}, {"sha256": hashlib.sha256(features.data).hexdigest()}))
