"""Words and formulas in a picture: escaped, measured, with italic letters and lowered subscripts."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from html import escape

from monitor_core.modeling.symbolic import notation

_LONGEST = 32
_GREEK = dict(
    zip(
        [
            *(
                "alpha",
                "beta",
                "gamma",
                "delta",
                "epsilon",
                "zeta",
                "eta",
                "theta",
                "kappa",
                "lambda",
                "mu",
                "nu",
            ),
            *("xi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega"),
        ],
        "αβγδεζηθκλμνξρστφχψω",
        strict=True,
    )
)
_TOKEN = re.compile(r"\^-?\d+|[^\W\d](?:[\w.\[\]])*|[\d.]+|\s+|.")
_NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def words(text: str, longest: int = _LONGEST) -> str:
    """Text for XML: one line, nothing that XML forbids, not endlessly long."""
    plain = " ".join(_NOT_XML.sub("", text).split())
    return escape(plain if len(plain) <= longest else plain[: longest - 1] + "…")


def width(text: str, size: float = 13, longest: int = _LONGEST) -> float:
    """About how wide the text is, in pixels."""
    letters = text[:longest]
    return size * sum(1.0 if unicodedata.east_asian_width(c) in "WF" else 0.58 for c in letters)


def formula(text: str) -> str:
    """``kg*r^2/Jm`` with italic letters, lowered subscripts and raised exponents, as tspans."""
    out, shift = [], 0.0
    for piece, style, level in _pieces(text):
        move = f' dy="{level - shift:g}"' if level != shift else ""
        shift = level
        out.append(f'<tspan class="{style}"{move}>{words_kept(piece)}</tspan>')
    return "".join(out)


def words_kept(text: str) -> str:
    """Like ``words``, blanks as they are."""
    return escape(_NOT_XML.sub("", text))


def _pieces(text: str) -> Iterator[tuple[str, str, float]]:
    """What to write, its class, and how far below the line."""
    for token in _TOKEN.findall(text):
        if token[0] == "^":
            yield token[1:].replace("-", "−"), "small", -4
        elif token[0].isalpha() or token[0] == "_":
            letter, subscript = notation(token)
            shown = _GREEK.get(letter, letter)
            yield shown, "letter" if len(shown) == 1 else "word", 0
            if subscript:
                yield subscript, "small", 3
        else:
            yield {"*": "\u2009", "-": "−"}.get(token, token), "word", 0
