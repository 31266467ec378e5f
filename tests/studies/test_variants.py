"""The paper's presets, the ablation's variants, and its table on results that lie in the folder."""

from dataclasses import replace
from pathlib import Path

import pytest
from run_folders import draw_nothing, write_run

from relm_irl_jax.config import Config, config_to_dict, load_config, read_fields, trained_part
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import write_bytes, write_json, write_table
from relm_irl_jax.results import TASKS, ResultRow, Results, RewardQualityRow, save_results, save_reward_quality
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.studies.ablation import (
    BASE,
    Ablation,
    Variant,
    ablation_columns,
    ablation_rows,
    ablation_table,
    load_ablation,
    run_ablation,
    variant_config,
)
from relm_irl_jax.studies.page import RUN_TITLES, write_study
from relm_irl_jax.studies.rooms_figure import counts_of_rooms, rooms_figure, unseen_by_rooms
from relm_irl_jax.studies.study import is_finished, load_preset

PRESETS = Path(__file__).parents[2] / "experiments" / "paper"
SMALL = Ablation(
    {"methods": ["relm-irl"], "seeds": 2, "evaluation": {"episodes": 10}},
    {"wide": Variant("wider", {"siamese": {"width": 8}}, ("siamese",))},
    {"siamese": {"frames": 70}},
)


@pytest.mark.parametrize("name", RUN_TITLES)
def test_the_tables_are_of_all_methods_and_several_seeds(name):
    config = load_preset(PRESETS / f"{name}.toml")
    agent = "siamese" if name.startswith("siamese") else "metric"
    seeds = 3 if name in ("vizdoom", "siamese-rooms", "metric-reward-alone") else 5
    assert (config.agent, config.seeds, config.evaluation.episodes) == (agent, seeds, 1000)
    assert len(config.chosen_methods()) == {
        "siamese": 6,
        "siamese-long": 6,
        "siamese-rooms": 6,
        "siamese-told": 4,
        "siamese-resnet50": 6,
        "metric-no-hindsight": 2,
        "metric-reward-alone": 4,
    }.get(name, 5)
    quick = load_preset(PRESETS / f"{name}.toml", [PRESETS / "quick.toml"])
    assert (quick.agent, quick.scene.size) == (agent, "tiny")


def test_every_variant_changes_its_base():
    ablation = load_ablation(PRESETS / "ablation.toml")
    assert {p.name for p in PRESETS.iterdir()} == {
        *(f"{name}.toml" for name in RUN_TITLES),
        "quick.toml",
        "ablation.toml",
        "irl-methods.toml",
        "many-rooms.toml",
        "map.toml",
        "map-vizdoom.toml",
        "regularisation.toml",
        "unseen.toml",
    }
    for changes in ({}, read_fields(PRESETS / "quick.toml")):
        base = variant_config(ablation, BASE, "siamese", changes, Path("x"))
        for name, variant in ablation.variants.items():
            config = variant_config(ablation, name, "siamese", changes, Path("x"))
            same = replace(config, run=base.run) == base
            assert not same or not variant.quick, name
            assert not same or changes, name
            assert config.run == Path("x") / f"siamese-{name}"


def test_many_rooms_are_apart_from_those_evaluated_on():
    many = load_ablation(PRESETS / "many-rooms.toml")
    for name in (BASE, *many.variants):
        for agent in ("siamese", "recurrent", "savn"):
            config = variant_config(many, name, agent, {}, Path("x"))
            scene = config.scene
            trained = set(range(scene.first_room, scene.first_room + scene.training_per_type))
            assert not trained & set(range(2, 5)), name
            assert scene.first_unseen == 2 or (scene.first_room, scene.training_per_type) == (0, 2)
            assert config.tasks.training_targets == 10 * 3 * scene.training_per_type
            source = many.variants[name].trained_by if name != BASE else ""
            if source:
                same = trained_part(variant_config(many, source, agent, {}, Path("x")))
                assert trained_part(config) == same, name


def test_a_variant_may_evaluate_the_agents_of_another(tmp_path, monkeypatch):
    """Which train once: their weights are copied before the other's run, wherever it stands in the list."""
    ablation = replace(
        SMALL,
        variants={
            "greedy": Variant(
                "greedy", {"evaluation": {"policy": "greedy"}, "siamese": {"width": 8}}, ("siamese",), trained_by="wide"
            ),
            "wide": SMALL.variants["wide"],
        },
    )
    completed = []

    def complete(config, *, tasks, maps):
        weights = RunFolder(config.run).agent("relm-irl", 0)
        if config.run.name == "siamese-greedy":  # a folder that is not empty is a run only with its configuration
            assert load_config(RunFolder(config.run).config) == config.resolved()
        completed.append((config.run.name, weights.read_text() if weights.exists() else "trained"))
        write_bytes(weights, config.run.name.encode())
        write_bytes(RunFolder(config.run).curve("relm-irl", 0), b"")

    monkeypatch.setattr("relm_irl_jax.studies.ablation.complete_run", complete)
    run_ablation(ablation, ["greedy", "wide"], {}, tmp_path)
    assert completed == [
        ("siamese-base", "trained"),
        ("siamese-wide", "trained"),
        ("siamese-greedy", "siamese-wide"),
    ]
    differing = replace(ablation.variants["greedy"], trained_by=BASE)
    with pytest.raises(InputError, match=r"siamese-greedy: differs from .*siamese-base in more than its evaluation"):
        run_ablation(replace(ablation, variants={"greedy": differing}), ["greedy"], {}, tmp_path)


def test_agents_of_another_variant_are_evaluated_again_in_other_settings(tmp_path, monkeypatch):
    """The folder names the new settings before their results are there."""

    def evaluating(policy: str) -> Ablation:
        changes = {"evaluation": {"policy": policy}}
        return replace(SMALL, variants={"again": Variant("again", changes, ("siamese",), trained_by=BASE)})

    source = RunFolder(tmp_path / "siamese-base")
    leave_results(variant_config(SMALL, BASE, "siamese", {}, tmp_path), [0.1, 0.5])
    for path in (source.agent("rl", 0), source.curve("rl", 0)):
        write_bytes(path, b"")
    leave_results(variant_config(evaluating("greedy"), "again", "siamese", {}, tmp_path).resolved(), [0.1, 0.5])
    completed = []

    def complete(config, *, tasks, maps):
        completed.append((config.run.name, is_finished(config, tasks)))

    monkeypatch.setattr("relm_irl_jax.studies.ablation.complete_run", complete)
    run_ablation(evaluating("greedy"), ["again"], {}, tmp_path)
    run_ablation(evaluating("sample"), ["again"], {}, tmp_path)
    base = ("siamese-base", True)
    assert completed == [base, ("siamese-again", True), base, ("siamese-again", False)]


def test_faults_are_named(tmp_path):
    (tmp_path / "a.toml").write_text("[base]\n[variants.x]\ntitle = 't'\nset.elm.colour = 3\n")
    with pytest.raises(InputError, match=r"variants\.x\.set: unknown field `elm\.colour`"):
        load_ablation(tmp_path / "a.toml")
    with pytest.raises(InputError, match="there is no narrow; known variants: wide"):
        variant_config(SMALL, "narrow", "siamese", {}, tmp_path)


def leave_results(config: Config, values: list[float]) -> None:
    """A finished run as the pipeline leaves it, its metrics made up."""
    assert config.run is not None
    folder = RunFolder(config.run)
    write_json(folder.config, config_to_dict(config))
    (config.run / "report.html").write_text("")
    for seed in range(len(values)):
        rows = [
            RewardQualityRow(method, targets, rank, median_rank_share=0.1, mean_order=0.5)
            for method, targets, rank in (
                ("elm-irl", "new", 30),
                ("relm-irl", "trained", 1),
                ("relm-irl", "new", 2 + seed),
            )
        ]
        save_reward_quality(folder.rewards(seed, "quality.csv"), rows)
    for task in TASKS:
        rows = [
            ResultRow(method=method, agent="siamese", scene="bathroom-0", room_type="bathroom", seed=seed,
                      episodes=10, sr=share * value, spl=share * value / 2, ple=1.0)
            for method, share in (("relm-irl", 1.0), ("elm-irl", 0.5))
            for seed, value in enumerate(values)
        ]  # fmt: skip
        save_results(folder, Results(task, 9, "none", tuple(rows)))


def test_the_table_pairs_finished_runs_with_the_base(tmp_path):
    base, wide = (variant_config(SMALL, name, "siamese", {}, tmp_path / "ablation") for name in (BASE, "wide"))
    assert ablation_rows(SMALL, {}, tmp_path / "ablation") == []
    leave_results(wide, [0.2, 0.6])
    (alone,) = ablation_rows(SMALL, {}, tmp_path / "ablation")
    assert (alone.name, alone.change) == ("wide", {})
    assert "| wider | 2.5 ± 6.4 | 0.40 ± 2.54 |  |" in ablation_table([alone], "sr")
    leave_results(base, [0.1, 0.5])
    lines = ablation_rows(SMALL, {}, tmp_path / "ablation")
    assert [(line.name, line.frames) for line in lines] == [(BASE, 70), ("wide", 70)]
    change = lines[1].change["II", "sr"]
    assert (change.mean, change.half_width) == (pytest.approx(0.1), pytest.approx(0.0, abs=1e-12))
    assert lines[1].rank.mean == 2.5
    assert "| wider | 2.5 ± 6.4 | 0.40 ± 2.54 | **+0.100 ± 0.000** |" in ablation_table(lines, "sr")
    assert len(ablation_columns(lines)["agent"]) == 2 * 3 * 2
    other = replace(SMALL, variants={"wide": replace(SMALL.variants["wide"], method="elm-irl")})
    shown = ablation_rows(other, {}, tmp_path / "ablation")[1]
    assert shown.value["II", "sr"].mean == pytest.approx(0.2)
    assert shown.change["II", "sr"].mean == pytest.approx(-0.1)
    assert shown.rank.mean == 30
    page = write_study(tmp_path, {"ablation": lines}).with_suffix(".html").read_text()
    assert "wider" in page


def test_success_over_the_number_of_training_rooms_is_drawn_for_each_agent(tmp_path):
    many = Variant("many rooms", {"scene": {"training_per_type": 20}}, ("siamese",))
    few = replace(SMALL, variants={"many": many, "other": replace(many, line=", another line")})
    for name, values in ((BASE, [0.1, 0.3]), ("many", [0.5, 0.7]), ("other", [0.2, 0.4])):
        leave_results(variant_config(few, name, "siamese", {}, tmp_path / "many-rooms"), values)
    rows = ablation_rows(few, {}, tmp_path / "many-rooms")
    expected = [(6, "siamese"), (60, "siamese"), (60, "siamese, another line")]
    assert [(row.rooms, row.line) for row in rows] == expected
    success_rate, spl = rooms_figure(unseen_by_rooms(ablation_columns(rows))).axes
    points = [container.lines[0].get_xydata().tolist() for container in success_rate.containers]
    assert points == [[[6, pytest.approx(0.2)], [60, pytest.approx(0.6)]], [[60, pytest.approx(0.3)]]]
    assert spl.get_ylabel() == "SPL in unseen rooms"
    assert [text.get_text() for text in spl.get_xticklabels()] == ["6", "60"]
    assert counts_of_rooms({"a": {200: {}, 6: {}}, "b": {201: {}, 600: {}}}) == [[6], [200, 201], [600]]
    text = write_study(tmp_path, {"many-rooms": rows}).read_text()
    assert "![Success in unseen rooms against the number of training rooms](rooms.png)" in text
    assert (tmp_path / "tables" / "many-rooms.csv").exists()


def test_a_run_is_finished_only_in_the_settings_asked_for(tmp_path):
    config = variant_config(SMALL, BASE, "siamese", {}, tmp_path)
    assert not is_finished(config)
    leave_results(config, [0.1, 0.5])
    assert is_finished(config)
    assert not is_finished(replace(config, seeds=3))
    assert not is_finished(replace(config, frames=5))
    assert not is_finished(replace(config, evaluation=replace(config.evaluation, policy="greedy")))
    assert not is_finished(replace(config, methods=("rl", "relm-irl")))
    # A run records what it resolved: frames and encoder that the configuration leaves open.
    unresolved = replace(config, frames=None, run=tmp_path / "unresolved")
    leave_results(unresolved.resolved(), [0.1, 0.5])
    assert is_finished(unresolved)
    (tmp_path / "siamese-base" / "results-II.json").unlink()
    assert not is_finished(config)


def test_the_page_shows_what_it_can_read(tmp_path, monkeypatch):
    """One whole run, one without a configuration, figures of the regressor whose table is damaged."""
    draw_nothing(monkeypatch)
    write_run(tmp_path / "siamese", {"rl": [0.1, 0.2], "relm-irl": [0.8, 0.9]}, tasks=("I",))
    write_run(tmp_path / "metric", {"rl": [0.1]}, tasks=("I",)).config.unlink()
    write_table(tmp_path / "elm" / "choices.csv", {"choice": ["all"]})
    write_table(tmp_path / "stability" / "stability.csv", {"form": ["cost"], "variant": ["lp"], "start_median": [0.4]})
    path = write_study(tmp_path, {})
    text, page = path.read_text(), path.with_suffix(".html").read_text()
    for said in (
        "Of 2 comparisons of RELM-IRL with other methods (SR and SPL of each task, 2 seeds), it is ahead in 2",
        "metric/config.json cannot be read",
        "accuracy.csv is missing",
        "| cost | lp | 0.4 |",
        "![Learning curves](siamese/figures/learning.png)",
    ):
        assert said in text
    assert page.count("data:image/png;base64,") == 6


def test_the_page_shows_the_regressors_figures(tmp_path):
    elm = tmp_path / "elm"
    measured = {"accuracy": 0.5, "accuracy_in_unseen_scenes": -0.75, "kept": 1950.0}
    choice = {name: [value] for name, value in measured.items()} | {f"{name}_half_width": [0.25] for name in measured}
    write_table(elm / "choices.csv", {"choice": ["all"], **choice})
    write_table(elm / "accuracy.csv", {"seed": [0], "elm_r2": [-9.0], "relm_r2": [0.25], "kept": [825]})
    write_json(elm / "settings.json", {"sizes": [1], "config": {"elm": {"hidden": 77}}})
    text = write_study(tmp_path, {}).read_text()
    for said in (
        "77 neurons before selection; 1 seeds",
        "| 0 | -9.000 | 0.250 | 825 |",
        "| all | 0.50 ± 0.25 | -0.75 ± 0.25 | 1,950 ± 0 |",
    ):
        assert said in text
