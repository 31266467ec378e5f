"""The paper's presets, the ablation's variants, and its table on results that lie in the folder."""

from dataclasses import replace
from pathlib import Path

import pytest
from relm_irl_jax.runs import RunFolder, write_json, write_table

from relm_irl_jax.config import Config, config_to_dict, read_fields
from relm_irl_jax.errors import InputError
from relm_irl_jax.studies.ablation import (
    BASE,
    Ablation,
    Variant,
    ablation_columns,
    ablation_table,
    configure,
    load_ablation,
    measure,
)
from relm_irl_jax.studies.page import RUN_TITLES, write_study
from relm_irl_jax.studies.study import TASKS, finished, preset

PRESETS = Path(__file__).parents[2] / "experiments" / "paper"
SMALL = Ablation(
    {"methods": ["relm-irl"], "seeds": 2, "evaluation": {"episodes": 10}},
    {"wide": Variant("wider", {"siamese": {"width": 8}}, ("siamese",))},
    {"siamese": {"frames": 70}},
)


@pytest.mark.parametrize("name", RUN_TITLES)
def test_the_tables_are_of_all_methods_and_five_seeds(name):
    config = preset(PRESETS / f"{name}.toml")
    agent = "siamese" if name == "siamese" else "metric"
    assert (config.agent, config.seeds, config.evaluation.episodes) == (agent, 5, 1000)
    assert len(config.chosen_methods()) == 5
    quick = preset(PRESETS / f"{name}.toml", [PRESETS / "quick.toml"])
    assert (quick.agent, quick.scene.size) == (agent, "tiny")


def test_every_variant_changes_its_base():
    ablation = load_ablation(PRESETS / "ablation.toml")
    assert {p.name for p in PRESETS.iterdir()} == {
        *(f"{name}.toml" for name in RUN_TITLES),
        "quick.toml",
        "ablation.toml",
    }
    for changes in ({}, read_fields(PRESETS / "quick.toml")):
        base = configure(ablation, BASE, "siamese", changes, Path("x"))
        for name, variant in ablation.variants.items():
            config = configure(ablation, name, "siamese", changes, Path("x"))
            same = replace(config, run=base.run) == base
            assert not same or not variant.quick, name
            assert not same or changes, name
            assert config.run == Path("x") / f"siamese-{name}"


def test_faults_are_named(tmp_path):
    (tmp_path / "a.toml").write_text("[base]\n[variants.x]\ntitle = 't'\nset.elm.colour = 3\n")
    with pytest.raises(InputError, match=r"variants\.x\.set: unknown field `elm\.colour`"):
        load_ablation(tmp_path / "a.toml")
    with pytest.raises(InputError, match="there is no narrow; known are wide"):
        configure(SMALL, "narrow", "siamese", {}, tmp_path)


def leave_results(config: Config, values: list[float]) -> None:
    """A finished run as the pipeline leaves it, its metrics made up."""
    assert config.run is not None
    write_json(config.run / "config.json", config_to_dict(config))
    (config.run / "report.html").write_text("")
    for seed, _ in enumerate(values):
        quality = {"method": ["elm-irl", "relm-irl", "relm-irl"], "targets": ["new", "trained", "new"]}
        ranks = {"median_rank": [30, 1, 2 + seed]}
        write_table(RunFolder(config.run).rewards(seed, "quality.csv"), quality | ranks)
    for task in TASKS:
        rows = [
            {"method": "relm-irl", "scene": "bathroom-0", "room_type": "bathroom", "seed": seed, "episodes": 10}
            | {"sr": value, "spl": value / 2, "ple": 1.0}
            for seed, value in enumerate(values)
        ]
        write_json(config.run / f"results-{task}.json", {"task": task, "cap": 9, "encoder": "none", "rows": rows})


def test_the_table_pairs_finished_runs_with_the_base(tmp_path):
    base, wide = (configure(SMALL, name, "siamese", {}, tmp_path / "ablation") for name in (BASE, "wide"))
    assert measure(SMALL, {}, tmp_path / "ablation") == []
    leave_results(base, [0.1, 0.5])
    assert [line.name for line in measure(SMALL, {}, tmp_path / "ablation")] == [BASE]
    leave_results(wide, [0.2, 0.6])
    lines = measure(SMALL, {}, tmp_path / "ablation")
    assert [(line.name, line.frames) for line in lines] == [(BASE, 70), ("wide", 70)]
    change = lines[1].change["II", "sr"]
    assert (change.mean, change.half_width) == (pytest.approx(0.1), pytest.approx(0.0, abs=1e-12))
    assert lines[1].rank.mean == 2.5
    assert "| wider | 2.5 ± 6.4 | 0.40 ± 2.54 | **+0.100 ± 0.000** |" in ablation_table(lines, "sr")
    assert len(ablation_columns(lines)["agent"]) == 2 * 3 * 2
    page = write_study(tmp_path, lines).with_suffix(".html").read_text()
    assert "wider" in page


def test_a_run_is_finished_only_in_the_settings_asked_for(tmp_path):
    config = configure(SMALL, BASE, "siamese", {}, tmp_path)
    assert not finished(config)
    leave_results(config, [0.1, 0.5])
    assert finished(config)
    assert not finished(replace(config, seeds=3))
    assert not finished(replace(config, frames=5))
    assert not finished(replace(config, evaluation=replace(config.evaluation, policy="greedy")))
    assert not finished(replace(config, methods=("rl", "relm-irl")))
    (tmp_path / "siamese-base" / "results-II.json").unlink()
    assert not finished(config)
