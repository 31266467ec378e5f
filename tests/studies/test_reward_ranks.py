"""The study of predicted rewards: its variants, and that a tiny one is finished and kept."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import read_table
from relm_irl_jax.results import PREDICTED
from relm_irl_jax.studies.study import load_preset

EXPERIMENTS = Path(__file__).parents[2] / "experiments"


@pytest.fixture
def study(monkeypatch):
    monkeypatch.syspath_prepend(str(EXPERIMENTS))
    return import_module("reward_ranks")


def test_variants_change_the_rewards_alone(study):
    variants = study.reward_variants()
    assert {"base", "lp", "ridge", "phi-16", "strong"} <= set(variants)
    assert not {"current-view", "open", "room-type-heads"} & set(variants)


def test_ranks_of_a_tiny_study_are_kept(study, tmp_path, monkeypatch):
    config = load_preset(EXPERIMENTS / "smoke.toml")
    config = replace(config, elm=replace(config.elm, hidden=20), irl=replace(config.irl, trajectories=2, processes=1))
    settings = study.Study(tmp_path, seeds=2, variants=("base",), config=config)
    table = read_table(study.main(settings))
    assert set(table["variant"]) == {"base"}
    assert set(table["method"]) == {"elm-irl", "relm-irl"}
    assert set(table["targets"]) == {"trained", "new", "uniform", "unseen"}
    assert all(1 <= float(mean) <= 80 for mean in table["mean"])
    monkeypatch.setattr(study, "learn", None)  # what is finished is not learned again
    assert read_table(study.main(settings)) == table
    for changed, fault in (
        ({"variants": ("bsae",)}, "variants: there is no bsae; known variants: base, "),
        ({"seeds": 3}, r"other settings \(seeds\); give another folder"),
    ):
        with pytest.raises(InputError, match=fault):
            study.main(replace(settings, **changed))


@pytest.fixture
def of_one_variant(study, tmp_path, monkeypatch):
    """Runs the study of one variant, every rank 1."""
    rank = dict.fromkeys([(method, targets) for method in PREDICTED for targets in study.TARGETS], 1.0)
    monkeypatch.setattr(study, "ranks", lambda *_: [rank, rank])
    config = load_preset(EXPERIMENTS / "smoke.toml")
    return lambda name: study.main(study.Study(tmp_path, seeds=2, variants=(name,), config=config))


def test_a_table_is_of_all_variants_that_the_folder_holds(of_one_variant):
    of_one_variant("lp")
    assert set(read_table(of_one_variant("base"))["variant"]) == {"base", "lp"}


def test_ranks_of_a_variant_whose_settings_have_changed_are_refused(of_one_variant, study, monkeypatch):
    of_one_variant("strong")
    changed = study.reward_variants() | {"strong": ("changed", {"irl": {"max_margin": {"regularisation": 7.0}}})}
    monkeypatch.setattr(study, "reward_variants", lambda: changed)
    with pytest.raises(InputError, match=r"strong holds results with other settings \(irl\); give another folder"):
        of_one_variant("strong")
