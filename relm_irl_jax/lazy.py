"""Names that are imported on first use."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_getattr(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """Make a package's `__getattr__` that imports a public name on first use.

    Args:
        package: the package's name.
        modules: for each public name, the module of the package that defines it.

    Returns:
        The function; it raises AttributeError for other names, and ImportError with the remedy where a module that the
        extra `train` installs is missing.
    """

    def import_name(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        try:
            return getattr(import_module(f"{package}.{modules[name]}"), name)
        except ModuleNotFoundError as error:
            from relm_irl_jax.errors import not_installed  # here, since workers of irl load nothing that they need not

            raise ImportError(not_installed(error)) from error

    return import_name


def deferred(module: str, name: str) -> Callable[..., Any]:
    """Make a function that imports another one when it is called.

    Args:
        module: the module that defines it.
        name: its name.

    Returns:
        The function.
    """

    def call(*arguments: Any, **options: Any) -> Any:
        return getattr(import_module(module), name)(*arguments, **options)

    return call
