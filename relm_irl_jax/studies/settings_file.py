"""The settings of a study's folder: the first call writes them, and later calls must agree with them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from relm_irl_jax.config import Config, config_from_dict, config_to_dict, read_fields
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_json


def with_fields_of(config: Config, fields: Sequence[str]) -> Config:
    """The default configuration with some fields of another one.

    Args:
        config: the other one.
        fields: names of its fields.

    Returns:
        The configuration.
    """
    return replace(Config(), **{name: getattr(config, name) for name in fields})


def check_settings(folder: Path, config: Config, fields: Sequence[str], **others: Any) -> None:
    """Write a study's settings to its folder, or refuse a folder with results of other settings.

    Args:
        folder: the folder.
        config: the configuration.
        fields: the fields of the configuration on which the results depend.
        **others: what else they depend on, as JSON has it.

    Raises:
        InputError: the folder holds results of other settings, or its file cannot be read.
    """
    path = folder / "settings.json"
    new = config_to_dict(with_fields_of(config, fields))
    if path.exists():
        found = read_fields(path)
        # Settings that a later version added have their defaults.
        old = config_to_dict(with_fields_of(config_from_dict(found.pop("config", {}), str(path)), fields))
        changed = [name for name in fields if old[name] != new[name]]
        changed += [name for name, value in others.items() if found.get(name) != value]
        if changed:
            raise InputError(
                f"out: {folder} holds results with other settings ({changed[0]}); give another folder, or remove it."
            )
    write_json(path, {**others, "config": new})
