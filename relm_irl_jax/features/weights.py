"""Weights of the encoder: seeded and calibrated, torchvision's ImageNet weights, or a file.

Whatever their origin, weights are first a *state dict*: torchvision's names (`layer1.0.conv1.weight`,
`layer1.0.bn1.running_mean`, ...) to arrays in torch's layout. `folded` turns it into the parameters of
`ResNet50`. Files are safetensors, never pickles.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np
import platformdirs
from flax.traverse_util import flatten_dict, unflatten_dict
from huggingface_hub import get_hf_file_metadata, hf_hub_download, hf_hub_url
from jaxtyping import Array, Float
from safetensors import SafetensorError
from safetensors.numpy import load_file

from relm_irl_jax.errors import InputError
from relm_irl_jax.features.resnet import EPSILON, Layer, ResNet50, layers

StateDict = Mapping[str, np.ndarray]
"""torchvision's tensor names to arrays in torch's layout."""

Params = dict[str, dict]
"""Tree of parameters of `ResNet50`."""

NORMALISATION = ("weight", "bias", "running_mean", "running_var")
"""The four vectors of a batch norm: γ, β, μ, σ²."""

IGNORED = ("fc.weight", "fc.bias")
"""Tensors of a state dict that the encoder has no use for, besides every `num_batches_tracked`."""


@dataclass(frozen=True)
class Published:
    """Weights that others trained and published.

    Attributes:
        repository: repository on the Hugging Face hub.
        revision: its commit.
        sha256: checksum of the file; None where it is the one that the hub states at download.
    """

    repository: str
    revision: str
    sha256: str | None


PUBLISHED = {
    "imagenet": Published(
        "timm/resnet50.tv_in1k",
        "78f3ecfdb38e06d9b8397f662e7ab8fee96026fa",
        "5d061a3c593d795bfe682d9b152bafbcf550579873492def3515b46db1189888",
    ),
    "imagenet-v2": Published("timm/resnet50.tv2_in1k", "main", None),
}
"""torchvision's `IMAGENET1K_V1` and `V2` as safetensors; for this network timm's names are torchvision's."""

FILE_NAME = "model.safetensors"
"""Name of the file of weights in a repository on the hub."""


def random_state_dict(seed: int, residual_scale: float = 1.0) -> dict[str, np.ndarray]:
    """Untrained weights: kernels N(0, 2/(out·height·width)) as torchvision starts them, identity batch norms.

    Args:
        seed: of numpy's PCG64 generator, whose stream is the same on every machine.
        residual_scale: γ of the last batch norm of each block: what a block adds to its input, relative to unit
            variance. At 1 sixteen untrained blocks scramble what the first layers see.

    Returns:
        A state dict; see `calibrated` for its statistics.
    """
    rng = np.random.default_rng(seed)
    state = {}
    for layer in layers():
        out, _, height, width = layer.shape
        scale = np.float32(np.sqrt(2 / (out * height * width)))
        state[f"{layer.convolution}.weight"] = scale * rng.standard_normal(layer.shape, dtype=np.float32)
        gamma = residual_scale if layer.path[-1] == "conv3" else 1.0
        for name, value in zip(NORMALISATION, (gamma, 0.0, 0.0, 1.0), strict=True):
            state[f"{layer.normalisation}.{name}"] = np.full(out, value, np.float32)
    return state


def calibrated(state: StateDict, images: Float[Array, "view height width 3"]) -> dict[str, np.ndarray]:
    """Set every batch norm's statistics to those of the images, in one pass layer by layer.

    Each layer normalises by the batch before the next one sees it, so that all statistics are those of the
    calibrated network.

    Args:
        state: a state dict.
        images: normalised images.

    Returns:
        The state dict with `running_mean` and `running_var` of the images.
    """
    _, measured = calibrating({"params": unfolded(state)}, images, mutable="batch_stats")
    statistics = flatten_dict(measured["batch_stats"])
    updated = dict(state)
    for layer in layers():
        for name in ("mean", "var"):
            measure = statistics[(*layer.path, "normalisation", name)]
            updated[f"{layer.normalisation}.running_{name}"] = np.asarray(measure)
    return updated


def folded(state: StateDict) -> Params:
    """Parameters of `ResNet50`, each batch norm multiplied into the convolution before it.

    Args:
        state: a state dict.

    Returns:
        The tree of parameters.
    """
    params = {}
    for layer in layers():
        kernel, bias = folded_layer(state, layer)
        params[(*layer.path, "convolution", "kernel")] = _in_our_layout(kernel)
        params[(*layer.path, "convolution", "bias")] = bias
    return unflatten_dict(params)


def folded_layer(state: StateDict, layer: Layer) -> tuple[np.ndarray, np.ndarray]:
    """Kernel, in torch's layout, and bias of one layer with its batch norm folded.

    Args:
        state: a state dict.
        layer: the layer.
    """
    gamma, beta, mean, variance = (state[f"{layer.normalisation}.{name}"] for name in NORMALISATION)
    scale = gamma / np.sqrt(variance.astype(np.float64) + EPSILON)
    kernel = state[f"{layer.convolution}.weight"] * scale[:, None, None, None]
    return kernel.astype(np.float32), (beta - mean * scale).astype(np.float32)


def fingerprint(state: StateDict) -> str:
    """Checksum of all tensors that the encoder uses: 16 hexadecimal digits of SHA-256."""
    digest = hashlib.sha256()
    for name, shape in expected_shapes().items():
        digest.update(f"{name}{shape}".encode())
        digest.update(np.ascontiguousarray(state[name], np.dtype("<f4")).data)
    return digest.hexdigest()[:16]


def published_path(name: str) -> Path:
    """Where the file of published weights is kept, and where a person without a network puts it.

    Args:
        name: a key of `PUBLISHED`.
    """
    folder = PUBLISHED[name].repository.split("/")[-1]
    return platformdirs.user_cache_path("relm-irl-jax", appauthor=False) / "weights" / folder / FILE_NAME


def fetch_published(name: str) -> Path:
    """Path of published weights, downloaded on first use and compared with the published checksum.

    Args:
        name: a key of `PUBLISHED`.

    Returns:
        The file's path.

    Raises:
        InputError: if the file cannot be had, or is not the file that was published.
    """
    published, path = PUBLISHED[name], published_path(name)
    checksum = published.sha256
    if not path.exists():
        repository, revision = published.repository, published.revision
        try:
            checksum = checksum or get_hf_file_metadata(hf_hub_url(repository, FILE_NAME, revision=revision)).etag
            hf_hub_download(repository, FILE_NAME, revision=revision, local_dir=path.parent)
        except (OSError, ValueError) as error:  # no network, offline mode, no such file on the hub
            raise InputError(
                f"{name} weights could not be downloaded ({type(error).__name__}): fetch {FILE_NAME} of "
                f"https://huggingface.co/{repository} elsewhere and put it at {path}, or use random weights."
            ) from error
    if checksum is not None:
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        if found != checksum:
            raise InputError(
                f"{path}: SHA-256 is {found[:16]}…, not the published {checksum[:16]}…; delete the file to "
                "download it again, or pass its path as the weights if you mean this file."
            )
    return path


def load_state_dict(path: Path) -> dict[str, np.ndarray]:
    """Read a safetensors file of torchvision's `resnet50`.

    Args:
        path: the file.

    Returns:
        The state dict, float32.

    Raises:
        InputError: if the file is not there, is no safetensors file, or has tensors missing, left over or
            misshapen.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file of weights; weights are random, {', '.join(PUBLISHED)} or a file.")
    try:
        found = load_file(path)
    except SafetensorError as error:
        raise InputError(f"{path}: not a readable safetensors file ({error}).") from error
    expected = expected_shapes()
    for name, shape in expected.items():
        if name not in found:
            raise InputError(f"{path}: tensor {name} is missing; torchvision's resnet50 names are expected.")
        if found[name].shape != shape:
            raise InputError(f"{path}: tensor {name} has shape {found[name].shape}, expected {shape}.")
        if not np.issubdtype(found[name].dtype, np.floating):
            raise InputError(f"{path}: tensor {name} has type {found[name].dtype}, expected floating point.")
        if not np.isfinite(found[name]).all():
            raise InputError(f"{path}: tensor {name} has values that are not finite.")
        if name.endswith("running_var") and (found[name] < 0).any():
            raise InputError(f"{path}: tensor {name} has negative variances.")
    for name in found:
        if name not in expected and name not in IGNORED and not name.endswith("num_batches_tracked"):
            raise InputError(f"{path}: tensor {name} is not one of torchvision's resnet50.")
    return {name: found[name].astype(np.float32) for name in expected}


def expected_shapes() -> dict[str, tuple[int, ...]]:
    """Names and shapes of all tensors of a state dict that the encoder uses."""
    shapes: dict[str, tuple[int, ...]] = {}
    for layer in layers():
        shapes[f"{layer.convolution}.weight"] = layer.shape
        shapes |= {f"{layer.normalisation}.{name}": layer.shape[:1] for name in NORMALISATION}
    return shapes


def unfolded(state: StateDict) -> Params:
    """Parameters of `ResNet50(calibrate=True)`: kernels, γ and β.

    Args:
        state: a state dict.
    """
    params = {}
    for layer in layers():
        params[(*layer.path, "convolution", "kernel")] = _in_our_layout(state[f"{layer.convolution}.weight"])
        params[(*layer.path, "normalisation", "scale")] = state[f"{layer.normalisation}.weight"]
        params[(*layer.path, "normalisation", "bias")] = state[f"{layer.normalisation}.bias"]
    return unflatten_dict(params)


calibrating = jax.jit(ResNet50(calibrate=True).apply, static_argnames="mutable")
"""The network normalising by its batch, compiled once for all weights of one shape of images."""


def _in_our_layout(kernel: np.ndarray) -> np.ndarray:
    """Torch's kernel as (height, width, in, out), or (in, out) where height and width are 1."""
    kernel = kernel.transpose(2, 3, 1, 0)
    return kernel[0, 0] if kernel.shape[:2] == (1, 1) else kernel
