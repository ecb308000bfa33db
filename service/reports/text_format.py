"""Numbers and text as all reports write them."""

from __future__ import annotations

import html
import re

_NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_FULL = 1e7
_MANY = 10.0


def without_control_characters(text: str) -> str:
    """The text without the characters that HTML and XML cannot hold."""
    return _NOT_XML.sub("", text)


def escaped(text: str) -> str:
    """Text for SVG and HTML."""
    return html.escape(without_control_characters(text))


def plain(value: float, digits: int) -> str:
    """So many digits, large numbers in full: 281330, not 2.8133e+05."""
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:.0f}" if 10 ** (digits - 1) <= abs(rounded) < _FULL else f"{value:.{digits}g}"


def percent(value: float | None, signed: bool = False) -> str:
    """``0.12 %``, two digits; beyond ten times nothing is told but that."""
    if value is None:
        return ""
    if abs(value) > _MANY:
        return f"> {100 * _MANY:g} %"
    digits = float(f"{100 * value:.2g}")
    return f"{digits:+g} %" if signed else f"{digits:g} %"
