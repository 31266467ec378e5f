"""Weights of the encoder: random ones, calibration of their batch norms, and conversion to Flax parameters.

All weights start as a *state dict*, which maps torchvision's names (`layer1.0.conv1.weight`,
`layer1.0.bn1.running_mean`, ...) to arrays in torch's layout. `fold_batch_norms` converts it to the parameters of
`ResNet50`.
"""

import hashlib
from collections.abc import Mapping

import jax
import numpy as np
from flax.traverse_util import flatten_dict, unflatten_dict
from jaxtyping import Array, Float

from relm_irl_jax.features.resnet import EPSILON, Layer, ResNet50, layers

StateDict = Mapping[str, np.ndarray]
"""Arrays in torch's layout by torchvision's tensor names."""

Params = dict[str, dict]
"""Tree of parameters of `ResNet50`."""

BATCH_NORM = ("weight", "bias", "running_mean", "running_var")
"""The four vectors of a batch norm: γ, β, μ, σ²."""

RESIDUAL_SCALE = 0.25
"""γ of the last batch norm of each block of random weights: the standard deviation of what a block adds to its input.
With 1/√16, the 16 blocks together add as much variance as the input has; with 1, they would drown it."""


def random_state_dict(seed: int) -> dict[str, np.ndarray]:
    """Draw untrained weights: kernels from N(0, 2/(out·height·width)) as in torchvision, identity batch norms.

    Args:
        seed: seed of NumPy's PCG64 generator, which gives the same numbers on every platform.

    Returns:
        A state dict; `calibrate_batch_norms` replaces its statistics.
    """
    rng = np.random.default_rng(seed)
    state = {}
    for layer in layers():
        out, _, height, width = layer.shape
        scale = np.float32(np.sqrt(2 / (out * height * width)))
        state[f"{layer.convolution}.weight"] = scale * rng.standard_normal(layer.shape, dtype=np.float32)
        gamma = RESIDUAL_SCALE if layer.path[-1] == "conv3" else 1.0
        for name, value in zip(BATCH_NORM, (gamma, 0.0, 0.0, 1.0), strict=True):
            state[f"{layer.batch_norm}.{name}"] = np.full(out, value, np.float32)
    return state


def calibrate_batch_norms(state: StateDict, images: Float[Array, "view height width 3"]) -> dict[str, np.ndarray]:
    """Set the statistics of all batch norms to those of the images, in one forward pass.

    Each layer normalises its output by the batch before the next layer, so all statistics are those of the calibrated
    network.

    Args:
        state: a state dict.
        images: normalised images.

    Returns:
        The state dict with `running_mean` and `running_var` of the images.
    """
    _, measured = apply_calibrating({"params": calibration_params(state)}, images, mutable="batch_stats")
    statistics = flatten_dict(measured["batch_stats"])
    updated = dict(state)
    for layer in layers():
        for name in ("mean", "var"):
            statistic = statistics[(*layer.path, "normalisation", name)]
            updated[f"{layer.batch_norm}.running_{name}"] = np.asarray(statistic)
    return updated


def fold_batch_norms(state: StateDict) -> Params:
    """Convert to parameters of `ResNet50`, with each batch norm folded into the convolution before it.

    Args:
        state: a state dict.

    Returns:
        The tree of parameters.
    """
    params = {}
    for layer in layers():
        kernel, bias = fold_layer(state, layer)
        params[(*layer.path, "convolution", "kernel")] = _to_flax_layout(kernel)
        params[(*layer.path, "convolution", "bias")] = bias
    return unflatten_dict(params)


def fold_layer(state: StateDict, layer: Layer) -> tuple[np.ndarray, np.ndarray]:
    """Fold the batch norm of one layer into its convolution.

    Args:
        state: a state dict.
        layer: the layer.

    Returns:
        Kernel in torch's layout, and bias.
    """
    gamma, beta, mean, variance = (state[f"{layer.batch_norm}.{name}"] for name in BATCH_NORM)
    scale = gamma / np.sqrt(variance.astype(np.float64) + EPSILON)
    kernel = state[f"{layer.convolution}.weight"] * scale[:, None, None, None]
    return kernel.astype(np.float32), (beta - mean * scale).astype(np.float32)


def calibration_params(state: StateDict) -> Params:
    """Parameters of `ResNet50(calibrate=True)`: kernels, γ and β.

    Args:
        state: a state dict.
    """
    params = {}
    for layer in layers():
        params[(*layer.path, "convolution", "kernel")] = _to_flax_layout(state[f"{layer.convolution}.weight"])
        params[(*layer.path, "normalisation", "scale")] = state[f"{layer.batch_norm}.weight"]
        params[(*layer.path, "normalisation", "bias")] = state[f"{layer.batch_norm}.bias"]
    return unflatten_dict(params)


apply_calibrating = jax.jit(ResNet50(calibrate=True).apply, static_argnames="mutable")
"""The network with batch norms; compiled once for each shape of images."""


def fingerprint(state: StateDict) -> str:
    """Checksum of all tensors that the encoder uses: 16 hexadecimal digits of SHA-256."""
    digest = hashlib.sha256()
    for name, shape in expected_shapes().items():
        digest.update(f"{name}{shape}".encode())
        digest.update(np.ascontiguousarray(state[name], np.dtype("<f4")).data)
    return digest.hexdigest()[:16]


def expected_shapes() -> dict[str, tuple[int, ...]]:
    """Names and shapes of all tensors of a state dict that the encoder uses."""
    shapes: dict[str, tuple[int, ...]] = {}
    for layer in layers():
        shapes[f"{layer.convolution}.weight"] = layer.shape
        shapes |= {f"{layer.batch_norm}.{name}": layer.shape[:1] for name in BATCH_NORM}
    return shapes


def _to_flax_layout(kernel: np.ndarray) -> np.ndarray:
    """Torch's kernel as (height, width, in, out), or (in, out) of a 1x1 convolution."""
    kernel = kernel.transpose(2, 3, 1, 0)
    return kernel[0, 0] if kernel.shape[:2] == (1, 1) else kernel
