"""Configurations: files, refusals, and what trained agents depend on."""

from dataclasses import replace
from pathlib import Path

import pytest

from relm_irl_jax.config import Config, config_from_dict, config_to_dict, fingerprint, load_config
from relm_irl_jax.errors import InputError

EXPERIMENTS = sorted((Path(__file__).parents[1] / "experiments").glob("*.toml"))


def test_record_and_back():
    config = Config(task="III", methods=("rl", "irl"), frames=7)
    assert config_from_dict(config_to_dict(config), "memory") == config


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_every_experiment_loads(path):
    assert load_config(path) != Config()


def test_there_are_experiments():
    assert EXPERIMENTS


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("frames = 0", r"c\.toml: frames = 0 is refused: input should be greater than 0"),
        ('task = "IV"', r"c\.toml: task = 'IV' is refused"),
        ("[siamese]\nworkres = 3", r"c\.toml: unknown field `siamese\.workres`; did you mean `siamese\.workers`\?"),
        (
            "[irl.max_margin]\nx = 3\n[siamese]\nwidth = 0",
            r"unknown field `irl\.max_margin\.x`; known fields: form, .*",
        ),
        ("frames = 0\nworkres = 3", r"c\.toml: unknown field `workres`; known fields: task, methods, .*"),
        ("[anything.at.all]\nx = 1", r"c\.toml: unknown field `anything`; known fields: task, .*"),
        ("siamese = 3", r"c\.toml: `siamese` is a group of fields; write `siamese\.FIELD`"),
        ("irl.max_margin = 3", r"c\.toml: `irl\.max_margin` is a group of fields; write `irl\.max_margin\.FIELD`"),
        ("frames.x = 3", r"c\.toml: frames = {'x': 3} is refused: input should be a valid integer"),
        ("frames = = 3", r"c\.toml: is not valid TOML"),
    ],
)
def test_refusals_name_file_and_field(tmp_path, text, message):
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(InputError, match=message) as refusal:
        load_config(tmp_path / "c.toml")
    assert "\n" not in str(refusal.value)


def test_a_json_file_without_fields_is_refused(tmp_path):
    (tmp_path / "c.json").write_text("[1, 2]")
    with pytest.raises(InputError, match=r"c\.json: must contain an object of fields"):
        load_config(tmp_path / "c.json")


def test_a_file_that_names_one_field_of_a_group_leaves_its_neighbours(tmp_path):
    (tmp_path / "c.toml").write_text('[irl.max_margin]\nvariant = "lp-l1"')
    program = load_config(tmp_path / "c.toml").irl.max_margin
    assert program == replace(Config().irl.max_margin, variant="lp-l1")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"absent\.toml: cannot be read"):
        load_config(tmp_path / "absent.toml")


def test_agents_do_not_depend_on_task_methods_seeds_or_evaluation():
    config = Config()
    other = replace(config, task="I", methods=("rl",), seeds=5, run=Path("x"))
    assert fingerprint(config) == fingerprint(other)
    assert fingerprint(config) != fingerprint(replace(config, frames=5))
    assert fingerprint(config) != fingerprint(replace(config, siamese=replace(config.siamese, width=8)))


def test_methods_come_in_the_order_of_the_tables():
    assert Config(methods=("relm-irl", "random")).chosen_methods() == ("random", "relm-irl")
    assert len(Config().chosen_methods()) == 5


def test_defaults_that_depend_on_the_scenes_are_resolved():
    rooms, folder = Config().resolved(), Config(scenes="some/folder").resolved()
    assert (rooms.encoder.weights, rooms.map.weights) == ("rooms", "package")
    assert (folder.encoder.weights, folder.map.weights) == ("auto", "train")
    assert rooms.resolved() == rooms
