"""Ending a command early: Ctrl-C and SIGTERM.

Both raise an exception in the main thread, so that trainings save a checkpoint and resources are released. Python can
only raise it between two steps of the interpreter, and compiling a program may take long. A thread that the system
wakes up therefore ends the process when it has not ended by itself in time.
"""

import os
import shlex
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

GRACE_SECONDS = 3.0
"""Seconds after which an interrupted process is ended."""

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupted(KeyboardInterrupt):
    """The process was asked to end.

    Attributes:
        number: the signal's number.
    """

    def __init__(self, number: int):
        super().__init__(number)
        self.number = number


class Resume:
    """The command that continues what the process does, for the message.

    Attributes:
        run: the run folder of a training; None if nothing can be continued.
        sentence: what a program other than `relm-irl` says instead.
    """

    run: Path | None = None
    sentence: str = ""

    @classmethod
    def message(cls) -> str:
        """The sentence that is printed at the end."""
        if cls.sentence:
            return cls.sentence
        if cls.run is None or not (cls.run / "config.json").is_file():
            return "relm-irl: interrupted."
        return f"relm-irl: interrupted; continue with: relm-irl train --resume {shlex.quote(str(cls.run))}"


@contextmanager
def interruptible(grace: float = GRACE_SECONDS, *, until_exit: bool = False) -> Iterator[None]:
    """Turn signals into `Interrupted` while a block runs, and end the process some seconds after a signal.

    Args:
        grace: seconds.
        until_exit: whether the process ends after the block; it then ignores signals while it ends.

    Yields:
        Nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread can handle signals
        return
    # A shell starts background jobs with interruptions ignored.
    handled = [number for number in _SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    previous = {number: signal.signal(number, _interrupt) for number in handled}
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    before, hook = signal.set_wakeup_fd(writing, warn_on_full_buffer=False), sys.unraisablehook
    sys.unraisablehook = lambda error: _raise_again(error) or hook(error)
    threading.Thread(target=_end_in_time, args=(reading, grace), daemon=True).start()
    try:
        yield
    except KeyboardInterrupt:
        raise  # the thread keeps waiting for the process to end
    else:
        os.close(writing)  # ends the thread
        writing = None
    finally:
        signal.set_wakeup_fd(before)
        if writing is None and not until_exit:
            sys.unraisablehook = hook
            for number, handler in previous.items():
                signal.signal(number, handler)
        else:
            for number in handled:  # a second signal does not disturb what remains to be done
                signal.signal(number, signal.SIG_IGN)


class _Deferral:
    """Whether a signal waits for the end of a block, and which one does."""

    blocks = 0
    waiting: int | None = None


@contextmanager
def deferred() -> Iterator[None]:
    """Let a signal wait for the end of a block, for libraries that log an interruption as an error of their own.

    Yields:
        Nothing.

    Raises:
        Interrupted: a signal came while the block ran.
    """
    _Deferral.blocks += 1
    try:
        yield
    finally:
        _Deferral.blocks -= 1
        if _Deferral.blocks == 0 and _Deferral.waiting is not None:
            number, _Deferral.waiting = _Deferral.waiting, None
            raise Interrupted(number)


def _interrupt(number: int, _: object) -> None:
    for other in _SIGNALS:
        signal.signal(other, signal.SIG_IGN)
    if _Deferral.blocks:
        _Deferral.waiting = number
    else:
        raise Interrupted(number)


def _raise_again(error: Any) -> bool:
    """Send a signal again that came within a finaliser, where Python drops exceptions; whether it was one."""
    interruption = error.exc_value
    if not isinstance(interruption, Interrupted):
        return False
    for number in _SIGNALS:
        signal.signal(number, _interrupt)
    threading.Timer(0.02, os.kill, (os.getpid(), interruption.number)).start()
    return True


def _end_in_time(reading: int, grace: float) -> None:
    """Wait for a signal, and end the process after the grace period."""
    with suppress(OSError):
        while True:
            received = os.read(reading, 1)
            if not received:
                os.close(reading)
                return
            if received[0] in _SIGNALS:
                break
        time.sleep(grace)
        ending = threading.Thread(target=end_workers, daemon=True)
        ending.start()
        ending.join(1.0)
        kill_children()
        os.write(2, f"{Resume.message()}\n".encode(errors="replace"))
        os._exit(128 + received[0])


def end_workers() -> None:
    """Kill joblib's workers, if there are any, and remove their temporary files; the process is about to end."""
    # Threads of libraries that read from what is closed here would print a traceback.
    threading.excepthook = lambda _: None
    loky = sys.modules.get("joblib.externals.loky.reusable_executor")
    if loky is not None and loky._executor is not None:
        loky._executor.terminate(kill_workers=True)
    # What the end of the interpreter would do: otherwise the resource tracker warns of semaphores that are left.
    utilities = sys.modules.get("multiprocessing.util")
    if utilities is not None:
        with suppress(Exception):
            utilities._run_finalizers(0)


def kill_children() -> None:
    """Kill all processes that this one has started, where the system lists them.

    Python's resource trackers end by themselves, after they have removed temporary files.
    """
    for children in Path("/proc/self/task").glob("*/children"):
        with suppress(OSError):
            for child in children.read_text().split():
                if b"resource_tracker" not in Path(f"/proc/{child}/cmdline").read_bytes():
                    os.kill(int(child), signal.SIGKILL)


def exit_interrupted(error: KeyboardInterrupt) -> NoReturn:
    """Print how to continue, and end the process and those that it has started.

    Args:
        error: the interruption.
    """
    end_workers()
    kill_children()
    print(Resume.message(), file=sys.stderr, flush=True)
    with suppress(OSError):
        sys.stdout.flush()
    # The interpreter's own end waits for threads of libraries, and may crash while one of them compiles.
    os._exit(128 + (error.number if isinstance(error, Interrupted) else signal.SIGINT))
