"""Errors whose message is meant for the person at the keyboard."""


class InputError(ValueError):
    """Input that cannot be used: one sentence that names the file or field and the remedy.

    The command line prints the sentence and exits with code 2; library callers see a `ValueError`.
    """
