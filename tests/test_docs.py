"""The documentation: links of pages that are read in the repository, and what the site must hold.

`make docs` builds the site and fails on its broken links; it needs packages that the tests do without.
"""

import re
from dataclasses import asdict
from importlib import import_module
from pathlib import Path

import pytest
import yaml

from relm_irl_jax.config import Config, config_to_dict, overlay
from relm_irl_jax.errors import InputError
from relm_irl_jax.files import columns_of_rows, read_table, write_json, write_table
from relm_irl_jax.hardware import Hardware, StageTimes
from relm_irl_jax.results import ResultRow, Results, results_to_dict

ROOT = Path(__file__).parents[1]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
SITE = yaml.safe_load((ROOT / "mkdocs.yml").read_text())


def pages_of(entry) -> list[str]:
    """Files of an entry of the site's menu."""
    if isinstance(entry, str):
        return [entry]
    return [page for part in (entry.values() if isinstance(entry, dict) else entry) for page in pages_of(part)]


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub and the site name them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        file, _, anchor = link.partition("#")
        if "://" in link:
            continue
        linked = (page.parent / file).resolve() if file else page
        assert linked.exists(), link
        assert not anchor or anchor in anchors(linked), link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_tables_of_results_are_those_of_the_committed_files(page, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "experiments")
    written = import_module("docs_tables").written
    assert written(page.read_text()) == page.read_text(), "make tables writes them"


@pytest.mark.parametrize(
    ("page", "fault"),
    [
        (
            "<!-- table: peers -->\n\n<!-- table: gym -->\n<!-- /table -->\n",
            "table: peers --> has no <!-- /table",
        ),
        ("<!-- table: piers -->\n<!-- /table -->\n", r"table: piers --> is of no known kind \(tasks, "),
    ],
)
def test_a_table_that_cannot_be_written_is_named(page, fault, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "experiments")
    with pytest.raises(InputError, match=fault):
        import_module("docs_tables").written(page)


def test_the_figure_of_the_claims_shows_the_committed_means_and_the_papers(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "experiments")
    panels = import_module("claims_figure").claims_figure().axes
    drawn = {round(float(line.get_xdata()[0]), 9) for line in panels[1].lines if len(line.get_xdata()) == 1}
    for name, methods in {"siamese-given": 5, "siamese": 6, "siamese-long": 6}.items():
        table = read_table(ROOT / "docs" / "tables" / f"{name}-task-II.csv")
        rows = zip(table["metric"], table["column"], table["mean"], strict=True)
        means = {round(float(mean), 9) for metric, column, mean in rows if (metric, column) == ("sr", "mean")}
        assert len(means) == methods
        assert means <= drawn
    assert {0.51, 0.49, 0.60} <= drawn, "the paper's Table 2"


def test_what_a_study_has_measured_replaces_those_rows_alone(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "experiments")
    merged = import_module("committed_tables").merged
    old = {"agent": ["a", "a", "b"], "variant": ["x", "y", "x"], "mean": ["1", "2", "3"]}
    new = {"agent": ["b", "a", "a"], "variant": ["x", "y", "z"], "mean": ["30", "20", "40"]}
    expected = {"agent": ["a", "a", "a", "b"], "variant": ["x", "y", "z", "x"], "mean": ["1", "20", "40", "30"]}
    assert merged(old, new, ("agent", "variant")) == expected
    assert merged({}, old, ("agent", "variant")) == old
    with pytest.raises(InputError, match="columns agent instead of agent, variant, mean"):
        merged({"agent": ["a"]}, new, ("agent", "variant"))


def test_tables_of_two_cores_and_of_a_gpu_are_kept_apart(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(ROOT / "experiments")
    committed = import_module("committed_tables")
    monkeypatch.setattr(committed, "TABLES", tmp_path)
    monkeypatch.setattr(committed, "ROOT", tmp_path)
    for device in ("cpu", "gpus"):
        run = tmp_path / device / "siamese"
        (run / "tables").mkdir(parents=True)
        hardware = Hardware("a processor", 2, (device,), "a system", "3.11", {})
        write_json(run / "hardware.json", asdict(StageTimes(hardware, {})))
        (run / "tables" / "task-II.csv").write_text(device)
        times = {"piece": ["siamese", "ablation: lp"], "seconds": [len(device), 9]}
        write_table(tmp_path / device / "tables" / "times.csv", times)
        (run / "tables" / "learning.csv").write_text("no table of the pages")
        committed.copy_tables(tmp_path / device)
    assert (tmp_path / "siamese-task-II.csv").read_text() == "cpu"
    assert (tmp_path / "siamese-gpu-task-II.csv").read_text() == "gpus"
    assert read_table(tmp_path / "times.csv") == {"piece": ["siamese"], "seconds": ["3"]}
    assert not list(tmp_path.glob("*learning*"))


def test_agents_of_other_programs_have_a_row_each(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(ROOT / "experiments")
    committed = import_module("committed_tables")
    monkeypatch.setattr(committed, "TABLES", tmp_path)
    rooms = {"scene": "room-0", "seed": 0, "episodes": 1, "ple": 0.0}
    (tmp_path / "examples").mkdir()
    for name, rate in (("dqn", 0.25), ("ppo", 0.5)):
        rows = tuple(
            ResultRow(method=method, room_type=room_type, sr=sr, spl=sr / 2, **rooms)
            for method, rates in (("random", (0.0, 0.25)), (name, (rate, 1.0)))
            for room_type, sr in zip(("bathroom", "bedroom"), rates, strict=True)
        )
        write_json(tmp_path / "examples" / f"{name}.json", results_to_dict(Results("II", 100, "rooms", rows)))
    earlier = {"agent": ["dqn", "mine"], "task": ["II", "I"], "sr": ["0.5", "0.25"], "spl": ["0.5", "0.25"]}
    write_table(tmp_path / "examples.csv", earlier)
    committed.copy_tables(tmp_path / "examples")
    assert read_table(tmp_path / "examples.csv") == {
        "agent": ["dqn", "mine", "random", "ppo"],
        "task": ["II", "I", "II", "II"],
        "sr": ["0.625", "0.25", "0.125", "0.75"],
        "spl": ["0.3125", "0.25", "0.0625", "0.375"],
    }


def test_a_folder_without_tables_of_the_pages_is_refused_and_so_are_tiny_rooms(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(ROOT / "experiments")
    committed = import_module("committed_tables")
    with pytest.raises(InputError, match=r"papr: there is no table of the documentation; give the folder of a study"):
        committed.copy_tables(tmp_path / "papr")
    tiny = overlay(Config(), {"scene": {"size": "tiny"}}, "tiny")
    write_json(tmp_path / "siamese" / "config.json", config_to_dict(tiny))
    with pytest.raises(InputError, match="siamese ran in tiny rooms, whose numbers mean nothing"):
        committed.copy_tables(tmp_path)


def test_changes_from_a_base_that_was_measured_again_are_unknown(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "experiments")
    committed = import_module("committed_tables")

    def table(variants: str, base: str, change: str) -> dict[str, list[str]]:
        rows = [("metric", v, "II", "sr", base if v == "base" else "0.5", change, "0.1") for v in variants.split()]
        names = ("agent", "variant", "task", "metric", "mean", "change", "change_half_width")
        return columns_of_rows(names, rows)

    old = table("base lp ridge", "0.4", "0.1")
    for base, change in (("0.4", "0.1"), ("0.3", "nan")):
        new = table("base lp", base, "0.2")
        merged = committed.merged(old, new, ("agent", "variant"))
        found = committed.without_stale_changes(old, new, merged)
        assert found["variant"] == ["base", "lp", "ridge"]
        assert found["change"] == ["0.2", "0.2", change]


def test_the_menu_names_every_page():
    assert sorted(pages_of(SITE["nav"])) == sorted(
        str(page.relative_to(ROOT / "docs")) for page in PAGES if page.is_relative_to(ROOT / "docs")
    )


@pytest.mark.parametrize(
    "package", ["relm_irl_jax", *(f"relm_irl_jax.{name}" for name in ("scenes", "irl", "elm", "gym"))]
)
def test_the_api_has_every_public_name(package):
    page = ROOT / "docs" / "api" / f"{package.rpartition('.')[2]}.md"
    documented = {name.rpartition(".")[2] for name in re.findall(r"^::: (\S+)", page.read_text(), re.MULTILINE)}
    assert set(import_module(package).__all__) - {"__version__"} - documented == set()
