"""Weights of the small network as a file: safetensors in half precision, with where they come from."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from relm_irl_jax.errors import InputError
from relm_irl_jax.features.convnet import LAYERS, PATCH_SIZES, WIDTHS
from relm_irl_jax.files import load_arrays_and_metadata, load_metadata, save_arrays

NETWORK = "convnet-1"
"""Name of the network in a file's metadata; to be changed with the network."""

Layers = Mapping[str, Mapping[str, np.ndarray]]
"""A kernel and a bias for each layer of `ConvNet`."""


def shipped_path(name: str) -> Path:
    """Path of weights that come with the package.

    Args:
        name: one of `relm_irl_jax.features.settings.SHIPPED`.
    """
    return Path(__file__).with_name(f"{name}.safetensors")


def save_convnet(path: Path, layers: Layers, provenance: Mapping[str, str]) -> None:
    """Write weights in half precision.

    Args:
        path: the file.
        layers: parameters of `ConvNet`.
        provenance: how they were trained: command, scenes, seed, seconds.
    """
    tensors = {
        f"{layer}.{part}": np.asarray(layers[layer][part], np.float16)
        for layer in LAYERS
        for part in ("kernel", "bias")
    }
    save_arrays(path, tensors, {"network": NETWORK, "sha256": _checksum(tensors), **provenance})


def is_convnet(path: Path) -> bool:
    """Whether a file says that it holds weights of the small network.

    Args:
        path: a file; any other file, or none, gives False.
    """
    return "network" in load_metadata(path)


def load_convnet(path: Path) -> tuple[dict[str, dict[str, np.ndarray]], dict[str, str]]:
    """Read weights.

    Args:
        path: a file that `save_convnet` wrote.

    Returns:
        Parameters of `ConvNet` in single precision, and their provenance.

    Raises:
        InputError: the file is missing, damaged, or holds another network's weights.
    """
    tensors, metadata = load_arrays_and_metadata(path)
    remedy = "train it again with `relm-irl encoder train`, or install the package again"
    if metadata.get("network") != NETWORK:
        found = metadata.get("network", "no network that this program knows")
        raise InputError(f"{path}: holds weights of {found}, not of {NETWORK}; {remedy}.")
    expected = expected_shapes()
    for name, shape in expected.items():
        if name not in tensors:
            raise InputError(f"{path}: tensor {name} is missing; {remedy}.")
        if tensors[name].shape != shape:
            raise InputError(f"{path}: tensor {name} has shape {tensors[name].shape}, expected {shape}; {remedy}.")
        if not np.isfinite(tensors[name]).all():
            raise InputError(f"{path}: tensor {name} has values that are not finite; {remedy}.")
    if unknown := sorted(set(tensors) - set(expected)):
        raise InputError(f"{path}: tensor {unknown[0]} is not one of {NETWORK}; {remedy}.")
    if _checksum(tensors) != metadata.get("sha256"):
        raise InputError(f"{path}: the checksum of the weights is wrong, so the file is damaged; {remedy}.")
    layers = {
        layer: {part: tensors[f"{layer}.{part}"].astype(np.float32) for part in ("kernel", "bias")} for layer in LAYERS
    }
    return layers, metadata


def trained_scenes(provenance: Mapping[str, str]) -> frozenset[str]:
    """Names of the scenes on which weights were trained.

    Args:
        provenance: what `load_convnet` read.

    Returns:
        The names; empty if the file does not say.
    """
    return frozenset(json.loads(provenance.get("scenes", "[]")))


def expected_shapes() -> dict[str, tuple[int, ...]]:
    """Names and shapes of all tensors of a file."""
    shapes: dict[str, tuple[int, ...]] = {}
    for layer, inputs, width in zip(LAYERS, PATCH_SIZES, WIDTHS, strict=True):
        shapes |= {f"{layer}.kernel": (inputs, width), f"{layer}.bias": (width,)}
    return shapes


def _checksum(tensors: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of all tensors."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        digest.update(f"{name}{tensors[name].shape}".encode())
        digest.update(np.ascontiguousarray(tensors[name], tensors[name].dtype.newbyteorder("<")).data)
    return digest.hexdigest()
