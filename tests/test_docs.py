"""The documentation: links of pages that are read in the repository, and what the site must hold.

`make docs` builds the site and fails on its broken links; it needs packages that the tests do without.
"""

import re
from importlib import import_module
from pathlib import Path

import pytest
import yaml

from relm_irl_jax.errors import InputError

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


def test_what_a_study_has_measured_replaces_those_rows_alone(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "experiments")
    merged = import_module("docs_tables").merged
    old = {"agent": ["a", "a", "b"], "variant": ["x", "y", "x"], "mean": ["1", "2", "3"]}
    new = {"agent": ["b", "a", "a"], "variant": ["x", "y", "z"], "mean": ["30", "20", "40"]}
    expected = {"agent": ["a", "a", "a", "b"], "variant": ["x", "y", "z", "x"], "mean": ["1", "20", "40", "30"]}
    assert merged(old, new, ("agent", "variant")) == expected
    assert merged({}, old, ("agent", "variant")) == old
    with pytest.raises(InputError, match="columns agent instead of agent, variant, mean"):
        merged({"agent": ["a"]}, new, ("agent", "variant"))


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
