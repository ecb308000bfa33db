"""Units by the words in names of columns, and by the unit of a signal on a bus: how much of the SI unit they are."""

import math
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

Quantity = Literal["torque", "angle", "speed"]
UNITS: Mapping[str, str] = MappingProxyType({"torque": "N m", "angle": "rad", "speed": "rad/s"})
"""SI units of what is measured of an axis"""


class Unit(NamedTuple):
    """A unit; ``factor``: in SI units; None: that depends on the drive."""

    words: str
    factor: float | None
    linear: bool = False
    """The unit of a path, as of a linear axis: the factor is 2 pi over the path of one turn of its motor"""

    @property
    def missing(self) -> str:
        """Of a unit that depends on the drive: its factor, in words."""
        if self.linear:
            return "2 pi / (mm that a turn of the motor moves it)"
        if "rated torque" not in self.words:
            return f"2 pi / ({self.words} in a turn of the motor)"
        return f"rated torque / {1000 if self.words.startswith('per mille') else 100} [N m]"


_DEGREE, _TURN = math.pi / 180, 2 * math.pi
_COUNTS = Unit("counts", None)
_PATH = Unit("mm of a linear axis", None, linear=True)
_TABLE: Mapping[Quantity, Mapping[str, Unit]] = MappingProxyType(
    {
        "angle": {
            **dict.fromkeys(("rad", "radian", "radians"), Unit("radians", 1.0)),
            **dict.fromkeys(("deg", "degs", "degree", "degrees", "°", "grad"), Unit("degrees", _DEGREE)),
            **dict.fromkeys(("rev", "revs", "turn", "turns"), Unit("revolutions", _TURN)),
            "mrad": Unit("milliradians", 1e-3),
            **dict.fromkeys(("counts", "count", "cnt", "inc", "incs", "increments", "ticks"), _COUNTS),
            "mm": _PATH,
        },
        "speed": {
            **dict.fromkeys(("rad/s", "rads", "radps"), Unit("rad/s", 1.0)),
            **dict.fromkeys(("deg/s", "degs", "dps", "°/s", "grad/s"), Unit("degrees per second", _DEGREE)),
            **dict.fromkeys(
                ("rpm", "1/min", "u/min", "rev/min", "min-1"), Unit("revolutions per minute", _TURN / 60)
            ),
            **dict.fromkeys(("rps", "rev/s"), Unit("revolutions per second", _TURN)),
            **dict.fromkeys(("counts/s", "inc/s"), _COUNTS),
            "mm/s": _PATH._replace(words="mm/s of a linear axis"),
        },
        "torque": {
            "nm": Unit("N m", 1.0),
            **dict.fromkeys(("mnm", "nmm"), Unit("mN m", 1e-3)),
            "ncm": Unit("N cm", 1e-2),
            "knm": Unit("kN m", 1e3),
            **dict.fromkeys(("‰", "permille", "promille"), Unit("per mille of the rated torque", None)),
            **dict.fromkeys(("%", "percent", "pct"), Unit("percent of the rated torque", None)),
        },
    }
)


def unit_in(text: str, quantity: Quantity) -> Unit | None:
    """The unit of a quantity that a name like "A1_Pos_deg" or "speed [1/min]" holds; None: it holds none."""
    at_once = re.sub(r"[\s.*·]", "", text)  # "mN m", "N*m"
    words = [at_once, *re.findall(r"[^\W\d_]+(?:/[^\W\d_]+)?|[°‰%](?:/\w+)?|1/min|min-1", text)]
    known = _TABLE[quantity]
    return next((known[word.lower()] for word in reversed(words) if word.lower() in known), None)


_AMPERES = {"a": 1.0, "arms": 1.0, "amp": 1.0, "amps": 1.0, "ampere": 1.0, "ma": 1e-3}


def current_in(text: str) -> float | None:
    """What a unit is in amperes, where it is one of a current; None: it is none."""
    return _AMPERES.get(text.strip().lower())


def unit_passed_over(text: str, quantity: Quantity, factor: float, current: bool = False) -> Unit | None:
    """The unit that a name or a description states, where it is not the SI unit and no factor converts it.

    ``current``: the torque is a current, which its torque constant converts from A.
    """
    unit = Unit(text.strip(), current_in(text)) if current else unit_in(text, quantity)
    return None if unit is None or unit.factor in (None, 1.0) or abs(factor) != 1 else unit


def unit_as_recorded(text: str, quantity: Quantity, factor: float) -> Unit | None:
    """The unit in which values stay, as it depends on the drive and no factor converts it; None: there is none."""
    unit = unit_in(text, quantity)
    return None if unit is None or unit.factor is not None or abs(factor) != 1 else unit


def unit_of(name: str, below: str = "") -> str:
    """The unit of a column: below its name, or in brackets in it; empty: none is there."""
    bracketed = _BRACKETED.search(name)
    return below or (bracketed[1] if bracketed else "")


def without_unit(name: str) -> str:
    """The name of a column without a unit in brackets; other brackets, as of an index, stay."""
    bracketed = _BRACKETED.search(name)
    if bracketed is None or not _is_unit(bracketed[1]):
        return name
    return name[: bracketed.start()] + name[bracketed.end() :]


def _is_unit(text: str) -> bool:
    known = any(unit_in(text, quantity) is not None for quantity in _TABLE)
    return known or current_in(text) is not None


_BRACKETED = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]")
