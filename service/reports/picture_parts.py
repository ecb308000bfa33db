"""The parts of a drive's picture with their sizes: what hangs on a body, and the rows of a link."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from monitor_core.modeling.flat import FlatComponent
from service.reports import picture_symbols as symbols
from service.reports.picture_text import formula, width, words

BODY = 54
"""Height of the box of an inertia."""
STUB, LEG = 34, 54
"""From the box up to the middle of a symbol; length of a symbol that goes down to the ground."""
_PITCH, _NAME = 46, 15

_BETWEEN: dict[str, tuple[tuple[str, Callable[[float], str], float], ...]] = {
    "spring": (("c", symbols.spring, symbols.SPRING),),
    "damper": (("d", symbols.damper, symbols.DAMPER),),
    "viscous-friction": (("d", symbols.damper, symbols.DAMPER),),
    "spring-damper": (("c", symbols.spring, symbols.SPRING), ("d", symbols.damper, symbols.DAMPER)),
    "ideal-gear": (("ratio", symbols.gear, 22),),
}
"""Rows of each kind between two flanges: the role beside it, the symbol, half its height."""

_ABOVE: dict[str, Callable[[], str]] = {
    "torque": symbols.torque,
    "torque-offset": symbols.torque,
    "speed-sensor": lambda: symbols.sensor("omega"),
    "angle-sensor": lambda: symbols.sensor("phi"),
    "gravity": symbols.weight,
}
"""What stands above the body; everything else goes down to the ground."""


@dataclass(frozen=True, slots=True)
class Slot:
    """Something that acts on one body: drawn around x = 0, with a label to its right; y = 0 is the shaft."""

    drawing: str
    half: float
    label: float
    above: bool

    @property
    def pitch(self) -> float:
        """How far the next one is away at least."""
        return self.half + 6 + self.label + 16


@dataclass(frozen=True, slots=True)
class Row:
    """One symbol of a link, ``y`` below the line between the bodies."""

    component: FlatComponent
    symbol: Callable[[float], str]
    half: float
    y: float
    role: str
    first: bool


def value(c: FlatComponent, role: str) -> str:
    """The expression of a parameter; empty if the component has none of that role."""
    return str(c.parameters[role]) if role in c.parameters else ""


def values(c: FlatComponent) -> str:
    """All its parameters; a torque constant of one says nothing."""
    shown = (str(v) for v in c.parameters.values())
    return ", ".join(v for v in shown if c.kind != "torque" or v != "1")


def slot(c: FlatComponent) -> Slot:
    """What a component that acts on one body looks like, above the body or below."""
    above = c.kind in _ABOVE
    drawing, half = _standing(c) if above else _hanging(c)
    middle = -BODY / 2 - STUB if above else BODY / 2 + 8 + LEG / 2
    shown = values(c)
    label = symbols.text(half + 6, middle + (4 if not shown else -3), words(c.name), "quiet", "start")
    if shown:
        label += symbols.text(half + 6, middle + 14, formula(shown), "formula", "start")
    drawn = symbols.titled(symbols.description(c), drawing + label)
    return Slot(drawn, half, max(width(c.name, 12), width(shown)), above)


def _standing(c: FlatComponent) -> tuple[str, float]:
    middle = -BODY / 2 - STUB
    stem = symbols.path(f"M0 0V{middle + (16 if c.kind == 'gravity' else 0):g}")
    turn = 90 if c.kind in ("torque", "torque-offset") else 0
    return stem + symbols.moved(0, middle, _ABOVE[c.kind](), turn), 26 if turn else 16


def _hanging(c: FlatComponent) -> tuple[str, float]:
    top, bottom = BODY / 2 + 8, BODY / 2 + 8 + LEG
    if c.kind == "coulomb-friction":
        return symbols.path(f"M0 0V{bottom - 9:g}") + symbols.moved(0, bottom, symbols.pad()), 16
    sides = _BETWEEN.get(c.kind, (("", symbols.block, 12),))
    places = [13 * (2 * i - len(sides) + 1) for i in range(len(sides))]
    drawn = "".join(
        symbols.moved(x, top, symbol(LEG), turn=90) for x, (_, symbol, _) in zip(places, sides, strict=True)
    )
    bars = f"M{places[0]} {top:g}H{places[-1]}M{places[0]} {bottom:g}H{places[-1]}" if len(sides) > 1 else ""
    return symbols.path(f"M0 0V{top:g}{bars}") + drawn + symbols.moved(0, bottom, symbols.ground()), places[
        -1
    ] + 16


def rows(parts: Iterable[FlatComponent]) -> list[Row]:
    """The symbols of a link from top to bottom, its middle at y = 0."""
    found: list[tuple[FlatComponent, str, Callable[[float], str], float, bool, float]] = []
    y = 0.0
    for c in parts:
        for number, (role, symbol, half) in enumerate(_BETWEEN.get(c.kind, (("", symbols.block, 12),))):
            if found:
                y += _PITCH + (_NAME if number == 0 else 0)
            found.append((c, role, symbol, half, number == 0, y))
    return [Row(c, symbol, half, at - y / 2, role, first) for c, role, symbol, half, first, at in found]


def extent(link: Sequence[Row]) -> tuple[float, float]:
    """How far a link reaches above and below its line, labels included."""
    return -link[0].y + link[0].half + 2 * _NAME + 10, link[-1].y + link[-1].half + 8


def breadth(link: Sequence[Row]) -> float:
    """How wide a link is at least."""
    texts = [max(width(r.component.name, 12), width(value(r.component, r.role))) for r in link]
    return max(92, *(t + 24 for t in texts))


def link_drawing(link: Sequence[Row], length: float) -> str:
    """A link from 0 to ``length``, with its labels above the symbols."""
    bars = "".join(f"M{x:g} {link[0].y:g}V{link[-1].y:g}" for x in (0, length)) if len(link) > 1 else ""
    return (symbols.path(bars) if bars else "") + "".join(_row(row, length) for row in link)


def _row(row: Row, length: float) -> str:
    c, middle = row.component, length / 2
    shown = value(c, row.role)
    y = row.y - row.half - 7
    drawn = symbols.moved(0, row.y, row.symbol(length))
    if shown:
        drawn += symbols.text(middle, y, formula(shown), "formula")
    if row.first:
        drawn += symbols.text(middle, y - (_NAME + 2 if shown else 0), words(c.name), "quiet")
    return symbols.titled(symbols.description(c), drawn)
