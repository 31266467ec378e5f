"""A run folder belongs to one configuration."""

from dataclasses import replace

import pytest

from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.rewards.settings import IrlSettings
from relm_irl_jax.run_config import find_run, open_run, run_path


def test_a_run_is_found_again_and_held_to_what_it_trained(tmp_path):
    config = Config(run=tmp_path / "run", frames=10)
    folder = open_run(config)
    assert find_run(tmp_path / "run") == (folder, config)
    assert open_run(replace(config, seeds=3)) == folder
    assert find_run(tmp_path / "run")[1].seeds == 3
    with pytest.raises(InputError, match="contains agents trained with frames = 10, not 11"):
        open_run(replace(config, frames=11))


def test_other_folders_are_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file; give a folder"):
        open_run(Config(run=tmp_path / "file"))
    with pytest.raises(InputError, match=r"is not empty and contains no config\.json"):
        open_run(Config(run=tmp_path))
    with pytest.raises(InputError, match=r"contains no config\.json"):
        find_run(tmp_path)


def test_a_run_goes_on_with_the_demonstrations_that_it_began_with(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    walks = tmp_path / "walks.jsonl"
    walks.write_text("first\n")
    config = Config(irl=IrlSettings(demonstrations=walks))
    before = run_path(config)
    folder = open_run(replace(config, run=tmp_path / "run"))
    open_run(replace(config, run=folder.path))
    walks.write_text("second\n")
    assert run_path(config) != before  # a run without a folder of its own begins anew
    with pytest.raises(InputError, match=r"walks\.jsonl is not the file that the rewards in .*run were learned from"):
        open_run(replace(config, run=folder.path))
    walks.unlink()
    with pytest.raises(InputError, match=r"walks\.jsonl: no such file"):
        open_run(replace(config, run=folder.path))
    walks.write_text("first\n")
    open_run(replace(config, run=folder.path))
