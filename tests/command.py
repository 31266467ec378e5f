"""The command line as tests call it, and tiny settings for it."""

import subprocess
import sys
from pathlib import Path

from relm_irl_jax.cli import main

EXPERIMENT = Path(__file__).parents[1] / "experiments" / "smoke.toml"
QUICK = ("--frames", "6000", "--evaluation.episodes", "50", "--elm.hidden", "40")


def relm_irl(*arguments: str, cwd: Path) -> subprocess.CompletedProcess:
    command = [sys.executable, "-W", "error::DeprecationWarning:relm_irl_jax", "-m", "relm_irl_jax", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=1200, check=False)


def in_process(monkeypatch, folder, *arguments: str) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", ["relm-irl", *arguments])
    main()
