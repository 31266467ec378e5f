"""The report as a self-contained HTML page, rendered from Markdown with embedded images."""

import base64
import html
import re
from collections.abc import MutableMapping, Sequence
from pathlib import Path
from urllib.parse import unquote

from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.token import Token
from markdown_it.utils import OptionsDict
from PIL import Image

from relm_irl_jax.report.figures import FIGURE_DPI

SCREEN_DPI = 100
"""Resolution in dots per inch at which figures are displayed, so that their text is about as large as the page's."""

LONG_NAME = 30
"""Length in characters above which names of table rows may wrap."""

STYLE = r"""
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 68rem; margin: 0 auto; padding: 1rem; }
h1, h2 { line-height: 1.2; margin-top: 2rem; }
figure { margin: 1rem 0 0.4rem; }
img { max-width: 100%; height: auto; background: white; border-radius: 4px; }
.table, .wide { overflow-x: auto; }
.table { margin: 1rem 0; }
th { text-align: left; vertical-align: bottom; }
@media (max-width: 46rem) {
  .wide img { min-width: 44rem; }
  .wide::before { content: "scroll to the right \2192"; position: sticky; left: 0; font-size: 0.8em; opacity: 0.7; }
}
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
        text: the Markdown; image paths are relative to the folder. An image that cannot be read is replaced by a
            message.
        folder: folder of the images.

    Returns:
        A complete HTML page that needs no other file.
    """
    markdown = MarkdownIt("commonmark", {"html": False}).enable("table").disable(["link", "autolink", "reference"])
    for name, rule in RULES.items():
        markdown.add_render_rule(name, rule)
    body = markdown.render(text, {"folder": folder})
    title = html.escape(re.sub(r"\\(?=[^\w\s])", "", text.splitlines()[0].lstrip("# ")))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{STYLE}</style></head>\n<body>\n{body}</body></html>\n"
    )


def _open_table(self: RendererHTML, tokens: Sequence[Token], index: int, *_: object) -> str:
    """A table in a scrollable box; long names of rows may wrap."""
    end = next(i for i in range(index, len(tokens)) if tokens[i].type == "table_close")
    names = [tokens[i + 2].content for i in range(index, end) if [t.type for t in tokens[i : i + 2]] == FIRST_CELL]
    shape = "table described" if max(map(len, names), default=0) > LONG_NAME else "table"
    return f'<div class="{shape}"><table>\n'


def _close_table(self: RendererHTML, *_: object) -> str:
    return "</table></div>\n"


def _open_paragraph(
    self: RendererHTML, tokens: Sequence[Token], index: int, options: OptionsDict, env: MutableMapping
) -> str:
    """A paragraph; an image gets no paragraph tag, since it has a figure tag."""
    return "" if _is_picture(tokens[index + 1]) else self.renderToken(tokens, index, options, env)


def _close_paragraph(
    self: RendererHTML, tokens: Sequence[Token], index: int, options: OptionsDict, env: MutableMapping
) -> str:
    return "\n" if _is_picture(tokens[index - 1]) else self.renderToken(tokens, index, options, env)


def _picture(self: RendererHTML, tokens: Sequence[Token], index: int, options: OptionsDict, env: MutableMapping) -> str:
    """An embedded PNG image; a wide image is in a scrollable box on narrow screens."""
    token = tokens[index]
    path = env["folder"] / unquote(str(token.attrs["src"]))
    try:
        if not path.resolve().is_relative_to(env["folder"].resolve()):
            raise OSError("a file outside of the report's folder")
        content = path.read_bytes()
        with Image.open(path) as picture:
            width, height = picture.size
    except Exception:  # damaged pictures cause many kinds of exceptions
        return f"<p>{html.escape(str(token.attrs['src']))} cannot be read and is not shown.</p>"
    shape = "wide" if width > 1.8 * height else "narrow"
    shown = round(width * SCREEN_DPI / FIGURE_DPI)
    data = base64.b64encode(content).decode()
    alternative = html.escape(token.content)
    return (
        f'<figure class="{shape}"><img width="{shown}" src="data:image/png;base64,{data}" alt="{alternative}"></figure>'
    )


def _is_picture(token: Token) -> bool:
    """Whether a paragraph consists of one image."""
    return [child.type for child in token.children or ()] == ["image"]


FIRST_CELL = ["tr_open", "td_open"]
"""Tokens before the text of a row's first cell."""

RULES = {
    "table_open": _open_table,
    "table_close": _close_table,
    "paragraph_open": _open_paragraph,
    "paragraph_close": _close_paragraph,
    "image": _picture,
}
"""Renderers that replace the default ones."""
