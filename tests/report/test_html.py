"""The page that needs no other file."""

import base64

from matplotlib.figure import Figure

from relm_irl_jax.report.figures import FIGURE_DPI, save_figure
from relm_irl_jax.report.html import LONG_NAME, SCREEN_DPI, render_page

TABLE = "| name | value |\n|---|---:|\n| {name} | **1** |\n"


def test_pictures_lie_in_the_page(tmp_path):
    save_figure(Figure(figsize=(4, 1)), tmp_path / "wide.png", {})
    save_figure(Figure(figsize=(1, 1)), tmp_path / "square.png", {})
    page = render_page('# A & B\n\n![a "wide" one](wide.png)\n\n*caption*\n\n![square](square.png)\n', tmp_path)
    assert "<title>A &amp; B</title>" in page
    data = base64.b64encode((tmp_path / "wide.png").read_bytes()).decode()
    width = 4 * FIGURE_DPI * SCREEN_DPI // FIGURE_DPI
    image = (
        f'<figure class="wide"><img width="{width}" src="data:image/png;base64,{data}" alt="a &quot;wide&quot; one">'
    )
    assert image in page
    assert page.count("<figure") == page.count("</figure>") == 2
    assert "<p><figure" not in page
    assert "<p><em>caption</em></p>" in page


def test_a_picture_that_cannot_be_read_costs_one_line(tmp_path):
    (tmp_path / "broken.png").write_bytes(b"no picture")
    page = render_page("# t\n\n![x](broken.png)\n\n![y](absent.png)\n\nafter\n", tmp_path)
    assert "<p>broken.png cannot be read and is not shown.</p>" in page
    assert "<p>absent.png cannot be read and is not shown.</p>" in page
    assert "<p>after</p>" in page


def test_tables_scroll_and_long_names_are_broken(tmp_path):
    short, long = (render_page("# t\n\n" + TABLE.format(name=name), tmp_path) for name in ("x", "x" * (LONG_NAME + 1)))
    assert '<div class="table"><table>' in short
    assert '<div class="table described"><table>' in long
    assert short.count("</table></div>") == 1
    assert '<td style="text-align:right"><strong>1</strong></td>' in short


def test_markup_in_names_stays_text(tmp_path):
    assert "<script>" not in render_page("# t\n\n<script>alert(1)</script>\n\n" + TABLE.format(name="<b>"), tmp_path)
