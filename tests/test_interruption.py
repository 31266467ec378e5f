"""Ctrl-C and SIGTERM end a process in time, in one sentence. These are processes, since a signal belongs to one."""

import os
import signal
import subprocess
import sys
import time

import pytest

from relm_irl_jax.interruption import Interrupted, deferred, interruptible

SCRIPT = """
import hashlib, os, subprocess, sys, time
from pathlib import Path
from relm_irl_jax.interruption import Resume, deferred, exit_interrupted, interruptible
signals = __import__("signal")
signals.signal(signals.SIGINT, signals.default_int_handler)  # which a shell's background jobs ignore
Resume.run = Path("a run")
Resume.run.mkdir()
(Resume.run / "config.json").touch()
try:
    with interruptible(grace=0.5):
        child = subprocess.Popen(["sleep", "60"])
        if sys.argv[1] != "deferred":
            print(child.pid, flush=True)
        if sys.argv[1] == "python":
            time.sleep(60)
        elif sys.argv[1] == "finaliser":
            class Slow:
                def __del__(self):
                    time.sleep(60)
            slow = Slow()
            del slow
            time.sleep(60)
        elif sys.argv[1] == "deferred":
            with deferred():
                print(child.pid, flush=True)
                end = time.monotonic() + 0.2
                while time.monotonic() < end:
                    time.sleep(0.01)
                print("whole", flush=True)
            print("never", flush=True)
        else:
            hashlib.pbkdf2_hmac("sha256", b"", b"", 10**9)  # one step of the interpreter, of many minutes
except KeyboardInterrupt as error:
    exit_interrupted(error)
"""


READER = """
import multiprocessing, os, queue, threading, time
from relm_irl_jax.interruption import end_workers
events = multiprocessing.Queue()
events.put(0)
def read():
    while True:
        try:
            events.get(True, 0.01)
        except queue.Empty:
            pass
thread = threading.Thread(target=read, daemon=True)
thread.start()
time.sleep(0.2)
end_workers()
thread.join(10)
os._exit(thread.is_alive())
"""


def alive(number):
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize(
    ("where", "number"),
    [
        ("python", signal.SIGINT),
        ("python", signal.SIGTERM),
        ("deferred", signal.SIGTERM),
        ("finaliser", signal.SIGINT),
        ("library", signal.SIGTERM),
    ],
)
def test_an_interrupted_process_ends_in_time_and_says_how_to_continue(tmp_path, where, number):
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": tmp_path}
    with subprocess.Popen([sys.executable, "-c", SCRIPT, where], **pipes) as process:
        child = int(process.stdout.readline())
        process.send_signal(number)
        out, said = process.communicate(timeout=30)
    assert process.returncode == 128 + number
    assert said == "relm-irl: interrupted; continue with: relm-irl train --resume 'a run'\n"
    assert out == ("whole\n" if where == "deferred" else "")
    deadline = time.monotonic() + 10
    while alive(child) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not alive(child)


def test_threads_that_read_from_what_is_closed_end_in_silence():
    """As the one that writes TensorBoard's files."""
    ended = subprocess.run([sys.executable, "-c", READER], capture_output=True, text=True, timeout=60, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_signal_waits_for_the_end_of_nested_blocks():
    before = signal.getsignal(signal.SIGTERM)
    steps = []
    with pytest.raises(Interrupted) as interruption, interruptible(grace=1e6), deferred():  # noqa: PT012
        with deferred():
            os.kill(os.getpid(), signal.SIGTERM)
            steps.append("inner")
        steps.append("outer")
    signal.signal(signal.SIGTERM, before)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    assert interruption.value.number == signal.SIGTERM
    assert steps == ["inner", "outer"]


def test_handlers_are_restored():
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with interruptible():
        assert signal.getsignal(signal.SIGTERM) is not before[1]
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
