"""Pictures by matplotlib as SVG in a page, in the style of the dashboard: grey lines that differ by their dashes.

Colours are those of the page (templates/tokens.css), for light and dark screens and for paper.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TEXT, QUIET, GRID, BAND, ZONE, PANEL, ALARM, ALARM_BACK = (f"#01010{k}" for k in range(1, 9))
"""Placeholders for the colours of the page, which COLOURS names."""
_NAMES = ("text", "quiet", "line", "band", "zone", "panel", "alarm", "alarm-back")
COLOURS = {f"#01010{k}": name for k, name in enumerate(_NAMES, 1)}

LineStyle = dict[str, Any]
ESTIMATE: LineStyle = {"color": TEXT, "lw": 1.3}
NOMINAL: LineStyle = {"color": QUIET, "lw": 1.3, "ls": (0, (4, 2.7))}
LIMIT: LineStyle = {"color": ALARM, "lw": 1.0, "ls": (0, (2, 3))}
UP: LineStyle = {"color": TEXT, "lw": 1.2}
DOWN: LineStyle = {"color": QUIET, "lw": 1.2, "ls": (0, (5.3, 2))}
"""Lines of the dashboard (axis_page.tsx): estimate and nominal value, a threshold, the tests for both directions."""
DOTTED: LineStyle = {"color": QUIET, "lw": 1.3, "ls": (0, (1, 1.5))}
MEASURED: LineStyle = {"color": BAND, "lw": 2.6}
"""Further lines: those beside the main one, and measured values."""
ALARM_OPEN, ONSET = "alarm, from onset to end", "interval of the onset"
"""Texts of legends"""
WIDTH = 9.0
"""Width of a picture [inches]; the page scales it."""
_HEAD = re.compile(r"^.*?(?=<svg)", re.DOTALL)
_METADATA = re.compile(r"<metadata>.*?</metadata>", re.DOTALL)
_DIGITS = re.compile(r"(\d+\.\d\d)\d+")
_PATH = re.compile(r' d="[^"]*"')
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9.5,
    "text.color": TEXT,
    "axes.edgecolor": GRID,
    "axes.labelcolor": TEXT,
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "figure.constrained_layout.h_pad": 0.04,
    "figure.constrained_layout.w_pad": 0.04,
    "figure.facecolor": "none",
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "legend.frameon": False,
    "hatch.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "path.simplify_threshold": 0.5,  # of a pixel: a long line looks the same, with far fewer points
}


@contextmanager
def figure(height: float) -> Iterator[Figure]:
    """An empty picture of that height [inches] in the style of the reports."""
    # Without pyplot, which would look for a window system and keep figures in memory.
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        yield Figure(figsize=(WIDTH, height), layout="constrained")


def as_svg(drawn: Figure, label: str, salt: str) -> str:
    """The picture as an SVG element; ``label`` says what it shows to who cannot see it, ``salt`` keeps its names apart.

    To be called inside ``figure``.
    """
    import matplotlib as mpl

    out = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": salt}):
        drawn.savefig(out, format="svg", metadata={"Date": None})
    text = _METADATA.sub("", _HEAD.sub("", out.getvalue()))
    for colour, name in COLOURS.items():
        text = text.replace(colour, f"var(--{name})")
    text = _PATH.sub(lambda found: _DIGITS.sub(r"\1", found[0]), text)
    return text.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1)


def legend_of(drawn: Figure, panels: Iterable[Axes], order: Sequence[str]) -> None:
    """One legend above all panels, in three rows: each kind of line once, in the order of these names."""
    known: dict[str, Artist] = {}
    for axes in panels:
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            known.setdefault(name, handle)
    names = sorted(known, key=order.index)
    columns = -(-len(names) // 3)  # the legend is filled column by column
    handles = [known[name] for name in names]
    drawn.legend(handles, names, loc="outside upper left", ncols=columns, fontsize=9, handlelength=2.2)


def add_percent(axes: Axes, nominal: float) -> None:
    """A scale on the right for the change from a nonzero nominal value."""
    functions = (lambda value: 100 * (value / nominal - 1), lambda share: nominal * (1 + share / 100))
    axes.secondary_yaxis("right", functions=functions).set_ylabel("change [%]")
