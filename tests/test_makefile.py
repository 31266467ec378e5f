"""The Makefile: the commands that it would run, and the variables that it refuses."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
VARIABLES = (
    "TASK",
    "METHOD",
    "AGENT",
    "SCENES",
    "SEEDS",
    "FRAMES",
    "RUN",
    "BENCH",
    "PIECE",
    "VARIANT",
    "QUICK",
    "JOBS",
    "ARGS",
)

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")


def make(*arguments: str) -> subprocess.CompletedProcess:
    """What make prints, with none of the variables of the make that runs the tests."""
    inherited = {k: v for k, v in os.environ.items() if k not in VARIABLES and not k.startswith(("MAKE", "MFLAGS"))}
    inherited["PYTHON"] = sys.executable
    command = ["make", "--no-print-directory", *arguments]
    return subprocess.run(command, cwd=ROOT, env=inherited, capture_output=True, text=True, timeout=60, check=False)


def command_of(*arguments: str) -> str:
    """The last command that make would run, its spaces made one."""
    done = make("-n", *arguments)
    assert done.returncode == 0, done.stderr
    return " ".join(re.split(r"\n(?=\S)", done.stdout.replace("\\\n", " ").strip())[-1].split())


@pytest.mark.parametrize(
    ("arguments", "command"),
    [
        (["train"], "relm-irl train"),
        (["train", "TASK=II"], "relm-irl train --task 'II'"),
        (["train", "METHOD=rl irl"], "relm-irl train --methods rl irl"),
        (["train", "METHOD=rl,irl"], "relm-irl train --methods rl irl"),
        (["train", "FRAMES=5M", "SEEDS=3", "RUN=a b"], "relm-irl train --seeds '3' --frames '5M' --run 'a b'"),
        (["train", "AGENT=metric", "SCENES=x"], "relm-irl train --agent 'metric' --scenes 'x'"),
        (["train", "ARGS=--siamese.width 8"], "relm-irl train --siamese.width 8"),
        (["smoke", "RUN=x"], "relm-irl train --config experiments/smoke.toml --run 'x'"),
        (["smoke", "TASK=III"], "relm-irl train --config experiments/smoke.toml --task 'III'"),
        (["evaluate", "RUN=x", "TASK=I"], "relm-irl evaluate 'x' --task 'I'"),
        (["report", "RUN=x"], "relm-irl report 'x'"),
        (["play"], "relm-irl play"),
        (["play", "RUN=x", "METHOD=rl"], "relm-irl play 'x' --method 'rl'"),
        (["paper"], "experiments/paper.py"),
        (["paper", "JOBS=2"], "experiments/paper.py --jobs '2'"),
        (["paper", "PIECE=elm metric", "RUN=x"], "experiments/paper.py --pieces elm metric --out 'x'"),
        (["paper", "VARIANT=lp", "QUICK=1"], "experiments/paper.py --variants lp --quick"),
        (["paper", "QUICK=0"], "experiments/paper.py"),
        (["test", "ARGS=-x"], "-m pytest -x"),
    ],
)
def test_commands(arguments, command):
    assert command_of(*arguments).endswith(command)


def test_benchmarks_are_all_or_those_named():
    assert (
        "for name in commands peers trainings gym agent scaling elm irl encoder; do .venv/bin/relm-irl bench $name ||"
        in command_of("bench")
    )
    assert "for name in elm; do .venv/bin/relm-irl bench $name --out 'x' ||" in command_of(
        "bench", "BENCH=elm", "RUN=x"
    )


def test_what_runs_in_ci_shares_compiled_programs():
    for target in ("smoke", "notebooks", "paper"):
        assert f"JAX_COMPILATION_CACHE_DIR='{ROOT}/.cache/jax'" in command_of(target)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["train", "METHODS=rl"], "there is no variable METHODS; did you mean METHOD"),
        (["train", "task=II"], "there is no variable task; did you mean TASK"),
        (["train", "TASK=II", "FRAME=5M"], "there is no variable FRAME; did you mean FRAMES"),
        (["train", "XYZZY=1"], "there is no variable XYZZY; known are TASK, METHOD, "),
        (["lint", "TASK=I"], "make lint does not use TASK; these do: train, "),
        (["TASK=I"], "make help does not use TASK; these do: train, "),
        (["evaluate"], "make evaluate needs RUN=folder"),
        (["report"], "make report needs RUN=folder"),
    ],
)
def test_refusals_are_one_sentence(arguments, sentence):
    done = make("-n", *arguments)
    assert done.returncode == 2
    assert re.fullmatch(rf"Makefile:\d+: \*\*\* {re.escape(sentence)}.*\n", done.stderr)


def test_a_variable_is_accepted_where_one_of_the_targets_uses_it():
    assert make("-n", "lint", "train", "TASK=II").returncode == 0


def test_help_lists_every_target_and_every_variable():
    text = (ROOT / "Makefile").read_text()
    targets = re.search(r"^\.PHONY: (.*)$", text, re.MULTILINE)
    assert targets is not None
    listed = set(re.findall(r"^  (\w+)", make("help").stdout, re.MULTILINE))
    assert listed == {*targets[1].split(), *VARIABLES}


def test_targets_name_the_variables_that_their_commands_use():
    text = (ROOT / "Makefile").read_text()
    for name, _, variables, recipe in re.findall(
        r"^([a-z]+):.*?## ([^\[\n]*)(?:\[(.*)\])?\n((?:\t.*\n)*)", text, re.MULTILINE
    ):
        used = set(re.findall(rf"\b(?:{'|'.join(VARIABLES)})\b", recipe))
        if "$(TRAIN)" in recipe:
            used |= {"TASK", "METHOD", "AGENT", "SCENES", "SEEDS", "FRAMES", "RUN", "ARGS"}
        assert used == set(variables.split()), name
