"""Fitted regressors on disk, as one safetensors file.

Arrays are tensors; everything else is JSON under the key `model` of the file's metadata, which also contains the
format's name and version.
"""

import json
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.utils.validation import check_is_fitted

from relm_irl_jax.elm.hidden_layer import HiddenLayer
from relm_irl_jax.elm.regressor import Diagnostics, ELMRegressor
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import load_arrays_and_metadata, save_arrays

FORMAT = "relm-irl-jax/elm"
"""Name of the file format, in the metadata."""

VERSION = 2
"""Version of the file format; `load_elm` refuses other versions."""

DATACLASSES = {"hidden_": HiddenLayer, "diagnostics_": Diagnostics}
"""Fitted attributes that are dataclasses, saved field by field."""


def save_elm(model: ELMRegressor, path: str | Path) -> None:
    """Write a fitted regressor.

    Args:
        model: the regressor. If its `random_state` is a generator, that is not saved; the drawn weights are.
        path: the file.
    """
    check_is_fitted(model)
    tensors: dict[str, np.ndarray] = {}
    values: dict[str, Any] = {}

    def put(name: str, value: Any) -> None:
        if isinstance(value, np.ndarray) and value.dtype != object:
            tensors[name] = value
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
    save_arrays(Path(path), tensors, {"format": FORMAT, "version": str(VERSION), "model": text})


def load_elm(path: str | Path) -> ELMRegressor:
    """Read what `save_elm` wrote.

    Args:
        path: the file.

    Returns:
        The fitted regressor.

    Raises:
        InputError: the file does not exist, or has another format or version.
    """
    if not Path(path).is_file():
        raise InputError(f"{path} does not exist; give a file that `save_elm` wrote.")
    tensors, metadata = load_arrays_and_metadata(Path(path))
    if metadata.get("format") != FORMAT:
        raise InputError(f"{path} contains no regressor: its format is {metadata.get('format')!r}, not {FORMAT!r}.")
    if metadata.get("version") != str(VERSION):
        raise InputError(f"{path} has format version {metadata.get('version')}; this program reads {VERSION}.")
    text = json.loads(metadata["model"])
    model = ELMRegressor(**text["parameters"])
    attributes: dict[str, Any] = {**text["values"], **tensors}
    errors = attributes["diagnostics_.ridge_errors"].items()  # JSON has converted the keys to strings
    attributes["diagnostics_.ridge_errors"] = {float(penalty): error for penalty, error in errors}
    for name, kind in DATACLASSES.items():
        attributes[name] = kind(**{field.name: attributes.pop(f"{name}.{field.name}") for field in fields(kind)})
    if "feature_names_in_" in attributes:
        attributes["feature_names_in_"] = np.asarray(attributes["feature_names_in_"], object)
    vars(model).update(attributes)
    return model


def _plain(value: Any) -> Any:
    """NumPy numbers as JSON."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} cannot be saved.")
