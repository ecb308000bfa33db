"""Recognises units in column names and in the units of bus signals, with their factors to SI units."""

import math
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

MeasuredQuantity = Literal["torque", "angle", "speed"]
UNITS: Mapping[str, str] = MappingProxyType({"torque": "N m", "angle": "rad", "speed": "rad/s"})
"""SI units of the measured quantities of an axis"""


class Unit(NamedTuple):
    """A unit; ``factor``: factor to the SI unit; None: it depends on the drive."""

    words: str
    factor: float | None
    linear: bool = False
    """Whether it is a unit of length, as for a linear axis: the factor is 2 pi / (path of one turn of the motor)"""

    @property
    def missing(self) -> str:
        """The factor of a unit that depends on the drive, in words."""
        if self.linear:
            return "2 pi / (mm that a turn of the motor moves it)"
        if "rated torque" not in self.words:
            return f"2 pi / ({self.words} in a turn of the motor)"
        return f"rated torque / {1000 if self.words.startswith('per mille') else 100} [N m]"


_DEGREE, _TURN = math.pi / 180, 2 * math.pi
_COUNTS = Unit("counts", None)
_PATH = Unit("mm of a linear axis", None, linear=True)
_TABLE: Mapping[MeasuredQuantity, Mapping[str, Unit]] = MappingProxyType(
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
            **dict.fromkeys(("rpm", "1/min", "u/min", "rev/min", "min-1"), Unit("revolutions per minute", _TURN / 60)),
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


def unit_in(text: str, quantity: MeasuredQuantity) -> Unit | None:
    """The unit of a quantity in a name like "A1_Pos_deg" or "speed [1/min]"; None: the name has none."""
    at_once = re.sub(r"[\s.*·]", "", text)  # "mN m", "N*m"
    words = [at_once, *re.findall(r"[^\W\d_]+(?:/[^\W\d_]+)?|[°‰%](?:/\w+)?|1/min|min-1", text)]
    known = _TABLE[quantity]
    return next((known[word.lower()] for word in reversed(words) if word.lower() in known), None)


_AMPERES = {"a": 1.0, "arms": 1.0, "amp": 1.0, "amps": 1.0, "ampere": 1.0, "ma": 1e-3}


def current_in(text: str) -> float | None:
    """Factor of a unit of current to amperes; None: it is no unit of current."""
    return _AMPERES.get(text.strip().lower())


def unit_passed_over(text: str, quantity: MeasuredQuantity, factor: float, current: bool = False) -> Unit | None:
    """A non-SI unit in a name or description that no factor converts; None: there is none.

    ``current``: the torque signal is a current, which the torque constant converts from A.
    """
    unit = Unit(text.strip(), current_in(text)) if current else unit_in(text, quantity)
    return None if unit is None or unit.factor in (None, 1.0) or abs(factor) != 1 else unit


def unit_as_recorded(text: str, quantity: MeasuredQuantity, factor: float) -> Unit | None:
    """A unit that depends on the drive and that no factor converts; None: there is none."""
    unit = unit_in(text, quantity)
    return None if unit is None or unit.factor is not None or abs(factor) != 1 else unit


def unit_of(name: str, below: str) -> str:
    """The unit of a column: ``below`` its name, or in brackets in the name; empty: none."""
    bracketed = _BRACKETED.search(name)
    return below or (bracketed[1] if bracketed else "")


def without_unit(name: str) -> str:
    """The name of a column without a unit in brackets; other brackets, such as an index, stay."""
    bracketed = _BRACKETED.search(name)
    if bracketed is None or not _is_unit(bracketed[1]):
        return name
    return name[: bracketed.start()] + name[bracketed.end() :]


def _is_unit(text: str) -> bool:
    known = any(unit_in(text, quantity) is not None for quantity in _TABLE)
    return known or current_in(text) is not None


_BRACKETED = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]")
