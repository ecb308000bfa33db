"""Describes an alarm in one sentence, with its certainty."""

import math
from collections.abc import Sequence

from monitor_core.detection import (
    INERTIA,
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
from monitor_core.drive import DELAY, LOAD
from monitor_core.wording import Z90, listed
from service.texts.trend_words import reach_words

SURE_CAUSE = 0.95
"""Probability above which a cause is named without a second one"""

_VAGUE = 5.0
"""Ratio of standard deviation to size above which an interval is not informative"""

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
    TORQUE_SCALE: "the torque that acts is {share}{more} than the measured one, by its scale",
    OUTPUT_SCALE: "the measured motion is {share}{more} than the true one, by its scale",
    TORQUE_OFFSET: "the torque that acts is {amount}{more} than the measured one, always",
    OUTPUT_OFFSET: "the measured motion is {amount}{more} than the true one, always",
    OUTPUT_NOISE: "the measured motion is noisier than it was{by}",
}
"""Faults of sensors, which the multi-model detector may name."""


def episode_words(e: Alarm, nominal: float, unit: str, same_payload: Sequence[str] = ()) -> str:
    """An alarm in words, with its certainty: "kT or fm, 60:40; kT is ..".

    ``same_payload``: the other axes whose alarms the same change of the payload explains.
    """
    also = ""
    if same_payload:
        likelier = "another payload is likelier than a fault of each"
        also = f"; {listed(same_payload)} changed at that time, too: {likelier}"
    outside = "; raised outside the conditions of the calibration" if e.inside_calibration is False else ""
    return f"{_episode_words(e, nominal, unit)}{also}{outside}"


def _episode_words(e: Alarm, nominal: float, unit: str) -> str:
    if e.stage == "changed":
        known = "are not known yet" if e.ended_us is None else "did not become known"
        return f"something has changed, at first sight {e.parameter}; cause and size {known}"
    size = e.size
    if size is None:
        size = -math.inf if e.direction == "down" else math.inf
    fact = alarm_words(e.parameter, size, nominal, unit, math.nan if e.size_sd is None else e.size_sd)
    if e.reaches:
        return "; ".join([*(reach_words(r, e.updated_us) for r in e.reaches), f"now {fact}"])
    if e.doubt:
        return DOUBTS[e.doubt].format(parameter=e.parameter, fact=fact)
    drifts = f", and drifts {e.direction}" if e.kind == "drift" else ""
    return f"{_which(e.causes)}{fact}{drifts}{_alike(e.parameter, e.causes)}"


def _alike(parameter: str, causes: tuple[Cause, ...]) -> str:
    alike = next((cause.alike for cause in causes if cause.parameter == parameter), ())
    others = ["another payload" if name == LOAD else name for name in alike]
    return f"; {' or '.join(others)} would look the same" if alike else ""


def _which(causes: tuple[Cause, ...]) -> str:
    """The alternatives, such as "kT or fm, 60:40; "; empty if the cause is certain."""
    if not causes or causes[0].probability >= SURE_CAUSE:
        return ""
    likely = causes[:3]
    shares = ":".join(f"{100 * cause.probability:.0f}" for cause in likely)
    return f"{' or '.join(cause.parameter for cause in likely)}, {shares}; "


def alarm_words(parameter: str, size: float, nominal: float, unit: str, size_sd: float = math.nan) -> str:
    """An alarm in words: "fm is 0.018 N m s/rad (30 %, 26 to 34) above its nominal value".

    Args:
        parameter: name of the parameter or of the fault of a sensor.
        size: its estimate minus its nominal value, in ``unit``; infinite: not known.
        nominal: its nominal value, in ``unit``.
        unit: "1" for a ratio.
        size_sd: standard deviation of the size, for the interval with a probability of 90 %; not finite: not known.
    """
    if parameter == DELAY:
        return _skew(size, nominal)
    if parameter == LOAD:
        return _payload("the load on the axis is {by}", size)
    if parameter == INERTIA:  # of an axis that bears no weight
        # Where friction is small, or deviates itself, a motor that is weaker by the same factor shows the same.
        motor = _by(-size / (1 + size) if math.isfinite(size) and size > -1 else -size)
        words = _payload("the inertia that the axis moves is {by}", size)
        return f"{words}; if it carries the same as then, kT is {motor}"
    amount, more = _digits(abs(size)), "less" if size < 0 else "more"
    if parameter in SENSORS:
        if not math.isfinite(size):
            return SENSORS[parameter].format(share="", amount="", by="", more=more)
        share = f"{_digits(abs(100 * size))} %"
        return SENSORS[parameter].format(share=f"{share} ", amount=f"{amount} {unit} ", by=f", by {share}", more=more)
    side = "below" if size < 0 else "above"
    if not math.isfinite(size):
        return f"{parameter} is {side} its nominal value, by how much is not known"
    amount += "" if unit == "1" else f" {unit}"
    scale = 100 / abs(nominal) if nominal else 1.0
    known = ", ".join(
        [
            *([f"{_digits(scale * abs(size))} %"] if nominal else []),
            *_interval(scale * abs(size), scale * size_sd),
        ]
    )
    return f"{parameter} is {amount}{f' ({known})' if known else ''} {side} its nominal value"


def _interval(size: float, sd: float) -> list[str]:
    """Interval that contains the size with a probability of 90 %; empty: unknown, too uncertain, or not derivable."""
    low, high = _digits(size - Z90 * sd), _digits(size + Z90 * sd)
    return [f"{low} to {high}"] if sd < _VAGUE * size and low != high else []


def _skew(size: float, nominal: float) -> str:
    """Message that torque and motion are no longer synchronous, because of the bus or the drive's current loop."""
    now = nominal + size
    if nominal:
        way, acts = "later than usual" if size > 0 else "earlier than usual", _ms(now)
    else:
        way, acts = "late" if size > 0 else "early", "that much"
    if not math.isfinite(size):
        return f"the torque frame is {way}, by how much is not known"
    side = "after" if now > 0 else "before"
    return f"the torque frame is {_ms(size)} {way}: the torque acts {acts} {side} its sample"


def _payload(words: str, size: float) -> str:
    """Message about another payload: a change of the operation, and no fault of the drive."""
    return f"{words.format(by=_by(size))} than at its commissioning: another payload, and no fault of its drive"


def _by(size: float) -> str:
    """A relative change, such as "19 % smaller"; only its direction if it is infinite."""
    way = "smaller" if size < 0 else "larger"
    return f"{_digits(abs(100 * size))} % {way}" if math.isfinite(size) else way


def _ms(seconds: float) -> str:
    return f"{_digits(1000 * abs(seconds))} ms"


def _digits(value: float) -> str:
    """Two significant digits, since a size is rarely known better; all digits of a whole number."""
    if not math.isfinite(value):
        return "?"
    return f"{value:.0f}" if abs(value) >= 10 else f"{value:.2g}"
