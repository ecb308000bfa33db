"""The symbols of a drive's picture, as SVG elements: springs, dashpots, gears, ground, arrows, sensors.

Symbols between two flanges lie along the x axis from 0 to ``length``; a group turns and moves them.
"""

from __future__ import annotations

from monitor_core.modeling.flat import FlatComponent
from service.reports.picture_text import formula, words

STYLE = """
  .paper { fill: #ffffff } .halo { stroke: #ffffff; stroke-width: 9; fill: none }
  .ink { stroke: #17202b; stroke-width: 1.8; fill: none; stroke-linecap: round; stroke-linejoin: round }
  .hatch { stroke: #5a6775; stroke-width: 1.2 }
  .teeth { stroke-width: 4; stroke-linecap: butt; stroke-dasharray: 3.3 3.3 }
  .mass { fill: #dce8fa; stroke: #1f5fc4; stroke-width: 1.8 } .face { fill: #ffffff } .dot { fill: #17202b }
  .torque { stroke: #b3202c; stroke-width: 2.4 } .tip { fill: #b3202c }
  .sense { stroke: #1a7f4b }
  text { font: 13px system-ui, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif; fill: #17202b }
  .name { font-weight: 600 } .quiet { fill: #5a6775; font-size: 12px } .title { font-size: 16px; font-weight: 600 }
  .formula { font: 15px "STIX Two Math", "Cambria Math", "Latin Modern Math", "Times New Roman",
    "Liberation Serif", "DejaVu Serif", serif }
  .letter { font-style: italic } .small { font-size: 11px }
  @media (prefers-color-scheme: dark) {
    .paper, .face { fill: #10151b } .halo { stroke: #10151b } .ink { stroke: #e4eaf1 } .hatch { stroke: #9aa8b7 }
    .mass { fill: #1d3350; stroke: #6ea8fe } .dot { fill: #e4eaf1 } .torque { stroke: #ff8a8f } .tip { fill: #ff8a8f }
    .sense { stroke: #6cd49c } text { fill: #e4eaf1 } .quiet { fill: #9aa8b7 }
  }
"""
"""Colours as on the page of the daemon; classes only, so that programs without CSS variables draw it, too."""

SPRING, DAMPER = 8, 9
"""Half the height of a spring's zigzag and of a dashpot."""


def path(d: str, style: str = "ink") -> str:
    """A line along a path."""
    return f'<path class="{style}" d="{d}"/>'


def text(x: float, y: float, content: str, style: str = "", anchor: str = "middle") -> str:
    """One line of text; ``content`` is escaped already."""
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" class="{style}">{content}</text>'


def moved(x: float, y: float, elements: str, turn: float = 0) -> str:
    """A group at a place, turned by so many degrees."""
    rotate = f" rotate({turn:g})" if turn else ""
    return f'<g transform="translate({x:g} {y:g}){rotate}">{elements}</g>'


def titled(title: str, elements: str) -> str:
    """A group that shows a title under the pointer, and reads it to those who do not see."""
    return f"<g><title>{title}</title>{elements}</g>"


def spring(length: float) -> str:
    """A zigzag of six teeth."""
    start, step = length / 2 - 24, 4
    teeth = "".join(f"L{start + step * (2 * i + 1):g} {SPRING * (-1) ** (i + 1)}" for i in range(6))
    return path(f"M0 0H{start:g}{teeth}L{start + 48:g} 0H{length:g}")


def damper(length: float) -> str:
    """A dashpot: a pot open to the right, a piston in it."""
    left, right, piston = length / 2 - 13, length / 2 + 13, length / 2 + 3
    pot = f"M0 0H{left:g}M{right:g} {-DAMPER}H{left:g}V{DAMPER}H{right:g}"
    return path(f"{pot}M{piston:g} {1 - DAMPER + 2}V{DAMPER - 3}M{piston:g} 0H{length:g}")


def gear(length: float) -> str:
    """Two wheels in mesh."""
    small, large = 11, 17
    middle = length / 2 - (large - small)
    wheels = "".join(
        f'<circle class="ink" cx="{x:g}" cy="0" r="{r}"/>'
        f'<circle class="ink teeth" cx="{x:g}" cy="0" r="{r + 2.5:g}"/>'
        f'<circle class="dot" cx="{x:g}" cy="0" r="2"/>'
        for x, r in ((middle - small - 2.5, small), (middle + large + 2.5, large))
    )
    return path(f"M0 0H{middle - 2 * small - 7:g}M{middle + 2 * large + 7:g} 0H{length:g}") + wheels


def block(length: float) -> str:
    """Something between two flanges for which there is no symbol."""
    box = f'<rect class="ink face" x="{length / 2 - 20:g}" y="-12" width="40" height="24" rx="4"/>'
    return path(f"M0 0H{length:g}") + box


def ground(half: float = 16) -> str:
    """Hatching below a line, whose middle is at 0, 0."""
    count = round(half / 3.5)
    hatch = "".join(f"M{5 - half + (2 * half - 5) * i / (count - 1):.3g} 0l-6 7" for i in range(count))
    return path(f"M{-half:g} 0H{half:g}") + path(hatch, "ink hatch")


def torque() -> str:
    """An arrow around the shaft, which passes at 0, 0."""
    return path("M-5 19A8 20 0 1 1 5 19", "ink torque") + path("M-1 24L9 21L3 12Z", "tip")


def sensor(letter: str) -> str:
    """A round instrument that shows what it measures."""
    face = '<circle class="ink face sense" cx="0" cy="0" r="14"/>'
    return face + text(0, 5, formula(letter), "formula")


def pad() -> str:
    """A brake shoe on the ground: dry friction."""
    shoe = '<rect class="ink face" x="-13" y="-9" width="26" height="9"/>'
    return shoe + moved(0, 3, ground())


def weight() -> str:
    """Gravity: an arrow down."""
    return path("M0 -14V8", "ink torque") + path("M-6 4L6 4L0 15Z", "tip")


def mass(width: float, height: float) -> str:
    """The box of an inertia, its middle at 0, 0."""
    return f'<rect class="mass" x="{-width / 2:g}" y="{-height / 2:g}" width="{width:g}" height="{height:g}" rx="7"/>'


def description(c: FlatComponent) -> str:
    """``motor: inertia, J = Jm``, escaped."""
    roles = "".join(f", {role} = {value}" for role, value in c.parameters.items())
    return f"{words(c.name)}: {words(c.kind)}{words(roles)}"
