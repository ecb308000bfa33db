"""The parts of a report that is one page: it needs nothing else, for the screen, light or dark, and for paper."""

from __future__ import annotations

from collections.abc import Iterable

from service.reports.page_style import STYLE
from service.reports.text_format import escaped

NUMBER = ' class="number"'


def document(title: str, subtitle: str, *content: str) -> str:
    """The whole page; ``title`` is text, ``subtitle`` and ``content`` are HTML."""
    return "\n".join(
        (
            "<!doctype html>",
            '<html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escaped(title)}</title>",
            f"<style>{STYLE}</style></head><body>",
            f'<header><h1>{escaped(title)}</h1><p class="sub">{subtitle}</p></header>',
            *content,
            "</body></html>",
            "",
        )
    )


def section(title: str, *content: str) -> str:
    """A part of the page under a heading; HTML."""
    return f"<section><h2>{title}</h2>{''.join(content)}</section>"


def sentences(said: Iterable[str]) -> str:
    """A list of sentences, which are text."""
    return listed(map(escaped, said))


def listed(items: Iterable[str]) -> str:
    """A list; ``items`` are HTML."""
    return f"<ul>{''.join(f'<li>{item}</li>' for item in items)}</ul>"


def tiles(of: Iterable[tuple[str, str]]) -> str:
    """Large values (text) over what they are (HTML)."""
    cells = (f'<div class="tile"><b>{escaped(value)}</b><span>{words}</span></div>' for value, words in of)
    return f'<div class="tiles">{"".join(cells)}</div>'


def verdict(kind: str, first: str, rest: str) -> str:
    """The first thing to read: ``kind`` is good, warn or bad; ``first``, in bold, and ``rest`` are text."""
    return f'<p class="verdict {kind}"><b>{escaped(first)}</b> {escaped(rest)}</p>'


def table(head: str, rows: str, kind: str = "") -> str:
    """A table, wide ones scroll; ``head`` as ``heads`` gives it, ``rows`` are HTML."""
    named = f' class="{kind}"' if kind else ""
    return f'<div class="scroll"><table{named}>{head}<tbody>{rows}</tbody></table></div>'


def heads(titles: Iterable[str], right: Iterable[str] = ()) -> str:
    """The first row of a table; the titles of ``right`` stand over numbers."""
    over = set(right)
    cells = (f"<th{NUMBER if title in over else ''}>{escaped(title)}</th>" for title in titles)
    return f"<thead><tr>{''.join(cells)}</tr></thead>"


def number_cell(text: str) -> str:
    """A cell of a table with a number in it."""
    return f'<td class="number">{escaped(text)}</td>'


def legend(html: str) -> str:
    """Small words under a table or a picture."""
    return f'<p class="legend">{html}</p>'
