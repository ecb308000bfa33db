"""Bodies in the picture of a drive: boxes on a shaft, what acts on them, the torque that drives the first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise

from monitor_core.modeling.flat import FlatComponent
from service.reports import picture_symbols as symbols
from service.reports.picture_layout import Body
from service.reports.picture_parts import BODY, LEG, STUB, Slot, slot, values
from service.reports.picture_text import formula, width, words

_DRIVEN = 76
"""Shaft on the left, for the torque."""
_RIGID = 22
"""Shaft between two inertias that turn as one."""


class Figure:
    """A body with its boxes and slots, around its own middle.

    ``left``, ``right``, ``up``, ``down``: how far it reaches.  ``gains``: what the torque goes through before it acts.
    """

    def __init__(self, body: Body, gains: Sequence[FlatComponent]) -> None:
        self.body = body
        driven = [c for c in body.attached if c.kind == "torque" and body.column == 0]
        self.driver = _Driver(driven[0], gains) if driven else None
        slots = [slot(c) for c in body.attached if c not in driven[:1]]
        self.above = _placed([s for s in slots if s.above])
        self.below = _placed([s for s in slots if not s.above])
        legs = max((2 * abs(x) + 36 for x, _ in self.above + self.below), default=0.0)
        self.boxes = _boxes(body.inertias, legs)
        self.length = sum(self.boxes) + _RIGID * max(0, len(self.boxes) - 1)
        rail = max(self.length, legs) / 2
        ends = [x + s.half + 6 + s.label for x, s in self.above + self.below]
        self.left = rail + (self.driver.width if self.driver else 6)
        self.right = max([rail, *ends]) + 6
        self.rail = rail if len(self.boxes) != 1 else 0.0
        self.up = BODY / 2 + (STUB + 26 if self.above else 18 if self.driver else 4)
        self.down = BODY / 2 + (LEG + 22 if self.below else self.driver.depth if self.driver else 4)

    def drawing(self) -> Iterator[str]:
        """Its elements, what lies below first."""
        if self.driver:
            yield self.driver.drawing(-self.left, -self.length / 2)
        if self.rail:
            yield symbols.path(f"M{-self.rail:g} 0H{self.rail:g}")
        yield from (symbols.moved(x, 0, s.drawing) for x, s in (*self.above, *self.below))
        if not self.boxes:
            yield '<circle class="dot" cx="0" cy="0" r="4"/>'
        x = -self.length / 2
        for c, size in zip(self.body.inertias, self.boxes, strict=True):
            yield symbols.moved(x + size / 2, 0, _box(c, size))
            x += size + _RIGID


class _Driver:
    """The torque on the first shaft, with what it is multiplied by."""

    def __init__(self, torque: FlatComponent, gains: Sequence[FlatComponent]) -> None:
        self.torque = torque
        self.factors = [c for c in (torque, *gains) if values(c)]
        labels = [width(torque.name, 12), *(width(values(c)) for c in self.factors)]
        self.width = max(_DRIVEN, max(labels) + 12)
        self.depth = 4 + 17 * len(self.factors)

    def drawing(self, left: float, right: float) -> str:
        """Between ``left`` and the first box at ``right``, on a shaft that goes on to the middle of the body."""
        middle = (left + right) / 2
        shaft = symbols.path(f"M{left:g} 0H0") + symbols.moved(middle, 0, symbols.torque())
        name = symbols.text(middle, -BODY / 2 - 6, words(self.torque.name), "quiet")
        drawn = symbols.titled(symbols.description(self.torque), shaft + name)
        for number, c in enumerate(self.factors, 1):
            label = symbols.text(middle, BODY / 2 + 17 * number - 2, formula(values(c)), "formula")
            drawn += symbols.titled(symbols.description(c), label)
        return drawn


def _boxes(inertias: Sequence[FlatComponent], legs: float) -> list[float]:
    """The widths of the boxes; a single one is as wide as its legs need."""
    texts = [max(72, width(c.name) + 24, width(values(c)) + 24) for c in inertias]
    return [max(texts[0], legs)] if len(texts) == 1 else texts


def _placed(slots: Sequence[Slot]) -> list[tuple[float, Slot]]:
    """Beside each other, the symbols centred as a whole."""
    places = list(accumulate((a.pitch + b.half for a, b in pairwise(slots)), initial=0.0))
    return [(x - places[-1] / 2, s) for x, s in zip(places, slots, strict=False)]


def _box(c: FlatComponent, size: float) -> str:
    name = symbols.text(0, -4 if values(c) else 5, words(c.name), "name")
    below = symbols.text(0, 15, formula(values(c)), "formula") if values(c) else ""
    return symbols.titled(symbols.description(c), symbols.mass(size, BODY) + name + below)
