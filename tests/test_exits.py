"""How programs end when they cannot go on."""

import subprocess
import sys
from pathlib import Path

import pytest

from relm_irl_jax.errors import DivergenceError, InputError
from relm_irl_jax.exits import errors_as_sentences

EXPERIMENTS = Path(__file__).parents[1] / "experiments"


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (InputError("seeds = 0 is refused."), 2, "study: seeds = 0 is refused."),
        (DivergenceError("the loss is not finite."), 3, "study: the loss is not finite."),
        (ModuleNotFoundError("no", name="optax"), 2, "study: optax is not installed; "),
        (
            PermissionError(13, "Permission denied", "out"),
            2,
            "study: out: Permission denied; give a folder that you may ",
        ),
        (MemoryError(), 2, "study: the memory does not suffice; "),
        (RuntimeError("RESOURCE_EXHAUSTED: of 3 GB"), 2, "study: the memory does not suffice; "),
        (InputError("a name \x1b[2J of a file"), 2, r"study: a name \x1b[2J of a file"),
    ],
)
def test_errors_that_the_user_can_mend_are_one_sentence(error, code, sentence, capsys):
    with pytest.raises(SystemExit) as end, errors_as_sentences("study"):
        raise error
    assert end.value.code == code
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith(sentence)


@pytest.mark.parametrize("error", [RuntimeError("of the program"), KeyError("a"), KeyboardInterrupt()])
def test_errors_of_the_program_itself_are_raised(error):
    with pytest.raises(type(error)), errors_as_sentences("study"):
        raise error


def test_a_script_ends_as_the_command_does(tmp_path):
    command = [sys.executable, str(EXPERIMENTS / "paper.py"), "--variants", "absent", "--out", str(tmp_path / "out")]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert ended.stderr.startswith("paper: variants: there is no absent; ")
    assert not (tmp_path / "out").exists()
