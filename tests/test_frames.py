"""Numbers of frames, in files and on the command line."""

import pytest
from command import in_process
from hypothesis import given, settings
from hypothesis import strategies as st

from relm_irl_jax.config import config_from_dict, load_config
from relm_irl_jax.errors import InputError

SPELLINGS = [
    ("5000000", 5_000_000),
    ("5_000_000", 5_000_000),
    ("5e6", 5_000_000),
    ("5E+6", 5_000_000),
    ("5M", 5_000_000),
    ("1.5M", 1_500_000),
    ("600k", 600_000),
    ("600K", 600_000),
    ("0.25k", 250),
    ("2G", 2_000_000_000),
    (" 7 ", 7),
]
REFUSED = [
    "5X",
    "",
    "M",
    "five",
    "0.5",
    "1.2345k",
    "-5",
    "5 M",
    "5e-3",
    "1e999999999",
    "nan",
    "inf",
    "5MM",
    "0x10",
    "0",
    "0k",
]


@pytest.mark.parametrize(("text", "frames"), SPELLINGS)
def test_spellings(text, frames):
    assert config_from_dict({"frames": text}, "memory").frames == frames


@pytest.mark.parametrize("text", REFUSED)
def test_refusals_are_one_sentence(text):
    with pytest.raises(InputError, match=r"memory: frames = .* is refused: ") as refusal:
        config_from_dict({"frames": text}, "memory")
    assert "\n" not in str(refusal.value)


@settings(deadline=None)
@given(st.integers(1, 10**12))
def test_every_positive_number_reads_as_itself(frames):
    assert config_from_dict({"frames": frames}, "memory").frames == frames
    assert config_from_dict({"frames": f"{frames}"}, "memory").frames == frames
    assert config_from_dict({"frames": f"{frames:_}"}, "memory").frames == frames
    assert config_from_dict({"frames": f"{frames}k"}, "memory").frames == 1000 * frames
    assert config_from_dict({"frames": f"{frames}e3"}, "memory").frames == 1000 * frames


@pytest.mark.parametrize("line", ['frames = "600k"', "frames = 600_000", "frames = 6e5"])
def test_toml(tmp_path, line):
    (tmp_path / "c.toml").write_text(line)
    assert load_config(tmp_path / "c.toml").frames == 600_000


def test_toml_refuses_what_is_no_number(tmp_path):
    (tmp_path / "c.toml").write_text("frames = true")
    with pytest.raises(InputError, match="frames = True is refused: a whole number is needed"):
        load_config(tmp_path / "c.toml")


@pytest.mark.parametrize(("text", "frames"), [("5M", 5_000_000), ("5e6", 5_000_000), ("600k", 600_000), ("17", 17)])
def test_command_line(monkeypatch, tmp_path, text, frames):
    class Reached(Exception):
        pass

    def run(config):
        raise Reached(config.frames)

    monkeypatch.setattr("relm_irl_jax.pipeline.run", run)
    with pytest.raises(Reached, match=f"^{frames}$"):
        in_process(monkeypatch, tmp_path, "train", "--frames", text)


@pytest.mark.parametrize("text", ["5X", "1.5", "0"])
def test_the_command_line_refuses_in_one_sentence(monkeypatch, tmp_path, capsys, text):
    with pytest.raises(SystemExit) as end:
        in_process(monkeypatch, tmp_path, "train", "--frames", text)
    assert end.value.code == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith(f"relm-irl: frames = '{text}' is refused: ")
    assert printed.err.count("\n") == 1
