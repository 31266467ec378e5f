"""How a program ends when it cannot go on: one sentence on standard error, and an exit code that says of what kind."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

from pydantic import ValidationError

from relm_irl_jax.errors import (
    DivergenceError,
    InputError,
    first_fault,
    is_memory_fault,
    not_installed,
    printable,
    system_fault,
)


@contextmanager
def errors_as_sentences(program: str) -> Iterator[None]:
    """End the process with one sentence where a block raises an error that the user can mend.

    The exit code is 3 for a training that diverges, 1 where the reader of the output has ended, and 2 for the others.
    Errors of the program itself are raised.

    Args:
        program: name of the program, with which the sentence begins.

    Yields:
        Nothing.
    """
    try:
        yield
    except InputError as error:
        _exit(program, str(error))
    except DivergenceError as error:
        _exit(program, str(error), 3)
    except ValidationError as error:
        _exit(program, first_fault(error))
    except ModuleNotFoundError as error:
        _exit(program, not_installed(error))
    except BrokenPipeError:  # as in `relm-irl ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except (OSError, MemoryError, UnicodeError) as error:
        _exit(program, system_fault(error))
    except RuntimeError as error:  # JAX's errors are of this kind
        if not is_memory_fault(error):
            raise
        _exit(program, system_fault(error))


def _exit(program: str, message: str, code: int = 2) -> NoReturn:
    # Paths need not be UTF-8; `scenes check` has one line for each fault.
    lines = (printable(line) for line in f"{program}: {message}".split("\n"))
    print("\n".join(lines).encode(errors="backslashreplace").decode(), file=sys.stderr)
    sys.exit(code)
