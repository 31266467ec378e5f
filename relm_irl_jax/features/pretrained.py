"""Trained weights of the encoder: published weights, downloaded on first use, or a safetensors file."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import platformdirs
from huggingface_hub import get_hf_file_metadata, hf_hub_download, hf_hub_url
from safetensors import SafetensorError
from safetensors.numpy import load_file

from relm_irl_jax.errors import InputError, first_line
from relm_irl_jax.features.resnet import layers
from relm_irl_jax.features.weights import expected_shapes, fold_layer

IGNORED = ("fc.weight", "fc.bias")
"""Tensors of a state dict that the encoder does not use, besides every `num_batches_tracked`."""


@dataclass(frozen=True)
class PublishedWeights:
    """A file of weights on the Hugging Face hub.

    Attributes:
        repository: name of the repository.
        revision: commit or branch.
        sha256: checksum of the file; None to use the checksum that the hub reports at download.
    """

    repository: str
    revision: str
    sha256: str | None


PUBLISHED = {
    "imagenet": PublishedWeights(
        "timm/resnet50.tv_in1k",
        "78f3ecfdb38e06d9b8397f662e7ab8fee96026fa",
        "5d061a3c593d795bfe682d9b152bafbcf550579873492def3515b46db1189888",
    ),
    "imagenet-v2": PublishedWeights("timm/resnet50.tv2_in1k", "main", None),
}
"""torchvision's `IMAGENET1K_V1` and `V2` as safetensors; for this network timm's names are torchvision's."""

FILE_NAME = "model.safetensors"
"""Name of the file of weights in a repository on the hub."""


def fetch_published(name: str) -> Path:
    """Download published weights on first use and compare them with the published checksum.

    Args:
        name: a key of `PUBLISHED`.

    Returns:
        The file's path.

    Raises:
        InputError: the file cannot be downloaded, or has another checksum.
    """
    published, path = PUBLISHED[name], published_path(name)
    checksum = published.sha256
    if not path.exists():
        repository, revision = published.repository, published.revision
        try:
            checksum = checksum or get_hf_file_metadata(hf_hub_url(repository, FILE_NAME, revision=revision)).etag
            hf_hub_download(repository, FILE_NAME, revision=revision, local_dir=path.parent)
        except Exception as error:  # no network, offline mode, no such file: of which kind depends on the hub's version
            raise InputError(
                f"{name} weights could not be downloaded ({type(error).__name__}); download {FILE_NAME} of "
                f"https://huggingface.co/{repository} on another computer and copy it to {path}, or use random weights."
            ) from error
    if checksum is not None:
        with path.open("rb") as file:
            actual = hashlib.file_digest(file, "sha256").hexdigest()
        if actual != checksum:
            raise InputError(
                f"{path}: SHA-256 is {actual[:16]}…, not the published {checksum[:16]}…; delete the file to "
                "download it again, or set encoder.weights to its path to use it as it is."
            )
    return path


def published_path(name: str) -> Path:
    """Path of the file of published weights in the cache; a user without network access copies the file there.

    Args:
        name: a key of `PUBLISHED`.

    Returns:
        The path.
    """
    folder = PUBLISHED[name].repository.split("/")[-1]
    return platformdirs.user_cache_path("relm-irl-jax", appauthor=False) / "weights" / folder / FILE_NAME


def load_state_dict(path: Path) -> dict[str, np.ndarray]:
    """Read a safetensors file of torchvision's `resnet50`.

    Args:
        path: the file.

    Returns:
        The state dict, float32.

    Raises:
        InputError: the file does not exist, is not a safetensors file, or has missing, unknown or wrong tensors.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; encoder.weights is random, {', '.join(PUBLISHED)} or a file.")
    try:
        tensors = load_file(path)
    except (SafetensorError, OSError, TypeError, ValueError, KeyError, AttributeError) as error:  # unknown number types
        reason = first_line(error)
        raise InputError(f"{path}: not a readable safetensors file ({reason}).") from error
    expected = expected_shapes()
    for name, shape in expected.items():
        if name not in tensors:
            raise InputError(f"{path}: tensor {name} is missing; torchvision's resnet50 names are expected.")
        if tensors[name].shape != shape:
            raise InputError(f"{path}: tensor {name} has shape {tensors[name].shape}, expected {shape}.")
        if not np.issubdtype(tensors[name].dtype, np.floating):
            raise InputError(f"{path}: tensor {name} has type {tensors[name].dtype}, expected floating point.")
        with np.errstate(over="ignore"):
            tensors[name] = tensors[name].astype(np.float32)
        if not np.isfinite(tensors[name]).all():
            raise InputError(f"{path}: tensor {name} has values that are not finite in single precision.")
        if name.endswith("running_var") and (tensors[name] < 0).any():
            raise InputError(f"{path}: tensor {name} has negative variances.")
    for name in tensors:
        if name not in expected and name not in IGNORED and not name.endswith("num_batches_tracked"):
            raise InputError(f"{path}: tensor {name} is not one of torchvision's resnet50.")
    state = {name: tensors[name] for name in expected}
    for layer in layers():
        with np.errstate(all="ignore"):
            folded = fold_layer(state, layer)
        if not all(np.isfinite(part).all() for part in folded):
            raise InputError(f"{path}: tensors of {layer.batch_norm} overflow in single precision.")
    return state
