"""Configurations: files, refusals, and what trained agents depend on."""

import re
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import pytest
from command import relm_irl

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


def numeric_fields(settings, prefix=()):
    """Every field of a configuration that holds a number, as path and value; None where the default is no number."""
    for field in fields(settings):
        value, path = getattr(settings, field.name), (*prefix, field.name)
        if is_dataclass(value):
            yield from numeric_fields(value, path)
        elif not isinstance(value, bool) and re.search(r"\b(int|float)\b", str(field.type)):
            yield path, value


NUMBERS = {".".join(path): value for path, value in numeric_fields(Config())}


def test_there_are_numbers():
    assert {"frames", "siamese.learning_rate", "elm.ridge", "manual.step", "irl.max_margin.penalty"} <= set(NUMBERS)
    assert len(NUMBERS) > 45


def test_names_of_unknown_fields_are_text(tmp_path):
    fields = {"metric": {"learning\n_rate": 1.0}, "\x1b[31mred\u2028": {}}
    for name, value in fields.items():
        with pytest.raises(InputError, match="unknown field") as refusal:
            config_from_dict({name: value}, "c.json")
        assert str(refusal.value).isprintable()


def test_options_without_a_value_are_refused(tmp_path):
    for option in ("--methods", "--frames", "--elm.hidden"):
        code, _, said = relm_irl(tmp_path, "train", option)
        assert code == 2
        assert option.removeprefix("--") in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", NUMBERS)
def test_every_number_is_finite_and_bounded_on_both_sides(name):
    for value in (float("nan"), float("inf"), -float("inf"), 1e30, -1e30, 10**16, -(10**16), True):
        nested = value
        for key in reversed(name.split(".")):
            nested = {key: nested}
        with pytest.raises(InputError, match=rf"c\.json: {name}"):
            config_from_dict(nested, "c.json")


def test_defaults_that_depend_on_the_scenes_are_resolved():
    rooms, folder = Config().resolved(), Config(scenes="some/folder").resolved()
    assert (rooms.encoder.weights, rooms.map.weights) == ("rooms", "package")
    assert (folder.encoder.weights, folder.map.weights) == ("auto", "train")
    assert rooms.resolved() == rooms
