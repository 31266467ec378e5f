"""The report as one self-contained page: the Markdown rendered, its pictures inside the file."""

import base64
import html
import re
from pathlib import Path

from markdown_it import MarkdownIt
from PIL import Image

from relm_irl_jax.report.figures import FIGURE_DPI

SCREEN_DPI = 100
"""Dots an inch at which figures are shown, so that their text is about as large as the page's."""

LONG_NAME = 30
"""Letters from which the name of a table's row is broken into lines."""

STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 68rem; margin: 0 auto; padding: 1rem; }
h1, h2 { line-height: 1.2; margin-top: 2rem; }
img { max-width: 100%; height: auto; background: white; border-radius: 4px; }
.table, .wide { overflow-x: auto; }
.table { margin: 1rem 0; }
th { text-align: left; vertical-align: bottom; }
.wide img { min-width: 44rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 0.92em; }
th, td { padding: 0.25rem 0.7rem; border-bottom: 1px solid #8884; white-space: nowrap; }
th:first-child, td:first-child { position: sticky; left: 0; background: Canvas; padding-left: 0; }
.described td:first-child { white-space: normal; min-width: min(12rem, 38vw); }
.described th, .described td { padding-left: 0.35rem; padding-right: 0.35rem; }
thead th { border-bottom: 2px solid #888a; white-space: normal; min-width: 4rem; max-width: 12rem; }
code, pre { font-size: 0.88em; }
pre { overflow: auto; max-height: 24rem; padding: 0.8rem; background: #8881; border-radius: 4px; }
"""


def render_page(text: str, folder: Path) -> str:
    """Render a report written in Markdown.

    Args:
        text: the Markdown; pictures are named relative to the folder.
        folder: where the pictures lie.

    Returns:
        A whole HTML page that needs no other file.
    """
    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    body = re.sub("<table>.*?</table>", lambda found: _table(found[0]), body, flags=re.DOTALL)
    picture = r'<p><img src="([^"]+)"([^>]*)></p>'
    body = re.sub(picture, lambda found: _picture(folder / found[1], found[2].rstrip(" /")), body)
    title = html.escape(text.splitlines()[0].lstrip("# "))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{STYLE}</style></head>\n<body>\n{body}</body></html>\n"
    )


def _table(table: str) -> str:
    """A table in a box that scrolls by itself; long names of its rows are broken into lines."""
    names = re.findall("<tr>\\s*<td[^>]*>([^<]*)</td>", table)
    shape = "table described" if max(map(len, names), default=0) > LONG_NAME else "table"
    return f'<div class="{shape}">{table}</div>'


def _picture(path: Path, rest: str) -> str:
    """A PNG picture that lies in the page itself; a wide one scrolls within its own box on a narrow screen."""
    with Image.open(path) as picture:
        width, height = picture.size
    content = base64.b64encode(path.read_bytes()).decode()
    shape = "wide" if width > 1.8 * height else "figure"
    shown = round(width * SCREEN_DPI / FIGURE_DPI)
    return f'<div class="{shape}"><img width="{shown}" src="data:image/png;base64,{content}"{rest}></div>'
