"""Errors whose message is meant for the person at the keyboard."""

from pydantic import ValidationError


class InputError(ValueError):
    """Input that cannot be used: one sentence that names the file or field and the remedy.

    The command line prints the sentence and exits with code 2; library callers see a `ValueError`.
    """


def first_fault(error: ValidationError) -> str:
    """One sentence on the first refused field.

    Args:
        error: what the validation found.

    Returns:
        Field, value and reason.
    """
    fault = error.errors(include_url=False)[0]
    field = ".".join(str(part) for part in fault["loc"])
    if fault["type"] == "missing":
        return f"{field} is missing."
    reason = f"{fault['msg'][:1].lower()}{fault['msg'][1:]}."
    return f"{field} = {fault['input']!r} is refused: {reason}" if field else reason
