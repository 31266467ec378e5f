"""Errors whose message is written for the user."""

import difflib
import errno
from dataclasses import fields, is_dataclass
from functools import reduce
from typing import Any

from pydantic import ValidationError


class InputError(ValueError):
    """Input that cannot be used: one sentence that names the file or field and the remedy.

    The command line prints the sentence and exits with code 2; library callers see a `ValueError`.
    """


class DivergenceError(ArithmeticError):
    """A training whose numbers are no longer finite: one sentence that names what, and at which frame.

    The command line prints the sentence and exits with code 3.
    """


def first_fault(error: ValidationError, settings: Any = None) -> str:
    """One sentence on the first refused field; unknown fields come first.

    Args:
        error: the validation error.
        settings: settings with the known fields; the closest of their names is suggested for an unknown one.

    Returns:
        Field, value and reason.
    """
    faults = error.errors(include_url=False)
    fault = next((fault for fault in faults if fault["type"] == "unexpected_keyword_argument"), faults[0])
    path = tuple(printable(str(part)) for part in fault["loc"])
    field = ".".join(path)
    if fault["type"] == "unexpected_keyword_argument":
        return f"unknown field `{field}`{_suggestion(path, settings)}."
    if fault["type"] == "dataclass_type" and field:
        return f"`{field}` is a group of fields; write `{field}.FIELD`."
    if fault["type"] == "missing":
        return f"{field} is missing."
    reason = f"{fault['msg'][:1].lower()}{fault['msg'][1:]}."
    return f"{field} = {fault['input']!r} is refused: {reason}" if field else reason


def printable(text: str) -> str:
    """Text of a file with its line breaks and other control characters escaped, for messages.

    Args:
        text: the text.

    Returns:
        One line that cannot control a terminal.
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "replace").decode() for c in text)


def first_line(error: BaseException) -> str:
    """The first line of an error's message, or its kind if it has none.

    Args:
        error: the error.

    Returns:
        One line.
    """
    return (str(error).splitlines() or [type(error).__name__])[0]


TRAINING_STACK = frozenset(
    {
        *("PIL", "filelock", "flax", "gymnasium", "h5py", "huggingface_hub", "markdown_it", "matplotlib", "optax"),
        *("orbax", "tensorboardX", "tyro"),
    }
)
"""Modules that the extra `train` installs."""


def not_installed(error: ModuleNotFoundError) -> str:
    """One sentence on a module that is missing.

    Args:
        error: what its import raised.

    Returns:
        What is missing, and the command that installs it.

    Raises:
        ModuleNotFoundError: the error, if the extra `train` does not install the module.
    """
    module = (error.name or "").partition(".")[0]
    if module not in TRAINING_STACK:
        raise error
    return f"{module} is not installed; the command and training need it: pip install 'relm-irl-jax[train]'."


_REMEDIES = {
    errno.ENOSPC: "free some space on the disk, and run the same command again",
    errno.EDQUOT: "free some space, and run the same command again",
    errno.EFBIG: "raise the limit of file sizes, and run the same command again",
    errno.EROFS: "give a folder on a file system that can be written",
    errno.EACCES: "give a folder that you may write to, or a file that you may read",
    errno.EPERM: "give a folder that you may write to, or a file that you may read",
    errno.ENAMETOOLONG: "give a shorter path",
    errno.ENOTDIR: "give a path whose parents are folders",
    errno.EISDIR: "give a file instead of a folder",
    errno.EMFILE: "raise the limit of open files (`ulimit -n`)",
}


def is_memory_fault(error: BaseException) -> bool:
    """Whether the memory did not suffice, on the host or on JAX's device.

    Args:
        error: any error.

    Returns:
        Whether it is one of Python's, or one of JAX's that says so.
    """
    return isinstance(error, MemoryError) or str(error).startswith("RESOURCE_EXHAUSTED")


def system_fault(error: OSError | MemoryError | UnicodeError | RuntimeError) -> str:
    """One sentence on an error of the operating system.

    Args:
        error: the error.

    Returns:
        File, reason and remedy.
    """
    if is_memory_fault(error):
        return "the memory does not suffice; give smaller settings, fewer scenes or smaller images."
    if isinstance(error, UnicodeError):
        return f"a name or path is not UTF-8 ({error.reason if hasattr(error, 'reason') else error}); rename it."
    assert isinstance(error, OSError)
    reason = error.strerror or first_line(error)
    remedy = _REMEDIES.get(error.errno or 0, "correct it, and run the same command again")
    name = error.filename2 or error.filename  # of a file that is renamed, the name that it should get
    return f"{f'{name}: ' if name else ''}{reason}; {remedy}."


def _suggestion(path: tuple[str, ...], settings: Any) -> str:
    """Suggestion for an unknown field: the closest name of its group, or all names of the group."""
    group = reduce(lambda group, name: getattr(group, name, None), path[:-1], settings)
    if not is_dataclass(group):
        return ""
    known = [field.name for field in fields(group)]
    nearest = difflib.get_close_matches(path[-1], known, n=1)
    return f"; did you mean `{'.'.join((*path[:-1], *nearest))}`?" if nearest else f"; known fields: {', '.join(known)}"
