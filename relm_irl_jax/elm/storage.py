"""Fitted regressors on disk: one safetensors file, never a pickle.

Arrays are tensors; everything else is JSON under the key `model` of the file's metadata, beside the format's version.
"""

import json
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save
from sklearn.utils.validation import check_is_fitted

from relm_irl_jax.elm.hidden_layer import HiddenLayer
from relm_irl_jax.elm.regressor import Diagnostics, ELMRegressor
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_bytes

FORMAT = "relm-irl-jax/elm"
"""Name of the file format, in the metadata."""

VERSION = 2
"""Version of the file format; a reader refuses any other."""

DATACLASSES = {"hidden_": HiddenLayer, "diagnostics_": Diagnostics}
"""Fitted attributes that are dataclasses, saved field by field."""


def save_elm(model: ELMRegressor, path: str | Path) -> None:
    """Write a fitted regressor.

    Args:
        model: what to write. A generator as `random_state` is not kept: the drawn weights are.
        path: the file.
    """
    check_is_fitted(model)
    tensors: dict[str, np.ndarray] = {}
    values: dict[str, Any] = {}

    def put(name: str, value: Any) -> None:
        if isinstance(value, np.ndarray) and value.dtype != object:
            tensors[name] = np.ascontiguousarray(value)
        elif isinstance(value, np.ndarray):
            values[name] = value.tolist()
        elif is_dataclass(value):
            for field in fields(value):
                put(f"{name}.{field.name}", getattr(value, field.name))
        else:
            values[name] = value.item() if isinstance(value, np.generic) else value

    for name, value in vars(model).items():
        if name not in model.get_params():
            put(name, value)
    parameters = {
        name: None if isinstance(value, np.random.RandomState) else value for name, value in model.get_params().items()
    }
    text = json.dumps({"parameters": parameters, "values": values}, default=_plain)
    write_bytes(Path(path), save(tensors, {"format": FORMAT, "version": str(VERSION), "model": text}))


def load_elm(path: str | Path) -> ELMRegressor:
    """Read what `save_elm` wrote.

    Args:
        path: the file.

    Returns:
        The fitted regressor.

    Raises:
        InputError: no such file, or not of this format and version.
    """
    if not Path(path).is_file():
        raise InputError(f"{path} does not exist; give a file that `save_elm` wrote.")
    try:
        with safe_open(str(path), framework="numpy") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dictionary
    except SafetensorError as error:
        raise InputError(f"{path} is not a safetensors file: {error}.") from error
    if metadata.get("format") != FORMAT:
        raise InputError(f"{path} holds no regressor: its format is {metadata.get('format')!r}, not {FORMAT!r}.")
    if metadata.get("version") != str(VERSION):
        raise InputError(f"{path} has format version {metadata.get('version')}; this program reads {VERSION}.")
    text = json.loads(metadata["model"])
    model = ELMRegressor(**text["parameters"])
    found = {**text["values"], **tensors}
    errors = found["diagnostics_.ridge_errors"].items()  # JSON made strings of its keys
    found["diagnostics_.ridge_errors"] = {float(penalty): error for penalty, error in errors}
    for name, kind in DATACLASSES.items():
        found[name] = kind(**{field.name: found.pop(f"{name}.{field.name}") for field in fields(kind)})
    if "feature_names_in_" in found:
        found["feature_names_in_"] = np.asarray(found["feature_names_in_"], object)
    vars(model).update(found)
    return model


def _plain(value: Any) -> Any:
    """NumPy numbers as JSON."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} cannot be saved.")
