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

from relm_irl_jax.elm.hidden_layer import ACTIVATIONS, HiddenLayer
from relm_irl_jax.elm.regressor import Diagnostics, ELMRegressor
from relm_irl_jax.errors import InputError, first_line
from relm_irl_jax.files import load_arrays_and_metadata, save_arrays

FORMAT = "relm-irl-jax/elm"
"""Name of the file format, in the metadata."""

VERSION = 2
"""Version of the file format; `load_elm` refuses other versions."""

FITTED = (
    *("order_", "press_curve_", "n_selected_", "ridge_", "hidden_", "coef_", "intercept_", "diagnostics_"),
    *("n_features_in_", "feature_names_in_", "_single_output"),
)
"""Attributes of a fitted regressor."""

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
    try:
        return _build(tensors, json.loads(metadata["model"]))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError, OverflowError) as error:
        reason = first_line(error)
        raise InputError(f"{path}: contains no whole regressor ({reason}); save it again.") from error


def _build(tensors: dict[str, np.ndarray], text: dict[str, Any]) -> ELMRegressor:
    """Make a regressor of the contents of a file; only attributes of a fitted regressor are taken over."""
    model = ELMRegressor(**text["parameters"])
    attributes: dict[str, Any] = {**text["values"], **tensors}
    for name in attributes:
        if name.split(".")[0] not in FITTED:
            raise InputError(f"`{name[:40]}` is no attribute of a fitted regressor; save it again.")
    for name, tensor in tensors.items():
        undefined = np.isnan(tensor) if name == "press_curve_" else ~np.isfinite(tensor)
        if undefined.any():
            raise InputError(f"tensor `{name}` is not finite; fit the regressor again.")
    errors = attributes["diagnostics_.ridge_errors"].items()  # JSON has converted the keys to strings
    attributes["diagnostics_.ridge_errors"] = {float(penalty): error for penalty, error in errors}
    for name, kind in DATACLASSES.items():
        attributes[name] = kind(**{field.name: attributes.pop(f"{name}.{field.name}") for field in fields(kind)})
    if "feature_names_in_" in attributes:
        attributes["feature_names_in_"] = np.asarray(attributes["feature_names_in_"], object)
    _check_attributes(attributes)
    vars(model).update(attributes)
    return model


def _check_attributes(attributes: dict[str, Any]) -> None:
    """Raise an InputError unless all attributes of a fitted regressor are there and fit each other."""
    missing = [name for name in FITTED if name not in attributes and name != "feature_names_in_"]
    if missing:
        raise InputError(f"`{missing[0]}` is missing; save it again.")
    hidden, coefficients, intercept = attributes["hidden_"], attributes["coef_"], attributes["intercept_"]
    if hidden.activation not in ACTIVATIONS:
        raise InputError(f"the activation {str(hidden.activation)[:40]!r} is unknown; save it again.")
    real = (hidden.mean, hidden.scale, hidden.weights, hidden.bias, coefficients, intercept)
    if not all(isinstance(array, np.ndarray) and array.dtype == np.float64 for array in real):
        raise InputError("its tensors are not in double precision; save it again.")
    selected, inputs = attributes["n_selected_"], attributes["n_features_in_"]
    shapes = tuple(array.shape for array in real[:4])
    if shapes != ((inputs,), (inputs,), (inputs, selected), (selected,)) or (
        coefficients.shape != (selected, *intercept.shape)
    ):
        raise InputError("the shapes of its tensors contradict each other; save it again.")


def _plain(value: Any) -> Any:
    """NumPy numbers as JSON."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} cannot be saved.")
