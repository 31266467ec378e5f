"""Help of the command: short, quick, and of use where an option is misspelt."""

import subprocess
import sys

import pytest
from command import relm_irl

from relm_irl_jax.config import Config, config_to_dict

GROUPS = [name for name, value in config_to_dict(Config()).items() if isinstance(value, dict)]


@pytest.mark.parametrize("arguments", [[], ["train"], *(["train", group] for group in GROUPS), ["evaluate"], ["play"]])
def test_a_page_of_help_has_at_most_eighty_lines(tmp_path, arguments):
    command, topic = arguments[:1], arguments[1:]
    code, out, err = relm_irl(tmp_path, *command, "--help", *topic)
    assert (code, err) == (0, "")
    assert 5 < out.count("\n") <= 80


def test_help_of_train_names_every_setting_once(tmp_path):
    _, first, _ = relm_irl(tmp_path, "train", "--help")
    _, whole, _ = relm_irl(tmp_path, "train", "--help", "all")
    for group, settings in config_to_dict(Config()).items():
        if not isinstance(settings, dict):
            assert f"--{group} " in first
            continue
        _, own, _ = relm_irl(tmp_path, "train", "--help", group)
        assert f"\n  {group} " in first
        for setting in settings:
            option = f"--{group}.{setting}".replace("_", "-")
            assert option in own
            assert option in whole


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["trian"], "there is no command trian; did you mean train?"),
        (["train", "--help", "sciamese"], "there is no group sciamese; give all or one of scene, encoder"),
        (["train", "--siamese.workres", "3"], "--siamese.workers INT"),
        (["evaluate", "x", "--polcy", "y"], "--policy"),
    ],
)
def test_what_is_misspelt_is_suggested(tmp_path, arguments, said):
    code, _, err = relm_irl(tmp_path, *arguments)
    assert code == 2
    assert said in err


# In a process of its own, since this one has loaded everything.
def test_help_loads_nothing_slow(tmp_path):
    program = """
import sys
sys.argv = ["relm-irl"]
from relm_irl_jax.cli import main
for arguments in (["train"], ["evaluate"], ["scenes"]):
    sys.argv = ["relm-irl", *arguments, "--help"]
    try:
        main()
    except SystemExit:
        pass
slow = {"jax", "jaxtyping", "numpy", "scipy", "sklearn", "matplotlib", "h5py", "cvxpy", "flax"} & set(sys.modules)
print(sorted(slow), file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert done.stderr == "[]\n"
