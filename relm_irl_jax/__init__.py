"""Target-driven visual navigation with learned rewards, in JAX.

    rooms, load_scenes     scenes to train and evaluate in
    train                  an agent with a reward of your choice
    evaluate, compare      agents and policies on the tasks of the paper, in one table

Names are imported on first use. Importing the package registers its environments with Gymnasium.
"""

import sys
from contextlib import suppress
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from relm_irl_jax.lazy import deferred, lazy_getattr

if TYPE_CHECKING:
    from relm_irl_jax.api.compare import compare as compare
    from relm_irl_jax.api.evaluate import evaluate as evaluate
    from relm_irl_jax.api.scenes import load_scenes as load_scenes
    from relm_irl_jax.api.scenes import rooms as rooms
    from relm_irl_jax.api.train import train as train

    __version__: str
    """Version of the installed package."""

_MODULES = {
    "compare": "api.compare",
    "evaluate": "api.evaluate",
    "load_scenes": "api.scenes",
    "rooms": "api.scenes",
    "train": "api.train",
}

__all__ = ["__version__", *sorted(_MODULES)]

_import_name = lazy_getattr(__name__, _MODULES)


def __getattr__(name: str) -> Any:
    """A public name, on first use."""
    if name == "__version__":
        from importlib.metadata import version  # here, since it takes a tenth of the time that help may take

        return version("relm-irl-jax")
    return _import_name(name)


register_environments = deferred("relm_irl_jax.registration", "register_environments")

# The command registers them once it has read its arguments: Gymnasium takes a fifth of the time that help may take.
if PurePath(*sys.argv[:1]).name != "relm-irl":
    with suppress(ModuleNotFoundError):  # Gymnasium is of the extra `train`
        register_environments()
