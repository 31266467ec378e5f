"""A small share of `make chaos`."""

import subprocess
import sys
from pathlib import Path

CHAOS = Path(__file__).with_name("chaos.py")


def test_a_run_that_is_ended_and_continued_is_the_uninterrupted_one(tmp_path):
    """A process, since it forks, which one that computes must not."""
    options = ("--kills", "2", "--setups", "quick", "--seed", "3", "--out", str(tmp_path))
    done = subprocess.run([sys.executable, str(CHAOS), *options], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 processes ended" in done.stdout
    assert (tmp_path / "chaos.csv").read_text().startswith("seed,runs,SIGKILL,SIGTERM,SIGINT\n3,1,")
