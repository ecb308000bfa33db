"""The parts of a report that is one page: it needs nothing else, for the screen, light or dark, and for paper."""

from __future__ import annotations

from collections.abc import Iterable

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


# --- How the reports that are pages look: light and dark as the reader's system is, and on paper ----------------------


COLOURS = """
:root {
  color-scheme: light dark;
  --page: #f4f6f8; --panel: #ffffff; --line: #d9dfe6; --ink: #17202b; --quiet: #5a6775;
  --good: #1a7f4b; --good-back: #e0f3e8; --warn: #8a5a00; --warn-back: #fdf0d0; --bad: #b3202c; --bad-back: #fbe4e5;
  --measured: #9aa5b1; --found: #1f5fc4; --simulated: #d2601a; --other: #1a7f4b; --before: #8a6fc2;
}
@media screen and (prefers-color-scheme: dark) {
  :root {
    --page: #10151b; --panel: #19212a; --line: #2e3a47; --ink: #e4eaf1; --quiet: #9aa8b7;
    --good: #6cd49c; --good-back: #143a28; --warn: #f2c25c; --warn-back: #40310e; --bad: #ff8a8f; --bad-back: #4a181d;
    --measured: #6b7886; --found: #6ea8fe; --simulated: #f59e5b; --other: #6cd49c; --before: #b9a5e8;
  }
}
"""
"""Of everything, by name: what says something has the same colour wherever it is."""
STYLE = (
    COLOURS
    + """
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 28px 20px 40px; max-width: 1120px; background: var(--page); color: var(--ink);
  font: 15px/1.5 system-ui, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif; }
h1 { margin: 0; font-size: 26px; letter-spacing: -0.01em; line-height: 1.25; }
h2 { margin: 0 0 10px; font-size: 17px; } h3 { margin: 20px 0 4px; font-size: 15px; }
p { margin: 0 0 8px; }
.sub { color: var(--quiet); margin: 4px 0 18px; }
section, .tile { background: var(--panel); border: 1px solid var(--line); border-radius: 10px; }
section { padding: 18px 20px; margin-top: 16px; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(190px, 1fr)); gap: 12px; }
.tile { padding: 12px 16px; }
.tile b { display: block; font-size: 22px; line-height: 1.3; font-variant-numeric: tabular-nums; }
.tile span { color: var(--quiet); font-size: 13px; }
.verdict { padding: 12px 18px; margin-bottom: 14px; border-radius: 8px; border-left: 4px solid currentColor; }
.good { color: var(--good); background: var(--good-back); } .warn { color: var(--warn); background: var(--warn-back); }
.bad { color: var(--bad); background: var(--bad-back); }
.scroll { overflow-x: auto; }
table { width: 100%; border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 6px 10px; text-align: left; border-bottom: 1px solid var(--line); vertical-align: middle; }
thead th { font-size: 12.5px; color: var(--quiet); font-weight: 600; white-space: nowrap; vertical-align: bottom; }
tbody tr:last-child > * { border-bottom: 0; }
tbody th { font-weight: 600; white-space: nowrap; }
.number { text-align: right; white-space: nowrap; }
.unit, .meaning { color: var(--quiet); font-size: 13.5px; } .unit { white-space: nowrap; }
.meaning { min-width: 180px; } .when { white-space: nowrap; }
.when span { font-size: 12.5px; } .scroll + ul { margin-top: 12px; }
.held td, .held th { color: var(--quiet); font-weight: 400; }
.bar { position: relative; display: block; width: 90px; height: 10px; border-radius: 5px; background: var(--line); }
.bar i { position: absolute; inset: 0 auto 0 0; border-radius: 5px; background: var(--found); }
.bar.poor i { background: var(--simulated); }
.legend { color: var(--quiet); font-size: 13px; margin: 8px 0 0; }
figure { margin: 0; } * + figure { margin-top: 16px; } figcaption { font-weight: 600; margin-bottom: 4px; }
figure svg, figure img { display: block; width: 100%; height: auto; }
figure img { width: auto; max-width: 100%; border-radius: 8px; }
.matrix { width: auto; font-size: 13px; } .matrix th, .matrix td { border: 0; padding: 4px 7px; text-align: right; }
.matrix thead th { text-align: right; color: var(--ink); } .matrix td { position: relative; min-width: 46px; }
.matrix td i { position: absolute; inset: 1px; border-radius: 4px; background: var(--found); }
.matrix td.minus i { background: var(--simulated); }
.matrix td b { position: relative; font-weight: 400; } .matrix .strong b { font-weight: 700; }
.why { white-space: nowrap; font-size: 13.5px; }
td.alarmed { color: var(--bad); font-weight: 600; }
.quiet { color: var(--quiet); }
ul { margin: 0; padding-left: 20px; } li { margin: 0 0 6px; }
pre { margin: 0; padding: 12px 14px; border-radius: 8px; background: var(--page); font-size: 13px;
  white-space: pre-wrap; overflow-wrap: anywhere; }
.hash { font: 12px ui-monospace, "DejaVu Sans Mono", monospace; color: var(--quiet); overflow-wrap: anywhere; }
@media print {
  @page { size: A4; margin: 14mm; } :root { color-scheme: light; }
  body { max-width: none; padding: 0; background: none; font-size: 12px; }
  section { border: 0; padding: 0; margin-top: 18px; } figure, .tile, tr, .verdict { break-inside: avoid; }
  .tiles { grid-template-columns: repeat(4, 1fr); } .tile { padding: 8px 10px; } .tile b { font-size: 17px; }
  th, td { padding: 3px 6px; font-size: 11px; } .unit, .meaning, .why, .tile span, .legend { font-size: 10.5px; }
  .bar { width: 48px; } .meaning { min-width: 150px; } h1 { font-size: 20px; } h2 { font-size: 14px; }
  h2 { break-after: avoid; } .scroll { overflow: visible; } * { print-color-adjust: exact; }
}
"""
)
