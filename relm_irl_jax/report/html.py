"""The report as one self-contained page: the Markdown rendered, its pictures inside the file."""

import base64
import html
import re
from pathlib import Path

from markdown_it import MarkdownIt

STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 68rem; margin: 0 auto; padding: 1rem; }
h1, h2 { line-height: 1.2; margin-top: 2rem; }
img { max-width: 100%; height: auto; background: white; border-radius: 4px; }
.table { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 0.92em; }
th, td { padding: 0.25rem 0.7rem; border-bottom: 1px solid #8884; white-space: nowrap; }
thead th { border-bottom: 2px solid #888a; }
code, pre { font-size: 0.88em; }
pre { overflow-x: auto; padding: 0.8rem; background: #8881; border-radius: 4px; }
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
    body = body.replace("<table>", '<div class="table"><table>').replace("</table>", "</table></div>")
    body = re.sub(r'<img src="([^"]+)"', lambda found: f'<img src="{_inside(folder / found[1])}"', body)
    title = html.escape(text.splitlines()[0].lstrip("# "))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{STYLE}</style></head>\n<body>\n{body}</body></html>\n"
    )


def _inside(path: Path) -> str:
    """A PNG picture as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()
