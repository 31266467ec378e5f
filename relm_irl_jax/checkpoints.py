"""Checkpoints: a training's complete state on disk, from which an interrupted training continues with the same results.

Orbax writes them atomically in the background, and keeps the last one. A checkpoint also contains the rows of the
learning curve so far and the configuration. `relm_irl_jax.parameters` saves the final network.
"""

import hashlib
import json
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from shutil import rmtree
from textwrap import shorten
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from relm_irl_jax.config import Config, config_from_dict, config_to_dict, trained_part
from relm_irl_jax.errors import InputError
from relm_irl_jax.interruption import deferred
from relm_irl_jax.types import Row, State

LATE_ERRORS = ("Event loop is closed", "Encountered error while reading")
"""Messages of errors in background reads of a damaged checkpoint, whose tracebacks are suppressed."""


class Checkpoints:
    """The checkpoints of one training, in a separate folder; a context manager.

    Args:
        path: the folder, which is created with the first checkpoint.
        config: the configuration as run.
    """

    def __init__(self, path: Path, config: Config):
        self.path, self.config = path, config
        self._open_manager: Any = None

    def __enter__(self) -> "Checkpoints":
        return self

    def __exit__(self, *_: object) -> None:
        """Wait until the last checkpoint is written."""
        if self._open_manager is not None:
            manager, self._open_manager = self._open_manager, None
            with self._writing():
                manager.close()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Turn the errors of Orbax, which are of many kinds, into one sentence."""
        try:
            with deferred():
                yield
        except Exception as error:
            reason = shorten(str(error) or type(error).__name__, 100, placeholder=" …")
            raise InputError(
                f"{self.path}: the checkpoint cannot be written ({reason}); free some space, and run the same command "
                "again."
            ) from error

    def save(self, state: State, rows: list[Row]) -> None:
        """Save a state in place of the previous one. Returns when the arrays are copied; writing continues later.

        Args:
            state: the state of the training.
            rows: the rows of all chunks so far.
        """
        args, leaves = _orbax().args, _leaves(state)
        with self._writing():
            self._manager().save(
                len(rows),
                args=args.Composite(
                    state=args.StandardSave(leaves),
                    rows=args.JsonSave({"rows": list(rows), "sha256": _checksum(leaves, rows)}),
                    config=args.JsonSave(config_to_dict(self.config)),
                ),
            )

    def last_step(self) -> int | None:
        """Number of rows of the last checkpoint; None if there is none."""
        with deferred():
            return self._manager().latest_step() if self.path.exists() else None

    def restore(self, like: State) -> tuple[State, list[Row]] | None:
        """Read the last saved state.

        Args:
            like: the state before the first chunk, which gives structure, shapes, dtypes and devices.

        Returns:
            The state and the rows of all chunks up to it; None if there is no checkpoint.

        Raises:
            InputError: the checkpoint is damaged, or belongs to another configuration.
        """
        if not self.path.exists():
            return None
        args = _orbax().args
        form = [jax.ShapeDtypeStruct(x.shape, x.dtype, sharding=x.sharding) for x in _leaves(like)]
        hook = sys.unraisablehook
        try:
            step = self.last_step()
            if step is None:
                return None
            sys.unraisablehook = lambda error: None if str(error.exc_value).startswith(LATE_ERRORS) else hook(error)
            with deferred():
                restored = self._manager().restore(
                    step,
                    args=args.Composite(
                        state=args.StandardRestore(form), rows=args.JsonRestore(), config=args.JsonRestore()
                    ),
                )
            saved_config = config_from_dict(restored.config, str(self.path))
            rows = restored.rows["rows"]
            if restored.rows["sha256"] != _checksum(restored.state, rows):
                raise ValueError("it does not match its checksum")
        except Exception as error:  # damaged files cause many kinds of exceptions
            reason = shorten(str(error) or type(error).__name__, 60, placeholder=" …")
            # The filter stays: unfinished reads raise further errors when they are garbage-collected.
            raise InputError(f"{self.path}: the checkpoint cannot be read ({reason}).") from error
        sys.unraisablehook = hook
        if trained_part(saved_config) != trained_part(self.config):
            raise InputError(f"{self.path}: the checkpoint belongs to another configuration.")
        return _state(like, restored.state), rows

    def remove(self) -> None:
        """Remove the folder, and its parent folder if that is then empty."""
        self.__exit__()
        rmtree(self.path, ignore_errors=True)
        with suppress(OSError):
            self.path.parent.rmdir()

    def _manager(self) -> Any:
        if self._open_manager is None:
            options = _orbax().CheckpointManagerOptions(max_to_keep=1)
            self._open_manager = _orbax().CheckpointManager(self.path.absolute(), options=options)
        return self._open_manager


def _orbax() -> Any:
    """Import Orbax, which is slow and only needed by trainings."""
    # Suppresses warnings about slow disks, and errors that are raised, too.
    logging.getLogger("absl").setLevel(logging.CRITICAL)
    return import_module("orbax.checkpoint")


def _is_key(array: jax.Array) -> bool:
    return jax.dtypes.issubdtype(array.dtype, jax.dtypes.prng_key)


def _leaves(state: Any) -> list[jax.Array]:
    """The arrays of a state; random keys as integer arrays."""
    return [jax.random.key_data(x) if _is_key(x) else x for x in jax.tree.leaves(state)]


def _checksum(leaves: list[jax.Array], rows: list[Row]) -> str:
    """Checksum of a state and its rows: a flipped bit is not always noticed by Orbax."""
    digest = hashlib.sha256(json.dumps(rows, sort_keys=True).encode())
    for leaf in leaves:
        digest.update(f"{leaf.dtype} {leaf.shape}".encode() + np.asarray(leaf).tobytes())
    return digest.hexdigest()


def _state(like: Any, leaves: list[jax.Array]) -> Any:
    """Reverse `_leaves`. Arrays are committed to a device only if those of `like` are, which avoids recompilation."""

    def restored(old: jax.Array, new: jax.Array) -> jax.Array:
        new = new if old.committed else jnp.asarray(np.asarray(new))
        return jax.random.wrap_key_data(new, impl=jax.random.key_impl(old)) if _is_key(old) else new

    olds, tree = jax.tree.flatten(like)
    return jax.tree.unflatten(tree, [restored(old, new) for old, new in zip(olds, leaves, strict=True)])
