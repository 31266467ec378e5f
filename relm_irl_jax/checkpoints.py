"""Checkpoints: a training's whole state on disk, from which it goes on as if it had not been cut off.

Orbax writes them in the background, each whole or not at all, and keeps the last one. Beside the state lie the rows of
the learning curve so far and the configuration. The final network is kept elsewhere, by `relm_irl_jax.parameters`.
"""

import logging
import sys
from contextlib import suppress
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
from relm_irl_jax.types import Row, State

LATE = ("Event loop is closed", "Encountered error while reading")
"""What reads of a damaged checkpoint say that end once Orbax has given up; not worth a traceback."""


class Checkpoints:
    """The checkpoints of one training, in a folder of their own; to be used in a `with` statement.

    Args:
        path: the folder; it appears with the first checkpoint.
        config: the configuration as run.
    """

    def __init__(self, path: Path, config: Config):
        self.path, self.config = path, config
        self._opened: Any = None

    def __enter__(self) -> "Checkpoints":
        return self

    def __exit__(self, *_: object) -> None:
        """Wait for what is being written."""
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    def save(self, state: State, rows: list[Row]) -> None:
        """Keep a state, and forget the one before it. Returns once the arrays are copied; the rest is written later.

        Args:
            state: everything that the training carries on.
            rows: of all chunks so far.
        """
        args = _orbax().args
        self._manager().save(
            len(rows),
            args=args.Composite(
                state=args.StandardSave(_leaves(state)),
                rows=args.JsonSave(list(rows)),  # a copy, since the caller's list grows while this is written
                config=args.JsonSave(config_to_dict(self.config)),
            ),
        )

    def restore(self, like: State) -> tuple[State, list[Row]] | None:
        """Read the last state kept.

        Args:
            like: the state before the first chunk, which gives structure, shapes, dtypes and devices.

        Returns:
            The state and the rows of all chunks up to it; None where nothing was kept.

        Raises:
            InputError: what was kept is damaged, or belongs to another configuration.
        """
        if not self.path.exists():
            return None
        args = _orbax().args
        form = [jax.ShapeDtypeStruct(x.shape, x.dtype, sharding=x.sharding) for x in _leaves(like)]
        hook = sys.unraisablehook
        try:
            step = self._manager().latest_step()
            if step is None:
                return None
            sys.unraisablehook = lambda found: None if str(found.exc_value).startswith(LATE) else hook(found)
            found = self._manager().restore(
                step,
                args=args.Composite(
                    state=args.StandardRestore(form), rows=args.JsonRestore(), config=args.JsonRestore()
                ),
            )
            before = config_from_dict(found.config, str(self.path))
        except Exception as error:  # whatever it is that reading damaged files meets
            reason = shorten(str(error) or type(error).__name__, 60, placeholder=" …")
            # What was left half read complains later still, whenever it is collected: the filter stays.
            raise InputError(f"{self.path}: the checkpoint cannot be read ({reason}).") from error
        sys.unraisablehook = hook
        if trained_part(before) != trained_part(self.config):
            raise InputError(f"{self.path}: the checkpoint is of another configuration.")
        return _state(like, found.state), found.rows

    def remove(self) -> None:
        """Remove the folder, and the one around it where it is empty then."""
        self.__exit__()
        rmtree(self.path, ignore_errors=True)
        with suppress(OSError):
            self.path.parent.rmdir()

    def _manager(self) -> Any:
        if self._opened is None:
            options = _orbax().CheckpointManagerOptions(max_to_keep=1)
            self._opened = _orbax().CheckpointManager(self.path.absolute(), options=options)
        return self._opened


def _orbax() -> Any:
    """Orbax, which takes a while to import and is needed by trainings alone."""
    # It warns where a disk is slow; a training only waits then.
    logging.getLogger("absl").setLevel(logging.ERROR)
    return import_module("orbax.checkpoint")


def _is_key(array: jax.Array) -> bool:
    return jax.dtypes.issubdtype(array.dtype, jax.dtypes.prng_key)


def _leaves(state: Any) -> list[jax.Array]:
    """The arrays of a state, random keys as the numbers that they consist of."""
    return [jax.random.key_data(x) if _is_key(x) else x for x in jax.tree.leaves(state)]


def _state(like: Any, leaves: list[jax.Array]) -> Any:
    """Reverse `_leaves`. Arrays that were tied to no device are so again, so that no program is compiled twice."""

    def restored(old: jax.Array, new: jax.Array) -> jax.Array:
        new = new if old.committed else jnp.asarray(np.asarray(new))
        return jax.random.wrap_key_data(new, impl=jax.random.key_impl(old)) if _is_key(old) else new

    olds, tree = jax.tree.flatten(like)
    return jax.tree.unflatten(tree, [restored(old, new) for old, new in zip(olds, leaves, strict=True)])
