"""An alarm in one sentence."""

import math

from monitor_core.detection import (
    OUTPUT_NOISE,
    OUTPUT_OFFSET,
    OUTPUT_SCALE,
    OUTPUT_SIGN,
    OUTPUT_STUCK,
    TORQUE_LOST,
    TORQUE_OFFSET,
    TORQUE_SCALE,
    TORQUE_SIGN,
    TORQUE_STUCK,
    Alarm,
    Cause,
    Doubt,
)
from monitor_core.drive import DELAY
from service.texts.trend_texts import reach_words

SURE = 0.95
"""A cause that is likelier needs no second one beside it."""

DOUBTS: dict[Doubt, str] = {
    "several": "more than one parameter has changed, or none of them; nearest is {parameter}: {fact}",
    "model": "the model no longer holds, as if a sensor were wrong; nearest is {parameter}: {fact}",
    "sign": "the motion does not follow the torque, as if one of them had changed its sign or were stuck",
    "still": "no motion follows the torque: the sensor or the axis is stuck, or the drive is off",
}

SENSORS = {
    TORQUE_SIGN: "the measured torque has changed its sign",
    OUTPUT_SIGN: "the measured motion has changed its sign",
    TORQUE_STUCK: "the measured torque is stuck: it stays the same while another one acts",
    TORQUE_LOST: "the torque that acts is not the measured one: its signal is lost, or another one",
    OUTPUT_STUCK: "the measured motion is stuck: it repeats itself in every digit",
    TORQUE_SCALE: "the torque that acts is {share} % {more} than the measured one, by its scale",
    OUTPUT_SCALE: "the measured motion is {share} % {more} than the true one, by its scale",
    TORQUE_OFFSET: "the torque that acts is {amount} {unit} {more} than the measured one, always",
    OUTPUT_OFFSET: "the measured motion is {amount} {unit} {more} than the true one, always",
    OUTPUT_NOISE: "the measured motion is noisier than it was, by {share} %",
}
"""Faults of sensors, which the multi-model detector may name."""


def episode_words(e: Alarm, nominal: float, unit: str) -> str:
    """An alarm in words, with its certainty: "something has changed, at first sight fm: fm is .."."""
    fact = alarm_words(e.parameter, e.size, nominal, unit)
    if e.reaches:
        return "; ".join([*(reach_words(r, e.updated_us) for r in e.reaches), f"now {fact}"])
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
    amount, more = _digits(abs(size)), "less" if size < 0 else "more"
    if parameter in SENSORS:
        share = _digits(abs(100 * size))
        return SENSORS[parameter].format(share=share, amount=amount, unit=unit, more=more)
    share = f" ({_digits(abs(100 * size / nominal))} %)" if nominal else ""
    amount += "" if unit == "1" else f" {unit}"
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
