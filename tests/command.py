"""The command line as tests call it, and tiny settings for it."""

import io
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path

from relm_irl_jax.cli import main

EXPERIMENT = Path(__file__).parents[1] / "experiments" / "smoke.toml"
QUICK = (
    *("--frames", "1536", "--evaluation.episodes", "50", "--elm.hidden", "40"),
    *("--agent", "siamese", "--scene.image-size", "64"),
    *("--siamese.workers", "24", "--siamese.t-max", "8", "--siamese.width", "16"),
)
"""As small as possible. Images of 64 pixels are what the default encoder of rooms takes."""


def relm_irl(folder: Path, *arguments: str) -> tuple[int, str, str]:
    """Run the command in this process, in a folder: exit code, and what it printed on standard output and error."""
    out, err, before = io.StringIO(), io.StringIO(), sys.argv
    sys.argv = ["relm-irl", *arguments]
    try:
        with chdir(folder), redirect_stdout(out), redirect_stderr(err):
            main()
        code = 0
    except SystemExit as stop:
        code = stop.code or 0
    finally:
        sys.argv = before
    return code, out.getvalue(), err.getvalue()


def in_process(monkeypatch, folder: Path, *arguments: str) -> None:
    """Run the command in this process, in a folder; what it prints and its exit go to the test."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", ["relm-irl", *arguments])
    main()
