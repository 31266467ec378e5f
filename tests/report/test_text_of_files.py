"""Text of files is text in the report: no markup, link or picture. No figure that fails costs the report."""

import json
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from matplotlib.figure import Figure
from PIL import Image
from rich.console import Console
from run_folders import CONFIG, draw_nothing, episode, results, state_map, write_run

from relm_irl_jax.files import write_json
from relm_irl_jax.report import run_figures
from relm_irl_jax.report.figures import bar_figure, save_figure
from relm_irl_jax.report.html import render_page
from relm_irl_jax.report.intervals import mean_interval
from relm_irl_jax.report.names import as_code, as_message, as_text
from relm_irl_jax.report.run_report import write_report
from relm_irl_jax.report.tables import console_table
from relm_irl_jax.results import save_results
from relm_irl_jax.saved_episodes import save_episodes
from relm_irl_jax.saved_maps import save_map

FUZZ = settings(max_examples=100, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
MARKDOWN = MarkdownIt("gfm-like", {"linkify": False})
ALPHABET = st.sampled_from("ab1 _*`[]()<>!|&~$\\#+-=:/.@\n\t{}\"'") | st.characters(codec="utf-8")
ATTACKS = (
    "![x](http://example.org/a.png)",
    "[x](http://example.org)",
    "<img src=x onerror=alert(1)>",
    "http://example.org www.example.org a@example.org",
    "**bold** _em_ `code` ~~no~~",
    "a | b\n\n# heading\n\n```\nfence",
    "$x^{$ $\\frac$",
    "[red]red[/nothing]",
    "![x](../../../../etc/hostname)",
)


def plain(markdown: str) -> str:
    """The text of a paragraph; fails if it has anything else."""
    tokens = MARKDOWN.parse(f"before {markdown} after")
    assert [token.type for token in tokens] == ["paragraph_open", "inline", "paragraph_close"]
    children = tokens[1].children
    assert {child.type for child in children} <= {"text", "text_special"}, children
    return "".join(child.content for child in children).removeprefix("before ").removesuffix(" after")


@FUZZ
@given(st.text(ALPHABET, max_size=30) | st.sampled_from(ATTACKS))
def test_text_is_shown_as_it_is(value):
    shown = "".join(character if character.isprintable() else " " for character in value)
    assert plain(as_text(value)) == shown
    cell = MARKDOWN.parse(f"| a | b |\n|---|---|\n| {as_text(value)} | 1 |")
    assert [token.type for token in cell].count("td_open") == 2


@FUZZ
@given(st.text(ALPHABET, max_size=30) | st.sampled_from(ATTACKS))
def test_code_and_messages_hold_nothing_else(value):
    (inline,) = [token for token in MARKDOWN.parse(f"at {as_code(value)}, after") if token.type == "inline"]
    assert [child.type for child in inline.children] in (["text", "code_inline", "text"],)
    (inline,) = [token for token in MARKDOWN.parse(f"at {as_message(value)}, after") if token.type == "inline"]
    assert {child.type for child in inline.children} <= {"text", "text_special", "code_inline"}


def attacked(folder, attack):
    """The run folder with an attack in every text that one of its files holds."""
    first = results("II", {"random": [0.1], "rl": [0.3], "relm-irl": [0.5]})
    rows = tuple(
        replace(row, scene=attack, room_type=attack if row.room_type == "bedroom" else row.room_type,
                method=attack if row.method == "random" else row.method) for row in first.rows
    )  # fmt: skip
    save_results(folder, replace(first, encoder=attack, rows=rows))
    poses = replace(episode().poses, name=attack, room_type=attack)
    save_episodes(folder.episodes("II"), [replace(episode(), category=attack, poses=poses, method=attack)])
    save_map(folder.reward_map("new", "bathroom"), replace(state_map(["rl", attack], start=0), category=attack))
    texts = {"scenes": attack, "agent": attack, "encoder": {"weights": attack}}
    write_json(folder.config, CONFIG | texts)
    computer = json.loads(folder.hardware.read_text())["hardware"]
    computer |= {"processor": attack, "devices": [attack], "packages": {attack: attack}}
    write_json(folder.hardware, {"hardware": computer, "seconds": {attack: 1.0}, "earlier": [computer]})


def test_a_report_of_attacks_has_no_markup_of_theirs(tmp_path, monkeypatch):
    draw_nothing(monkeypatch)
    for number, attack in enumerate(ATTACKS[::2]):
        folder = write_run(tmp_path / str(number), {"random": [0.1], "rl": [0.3]}, tasks=("II",))
        attacked(folder, attack)
        path = write_report(folder)
        tokens = MARKDOWN.parse(path.read_text())
        inside = [child for token in tokens for child in token.children or ()]
        links = [child for child in inside if child.type in ("link_open", "html_inline", "s_open")]
        assert not links, attack
        assert all(str(c.attrs["src"]).startswith("figures/") for c in inside if c.type == "image"), attack
        headings = [t for t in tokens if t.type == "heading_open"]
        assert len(headings) == len([line for line in path.read_text().splitlines() if line.startswith("#")])
        assert [token.type for token in tokens].count("fence") == 1
        page = (folder.path / "report.html").read_text()
        assert page.count("<img") == page.count('src="data:image/png;base64,')
        assert "<a " not in page
        assert "onerror=alert(1)>" not in page


def test_the_terminal_shows_names_as_they_are(tmp_path):
    console = Console(markup=False, emoji=False, record=True, width=400, file=open("/dev/null", "w"))  # noqa: SIM115
    made = results("II", {"[bold]x[/nothing]": [0.5]})
    console.print(console_table(made))
    assert "[bold]x[/nothing]" in console.export_text()


@pytest.mark.parametrize("attack", ATTACKS)
def test_a_name_in_a_figure_is_no_formula(tmp_path, attack):
    figure = bar_figure({attack: [mean_interval([1.0])]}, [attack], attack)
    figure.suptitle(attack)
    save_figure(figure, tmp_path / "f.png", {})
    assert (tmp_path / "f.png").stat().st_size > 0


def test_a_figure_that_cannot_be_drawn_costs_one_line(tmp_path, monkeypatch):
    folder = write_run(tmp_path, {"rl": [0.3], "elm-irl": [0.2], "relm-irl": [0.8]}, tasks=("II", "III"))
    broken = []

    def fail(figure, path, table):
        broken.append(path.stem)
        raise [ValueError("x\ny"), OSError(28, "No space left on device"), MemoryError()][len(broken) % 3]

    monkeypatch.setattr(run_figures, "save_figure", fail)
    text = write_report(folder).read_text()
    for name in broken:
        assert sum(f"figure {name}: cannot be drawn" in line for line in text.splitlines()) == 1
    assert len(broken) >= 8
    assert "![" not in text
    assert "## Task III" in text


@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n", b"GIF89a", b"\x00" * 50])
def test_a_damaged_picture_never_costs_the_page(tmp_path, content):
    whole = tmp_path / "whole.png"
    Image.new("RGB", (40, 40)).save(whole)
    (tmp_path / "outside.png").write_bytes(whole.read_bytes())
    (tmp_path / "run").mkdir()
    for damaged in (content, whole.read_bytes()[:60] + content, whole.read_bytes().replace(b"IHDR", b"IHDX")):
        (tmp_path / "run" / "a.png").write_bytes(damaged)
        page = render_page(
            "# t\n\n![x](a.png)\n\nafter\n\n![y](../outside.png)\n\n![z](http://a/b.png)\n", tmp_path / "run"
        )
        assert "<p>after</p>" in page
        assert "outside.png cannot be read" in page
        assert page.count("<img") <= 1


def test_an_empty_figure_is_saved(tmp_path):
    save_figure(Figure(), tmp_path / "f.png", {})
