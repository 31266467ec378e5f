"""Errors whose message is written for the user."""

import difflib
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
    path = tuple(str(part) for part in fault["loc"])
    field = ".".join(path)
    if fault["type"] == "unexpected_keyword_argument":
        return f"unknown field `{field}`{_suggestion(path, settings)}."
    if fault["type"] == "dataclass_type" and field:
        return f"`{field}` is a group of fields; write `{field}.FIELD`."
    if fault["type"] == "missing":
        return f"{field} is missing."
    reason = f"{fault['msg'][:1].lower()}{fault['msg'][1:]}."
    return f"{field} = {fault['input']!r} is refused: {reason}" if field else reason


def _suggestion(path: tuple[str, ...], settings: Any) -> str:
    """Suggestion for an unknown field: the closest name of its group, or all names of the group."""
    group = reduce(lambda group, name: getattr(group, name, None), path[:-1], settings)
    if not is_dataclass(group):
        return ""
    known = [field.name for field in fields(group)]
    nearest = difflib.get_close_matches(path[-1], known, n=1)
    return f"; did you mean `{'.'.join((*path[:-1], *nearest))}`?" if nearest else f"; known fields: {', '.join(known)}"
