"""A picture of a drive: inertias as boxes, springs and dashpots between them, torque, sensors, ground."""

from __future__ import annotations

from collections.abc import Iterator

from monitor_core.modeling.flat import ModelError
from monitor_core.modeling.statespace import StateSpace
from service.reports import picture_symbols as symbols
from service.reports.picture_bodies import Figure
from service.reports.picture_layout import Layout, Link, lay_out
from service.reports.picture_parts import Row, breadth, extent, link_drawing, rows
from service.reports.picture_text import width, words

_MARGIN, _TITLE = 24, 34
_BUS = 18
"""Room in a gap for the line down to a branch."""
_ASIDE = 12
"""Room on both sides of a gap for the lines of each loop."""


def as_svg(space: StateSpace) -> str:
    """The picture as an SVG document, for light and dark pages.

    Raises:
        ModelError: the drive has not been drawn: there are no components.
    """
    if not any(c.nodes for c in space.components):
        raise ModelError(f"{space.name} has no components to draw")
    return _Picture(space.name, lay_out(space.components)).document()


class _Picture:
    """Places columns, lanes and gaps, and draws."""

    def __init__(self, name: str, layout: Layout) -> None:
        self.name, self.layout = name, layout
        self.figures = [Figure(body, layout.gains) for body in layout.bodies]
        self.links = [(link, rows(link.parts)) for link in layout.links]
        self.loops = sum(not link.tree for link in layout.links)
        self.aside = _ASIDE * self.loops
        self._place_columns()
        self._place_lanes()

    def _place_columns(self) -> None:
        columns = range(1 + max(b.column for b in self.layout.bodies))
        left, right, gap = ([0.0 for _ in columns] for _ in range(3))
        for f in self.figures:
            left[f.body.column] = max(left[f.body.column], f.left)
            right[f.body.column] = max(right[f.body.column], f.right)
        for link, parts in self.links:
            start = self.layout.bodies[link.start].column
            gap[start] = max(gap[start], breadth(parts) + _BUS + 8 + 2 * self.aside)
        self.x, self.gap_start = [], []
        at = float(_MARGIN)
        for column in columns:
            self.x.append(at + left[column])
            self.gap_start.append(self.x[-1] + right[column])
            at = self.gap_start[-1] + gap[column]
        self.gap_end = [self.x[c + 1] - left[c + 1] if c + 1 in columns else at for c in columns]
        self.width = max(at + _MARGIN, width(self.name, 16, 80) + 2 * _MARGIN, 200)

    def _place_lanes(self) -> None:
        loops = [parts for link, parts in self.links if not link.tree]
        up, down = ([0.0] * (self.layout.lanes + len(loops)) for _ in range(2))

        def stretch(lane: int, above: float, below: float) -> None:
            up[lane], down[lane] = max(up[lane], above), max(down[lane], below)

        for f in self.figures:
            stretch(f.body.lane, f.up, f.down)
        for link, parts in self.links:
            if link.tree:
                stretch(self.layout.bodies[link.end].lane, *extent(parts))
        for number, parts in enumerate(loops):
            stretch(self.layout.lanes + number, *extent(parts))
        self.y, at = [], float(_MARGIN + _TITLE)
        for above, below in zip(up, down, strict=True):
            self.y.append(at + above)
            at += above + below + 14
        self.height = at + _MARGIN - 14

    def document(self) -> str:
        size = f'width="{self.width:.0f}" height="{self.height:.0f}" viewBox="0 0 {self.width:.0f} {self.height:.0f}"'
        lines = (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">',
            f"<title>{words(self.name)}: masses and springs</title>",
            f"<style>{symbols.STYLE}</style>",
            '<rect class="paper" width="100%" height="100%"/>',
            symbols.text(_MARGIN, _MARGIN + 10, words(self.name, 80), "title", "start"),
            *self._drawn_links(),
            *(
                symbols.moved(self.x[f.body.column], self.y[f.body.lane], "".join(f.drawing()))
                for f in self.figures
            ),
            "</svg>",
        )
        return "\n".join(lines) + "\n"

    def _drawn_links(self) -> Iterator[str]:
        yield from (self._branch(link, parts) for link, parts in self.links if link.tree)
        loops = ((link, parts) for link, parts in self.links if not link.tree)
        for number, (link, parts) in enumerate(loops):
            yield self._loop(
                link, parts, self.y[self.layout.lanes + number], self.aside * number / self.loops
            )

    def _branch(self, link: Link, parts: list[Row]) -> str:
        """From a body to one in the next column, down to its lane first."""
        start, end = self.layout.bodies[link.start], self.layout.bodies[link.end]
        y0, y1 = self.y[start.lane], self.y[end.lane]
        bus = self.gap_start[start.column] + _BUS / 2
        left = self.gap_start[start.column] + _BUS + self.aside
        right = self.gap_end[start.column] - 8 - self.aside
        shaft = f"M{self.x[start.column]:g} {y0:g}H{bus:g}V{y1:g}H{left:g}M{right:g} {y1:g}H{self.x[end.column]:g}"
        return symbols.path(shaft) + symbols.moved(left, y1, link_drawing(parts, right - left))

    def _loop(self, link: Link, parts: list[Row], y: float, aside: float) -> str:
        """Between two bodies that hang together already: around below everything else, as a bridge."""
        start, end = self.layout.bodies[link.start], self.layout.bodies[link.end]
        left = self.gap_start[start.column] + _BUS + aside
        right = self.gap_end[max(start.column, end.column - 1)] - 8 - aside
        shafts = ""
        for body, x in ((end, right), (start, left)):
            y0 = self.y[body.lane]
            shafts += symbols.path(f"M{x:g} {y0 + 8:g}V{y - 8:g}", "halo")
            shafts += symbols.path(f"M{self.x[body.column]:g} {y0:g}H{x:g}V{y:g}")
        return shafts + symbols.moved(left, y, link_drawing(parts, right - left))
