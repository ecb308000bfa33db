"""An alarm in one sentence."""

import math
from typing import Protocol

from monitor_core.detection import Cause, Doubt, Kind, Reach, Stage
from monitor_core.drive import DELAY
from service.texts.sensor_texts import sensor_words
from service.texts.trend_texts import reach_words

SURE = 0.95
"""A cause that is likelier needs no second one beside it."""

DOUBTS: dict[Doubt, str] = {
    "several": "more than one parameter has changed, or none of them; nearest is {parameter}: {fact}",
    "model": "the model no longer holds, as if a sensor were wrong; nearest is {parameter}: {fact}",
    "sign": "the motion does not follow the torque, as if one of them had changed its sign or were stuck",
    "still": "no motion follows the torque: the sensor or the axis is stuck, or the drive is off",
}


class Told(Protocol):
    """Interface of an alarm, open or from the journal."""

    @property
    def parameter(self) -> str:
        """The best present name."""

    @property
    def size(self) -> float:
        """Estimate minus nominal."""

    @property
    def stage(self) -> Stage:
        """Whether it has a name."""

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The most likely first."""

    @property
    def doubt(self) -> Doubt:
        """Why none of them may be the cause."""

    @property
    def kind(self) -> Kind:
        """Step or drift, or a forecast."""

    @property
    def reaches(self) -> tuple[Reach, ...]:
        """Of a forecast: the limit."""

    @property
    def updated_us(self) -> int:
        """Time of the last update."""


def episode_words(e: Told, nominal: float, unit: str) -> str:
    """An alarm in words, with its certainty: "something has changed, at first sight fm: fm is .."."""
    if e.reaches:
        fact = alarm_words(e.parameter, e.size, nominal, unit)
        return "; ".join([*(reach_words(r, e.updated_us) for r in e.reaches), f"now {fact}"])
    fact = alarm_words(e.parameter, e.size, nominal, unit)
    if e.stage == "changed":
        return f"something has changed, at first sight {e.parameter}: {fact}"
    if e.doubt:
        return DOUBTS[e.doubt].format(parameter=e.parameter, fact=fact)
    drifts = f", and drifts {'down' if e.size < 0 else 'up'}" if e.kind == "drift" else ""
    return f"{_which(e.causes)}{fact}{drifts}{_alike(e.parameter, e.causes)}"


def _alike(parameter: str, causes: tuple[Cause, ...]) -> str:
    """Other causes that would produce the same data."""
    alike = next((cause.alike for cause in causes if cause.parameter == parameter), ())
    return f"; {' or '.join(alike)} would look the same" if alike else ""


def _which(causes: tuple[Cause, ...]) -> str:
    """Empty where the cause is certain, otherwise "kT or fm, 60:40; "."""
    if not causes or causes[0].probability >= SURE:
        return ""
    likely = causes[:3]
    shares = ":".join(f"{100 * cause.probability:.0f}" for cause in likely)
    return f"{' or '.join(cause.parameter for cause in likely)}, {shares}; "


def alarm_words(parameter: str, size: float, nominal: float, unit: str) -> str:
    """An alarm in words: "fm is 0.018 N m s/rad (30 %) above its nominal value".

    Args:
        parameter: its name, or that of a fault of a sensor.
        size: its estimate minus its nominal value, in ``unit``.
        nominal: its nominal value, in ``unit``.
        unit: "1" for a ratio.
    """
    if parameter == DELAY:
        return _skew(size, nominal)
    share = f" ({_digits(abs(100 * size / nominal))} %)" if nominal else ""
    sensor = sensor_words(parameter, size, unit, lambda value: _digits(abs(value)))
    if sensor is not None:
        return sensor
    amount = _digits(abs(size)) + ("" if unit == "1" else f" {unit}")
    return f"{parameter} is {amount}{share} {'below' if size < 0 else 'above'} its nominal value"


def _skew(size: float, nominal: float) -> str:
    """Torque and motion are no longer synchronous: because of the bus, or of the current loop of the drive."""
    now = nominal + size
    if nominal:
        way, acts = "later than usual" if size > 0 else "earlier than usual", _ms(now)
    else:
        way, acts = "late" if size > 0 else "early", "that much"
    side = "after" if now > 0 else "before"
    return f"the torque frame is {_ms(size)} {way}: the torque acts {acts} {side} its sample"


def _ms(seconds: float) -> str:
    return f"{_digits(1000 * abs(seconds))} ms"


def _digits(value: float) -> str:
    """Two significant digits, as a size is hardly ever known better; all digits of a whole number."""
    if not math.isfinite(value):
        return "?"
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"
