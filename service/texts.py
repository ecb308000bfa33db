"""Sentences that several parts of the service share: alarms, untested parameters, long-term trends; times."""

import math
import time
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

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
    Reach,
)
from monitor_core.drive import DELAY, LOAD
from monitor_core.monitoring import AxisStatus, NotTested
from monitor_core.trend import Trend
from monitor_core.wording import listed, sentence

# --- What persons write -----------------------------------------------------------------------------------------------


def control_character(text: str) -> str | None:
    """The first one in a text, but for tabs and line breaks; it could move the cursor of a terminal.

    None: it has none.
    """
    return next((c for c in text if unicodedata.category(c) == "Cc" and c not in "\t\n\r"), None)


# --- An alarm in one sentence -----------------------------------------------------------------------------------------


SURE_CAUSE = 0.95
"""A cause that is likelier needs no second one beside it."""

Z95 = 1.96
"""Half the width of an interval with a probability of 95 %, in standard deviations"""
_VAGUE = 5.0
"""Standard deviation over size, from which on an interval says nothing"""

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
    """An alarm in words, with its certainty: "kT or fm, 60:40; kT is .."."""
    outside = "; raised outside the conditions of the calibration" if e.inside_calibration is False else ""
    return f"{_episode_words(e, nominal, unit)}{outside}"


def _episode_words(e: Alarm, nominal: float, unit: str) -> str:
    if e.stage == "changed":
        return f"something has changed, at first sight {e.parameter}; cause and size are not known yet"
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
    """Empty where the cause is certain, otherwise "kT or fm, 60:40; "."""
    if not causes or causes[0].probability >= SURE_CAUSE:
        return ""
    likely = causes[:3]
    shares = ":".join(f"{100 * cause.probability:.0f}" for cause in likely)
    return f"{' or '.join(cause.parameter for cause in likely)}, {shares}; "


def alarm_words(parameter: str, size: float, nominal: float, unit: str, size_sd: float = math.nan) -> str:
    """An alarm in words: "fm is 0.018 N m s/rad (30 %, 26 to 34) above its nominal value".

    Args:
        parameter: its name, or that of a fault of a sensor.
        size: its estimate minus its nominal value, in ``unit``; infinite: not known.
        nominal: its nominal value, in ``unit``.
        unit: "1" for a ratio.
        size_sd: standard deviation of the size, for the interval with a probability of 95 %; not finite: not known.
    """
    if parameter == DELAY:
        return _skew(size, nominal)
    if parameter == LOAD:
        return _load(size)
    if parameter == INERTIA:
        return _inertia(size)
    amount, more = _digits(abs(size)), "less" if size < 0 else "more"
    if parameter in SENSORS:
        share = _digits(abs(100 * size))
        return SENSORS[parameter].format(share=share, amount=amount, unit=unit, more=more)
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
    """Where the size is with a probability of 95 %; empty: not known, hardly known, or not to be told from the size."""
    low, high = _digits(size - Z95 * sd), _digits(size + Z95 * sd)
    return [f"{low} to {high}"] if sd < _VAGUE * size and low != high else []


def _skew(size: float, nominal: float) -> str:
    """Torque and motion are no longer synchronous: because of the bus, or of the current loop of the drive."""
    now = nominal + size
    if nominal:
        way, acts = "later than usual" if size > 0 else "earlier than usual", _ms(now)
    else:
        way, acts = "late" if size > 0 else "early", "that much"
    if not math.isfinite(size):
        return f"the torque frame is {way}, by how much is not known"
    side = "after" if now > 0 else "before"
    return f"the torque frame is {_ms(size)} {way}: the torque acts {acts} {side} its sample"


def _load(size: float) -> str:
    """Another payload: a change of the operation, and no fault of the drive."""
    more = "less" if size < 0 else "more"
    by = f"{_digits(abs(100 * size))} % {more}" if math.isfinite(size) else more
    return (
        f"the axis carries {by} weight than at its commissioning: another payload, and no fault of its drive"
    )


def _inertia(size: float) -> str:
    """As a payload changes an axis that bears no weight."""
    larger = "smaller" if size < 0 else "larger"
    by = f"{_digits(abs(100 * size))} % {larger}" if math.isfinite(size) else larger
    than = f"{by} than at its commissioning"
    return f"the inertia that the axis moves is {than}: another payload, and no fault of its drive"


def _ms(seconds: float) -> str:
    return f"{_digits(1000 * abs(seconds))} ms"


def _digits(value: float) -> str:
    """Two significant digits, as a size is hardly ever known better; all digits of a whole number."""
    if not math.isfinite(value):
        return "?"
    return f"{value:.0f}" if abs(value) >= 10 else f"{value:.2g}"


# --- Parameters that are not tested: why, and what would help ---------------------------------------------------------


def not_tested_sentences(
    untested: Mapping[NotTested, Sequence[str]], status: AxisStatus, gated_by: str = ""
) -> Iterator[str]:
    """A sentence for each reason: "fm and fc are not tested: .. Needed: ..".

    Args:
        untested: names of the parameters by reason.
        status: of their axis.
        gated_by: the operating condition that excluded the last sample.
    """
    uncertain = listed(untested.get(NotTested.UNCERTAIN, ("another parameter",)))
    for reason, names in untested.items():
        why, needed = (text.format(uncertain=uncertain) for text in _not_tested(reason, status, gated_by))
        yield f"{listed(names)} {'is' if len(names) == 1 else 'are'} not tested: {why}. Needed: {needed}"


def _not_tested(reason: NotTested, status: AxisStatus, gated_by: str) -> tuple[str, str]:
    """Why parameters are not tested, and what would help."""
    if reason is NotTested.SEEDING and status.remedy is not None:
        r = status.remedy
        why = f"P(0) is not found yet, {r.left_s:.3g} of {r.seeding_s:.3g} s of motion are missing"
        needed = f"{r.record_s:.3g} s of motion"
        if r.memory_s is not None and r.memory_s < r.memory_now_s:
            joint = " and joint_state = true" if r.joint_state else ""
            needed += f"; or memory_s = {r.memory_s:g}{joint}, for which the motion so far suffices"
        return why, needed
    if reason is NotTested.NOT_OBSERVED and status.confounded:
        return f"{_WHY[reason]} ({'; '.join(status.confounded)})", _NEEDED[reason]
    if reason is NotTested.CONDITIONS and gated_by:
        return f"{_WHY[reason]} ({gated_by})", _NEEDED[reason]
    return _WHY[reason], _NEEDED[reason]


_MORE_MOTION = "motion that accelerates and has several speeds within memory_s, or a longer memory_s"
_FEWER = "to take {uncertain} out of `monitor`"
_WHY: dict[NotTested, str] = {
    NotTested.NO_SAMPLE: "no sample has been received",
    NotTested.SETTLING: "the predictor is settling after a start, a gap or lost samples",
    NotTested.CONDITIONS: "operating conditions exclude the samples",
    NotTested.WARM_UP: "how warm the axis is after a start or a pause is not known yet; its friction tells",
    NotTested.UNIDENTIFIABLE: "the record of the nominal values does not determine them",
    NotTested.SEEDING: "P(0) was found only shortly before the end",
    NotTested.NOT_OBSERVED: "the motion contains almost no information",
    NotTested.UNCERTAIN: "within memory_s the motion contains so little information that a change by the whole size"
    " would not be found",
    NotTested.BLOCKED: "P(0) is not found, because {uncertain} cannot be determined within memory_s",
    NotTested.NO_THRESHOLD: "the multi-model detector has no threshold",
}
_NEEDED: dict[NotTested, str] = {
    NotTested.NO_SAMPLE: "torque and motion of this axis; `axiswatch listen` shows what is received",
    NotTested.SETTLING: "samples without gaps for longer than settling_time_s",
    NotTested.CONDITIONS: "samples at which every gate is open and every signal is known and within its range",
    NotTested.WARM_UP: "some memories (memory_s) of motion",
    NotTested.UNIDENTIFIABLE: "nominal values from a record of several speeds and accelerations, or from `axiswatch"
    " identify --fix` with one of them, which is then held at its value in the configuration",
    NotTested.SEEDING: "a longer record",
    NotTested.NOT_OBSERVED: _MORE_MOTION,
    NotTested.UNCERTAIN: f"{_MORE_MOTION}, or {_FEWER}",
    NotTested.BLOCKED: f"{_FEWER}, or {_MORE_MOTION}",
    NotTested.NO_THRESHOLD: "another calibration, `axiswatch calibrate`",
}


# --- A long-term trend in a sentence: whether it drifts and when it reaches a limit, always with an interval ----------


SURE_COURSE = 0.9
"""A kind of course that is likelier is reported as it is; less likely ones with their shares."""

_DAY_S = 86400.0
_UNITS = (
    (1.0, "second", 120.0),
    (60.0, "minute", 7200.0),
    (3600.0, "hour", 72 * 3600.0),
    (_DAY_S, "day", 730 * _DAY_S),
)
"""Each with the longest time that is given in it [s]."""
_YEAR_S = 365.25 * _DAY_S
DATED_US = 10**15
"""Earlier times are those of a record without dates."""


def trend_words(name: str, unit: str, t: Trend | None) -> str:
    """fm drifts up by 0.0012 +- 0.0001 N m s/rad per day; or that it is steady, has changed, or is undecided."""
    if t is None:
        return f"{name}: too little data yet to detect a drift"
    p = t.probability
    drift = p["drift"] + p["both"]
    per_day = f"{_amount(abs(t.slope) * _DAY_S, unit, 2)} ± {_amount(t.slope_sd * _DAY_S, '1', 2)} per day"
    way = "up" if t.slope > 0 else "down"
    if drift >= SURE_COURSE:
        after = f" since it changed {_when(t)}" if p["both"] > p["drift"] else ""
        return f"{name} drifts {way} by {per_day}{after}"
    if p["steady"] >= SURE_COURSE:
        return f"{name} is steady: {_amount(t.level, unit)} ± {_amount(t.level_sd, '1', 2)}"
    if p["step"] >= SURE_COURSE:
        change = "rose" if t.change > 0 else "fell"
        size = f"{_amount(abs(t.change), unit, 2)} ± {_amount(t.change_sd, '1', 2)}"
        return f"{name} {change} at once by {size}, {_when(t)}"
    shares = sorted({"steady": p["steady"], "drift": drift, "step": p["step"]}.items(), key=lambda s: -s[1])
    likely = [(kind, share) for kind, share in shares if share >= 0.05]
    kinds, parts = (
        " or ".join(kind for kind, _ in likely),
        ":".join(f"{100 * share:.0f}" for _, share in likely),
    )
    return f"{name}: {kinds}, {parts}; {way} by {per_day} in the mean"


def reach_words(r: Reach, now_us: int) -> str:
    """fm reaches 0.09 N m s/rad in 12 to 20 days.

    Args:
        r: the limit, and when it is reached.
        now_us: the time from which to count.
    """
    limit = _amount(r.limit, r.unit)
    low_s = max(0.0, (r.low_us - now_us) / 1e6)
    if r.state == "beyond":
        side = "above" if r.above else "below"
        return f"{r.name} has been {side} {limit} {_since(r, now_us)}"
    if r.state == "far":
        return f"{r.name} = {limit} is not in sight: not within {_times(low_s)}"
    if r.high_us is None:
        return f"{r.name} reaches {limit} in {_times(low_s)} or later, perhaps never"
    high_s = max(low_s, (r.high_us - now_us) / 1e6)
    return f"{r.name} reaches {limit} in {_times(low_s, high_s)}"


def _since(r: Reach, now_us: int) -> str:
    ends = [r.low_us, r.low_us if r.high_us is None else r.high_us]
    if ends[0] >= DATED_US:
        first, last = (_date(t) for t in ends)
        return f"since {first}" if first == last else f"since a time between {first} and {last}"
    later, sooner = (max(0.0, (now_us - t) / 1e6) for t in ends)
    return f"for {_times(sooner, later)}"


def _when(t: Trend) -> str:
    if t.change_us >= DATED_US:
        return f"about {_date(t.change_us)}"
    return f"about {_times((t.time_us - t.change_us) / 1e6)} before the end"


def _date(t_us: int) -> str:
    return datetime.fromtimestamp(t_us / 1e6, UTC).strftime("%Y-%m-%d %H:%M UTC")


def _times(*seconds: float) -> str:
    """12 to 20 days, 12 days: in the unit of the last."""
    scale, name = _unit(seconds[-1])
    return f"{' to '.join(_round(s / scale) for s in seconds)} {name}s"


def _unit(seconds: float) -> tuple[float, str]:
    return next(((s, name) for s, name, most in _UNITS if seconds <= most), (_YEAR_S, "year"))


def _round(value: float) -> str:
    if value >= 9.95:
        return f"{value:.0f}"
    return f"{value:.1f}".removesuffix(".0")


def _amount(value: float, unit: str, digits: int = 4) -> str:
    """Four digits of a level or a limit, two digits of an uncertain value."""
    return f"{value:.{digits}g}" if unit == "1" else f"{value:.{digits}g} {unit}"


# --- Times at the interfaces: microseconds since 1970 inside, ISO 8601 in UTC outside ---------------------------------


_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)


def now_us() -> int:
    """The time now, microseconds since 1970."""
    return time.time_ns() // 1000


def iso(t_us: int) -> str:
    """ISO 8601 with microseconds and Z, e.g. 2026-03-01T12:00:00.000000Z."""
    return (_EPOCH + t_us * _MICROSECOND).isoformat(timespec="microseconds").replace("+00:00", "Z")


def microseconds(moment: datetime | None) -> int | None:
    """Microseconds since 1970 of a datetime with a time zone."""
    return None if moment is None else (moment - _EPOCH) // _MICROSECOND


def at_place(place: str, error: Mapping[str, Any]) -> str:
    """What pydantic has found wrong at a place, such as a key: its words, and where it is a usual mistake its kind."""
    words, values = error["msg"].removeprefix("Value error, "), error.get("ctx", {})
    for name, sign in _LIMITS.items():
        if name in values:
            template = "{place}: {words}"
            return sentence(
                "out of limits", template, place=place, words=words, limit=f"{sign} {values[name]}"
            )
    if error["type"] == "missing":
        return sentence("key missing", "{place}: {words}", place=place, words=words)
    if error["type"].endswith(("_type", "_parsing")):
        return sentence("other kind", "{place}: {words}", place=place, words=words)
    return f"{place}: {words}"


_LIMITS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
