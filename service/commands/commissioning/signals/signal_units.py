"""Finds the units of the signals of an axis from a record: names, values, a weight, the inertia.

Torque and motion alone show no unit: a thousandth of the torque moves a thousandth of the inertia in the same way.
Evidence of the unit is compared with the configuration; without evidence the report names what would give it.
"""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from monitor_core.identification import TurningWeight, is_about_nominal, top_speed, turning_weight
from monitor_core.wording import Sentence
from service.commands.commissioning.signals import unit_words
from service.commands.commissioning.signals.recorded_axis import FASTEST, SIGNALS, RecordedAxis
from service.config.unit_names import unit_in, unit_passed_over
from service.config.written.corrections import Correction
from service.ingest.records.recorded_units import Signal

_MAX_NOMINAL_RATIO = 2.0
"""Largest factor by which a nominal inertia may be wrong if a unit is to be inferred from it."""
_MAX_MATCH_RATIO = 1.35
"""Factor within which the inertia agrees."""
_COUNTED = 2 * math.pi / 1000
"""Multiple of the nominal inertia with 1000 counts of a turn; with fewer, the unit is one such as degrees."""
_BETWEEN = math.sqrt(2.0)
"""Factor from a power of two to the geometric middle between it and the next."""
_PER_MILLE = (10.0, 1e5)
"""Multiples of the nominal inertia: a rated torque of 0.01 to 100 N m in per mille."""
_MIN_GEAR_RATIO = 2.0
"""A gear with a ratio nearer to 1 cannot be seen in the inertia."""
_DOUBT_MARGIN = 1.5
"""Margin beyond the bounds from a weight at which a configured unit is doubted."""
_SAME_ANGLE = 6.0
"""Largest quotient of the bounds of a ratio from a weight that shows a unit; for counts _BETWEEN squared."""
_TRIED = (0.01, 0.1)
"""Gear ratios from whose inertias that of any other follows"""
_RATIO_OFF = 1.5
"""A smaller error of the ratio cannot be distinguished from one of the nominal inertias."""
_ANGLES: Mapping[str, Mapping[str, float]] = {
    "angle": {"in degrees": math.pi / 180, "in revolutions": 2 * math.pi, "in milliradians": 1e-3},
    "speed": {"in revolutions per minute": math.pi / 30, "in degrees per second": math.pi / 180},
}
"""Units of a motion, with the factor that makes rad or rad/s of them"""


# --- By the names -----------------------------------------------------------------------------------------------------


def by_name(recorded: RecordedAxis) -> Iterator[Correction]:
    """The name of the column or the description of the bus states a unit that the configured factor contradicts."""
    if recorded.agrees:
        return
    for signal in SIGNALS:
        quantity = recorded.quantity(signal)
        unit = unit_passed_over(recorded.unit_text(signal), quantity, recorded.factor(signal))
        if unit is None or unit.factor is None:
            continue
        text = recorded.unit_text(signal)
        reason = unit_words.unit_in_name(recorded.in_tables, quantity, unit.words, text)
        yield Correction(recorded.key(signal), recorded.factor(signal) * unit.factor, reason)


# --- By a weight, which hangs on the true angle -----------------------------------------------------------------------


def by_weight(recorded: RecordedAxis) -> Iterator[Correction]:
    """The torque of a weight repeats after another turn than the configured angle and gear give."""
    ratio = recorded.ratio
    if ratio is None or ratio > _MIN_GEAR_RATIO:
        return
    found = turning_weight(recorded.records[0])
    if found is None or found.least / _DOUBT_MARGIN < ratio < found.most * _DOUBT_MARGIN:
        return
    shows = unit_words.weight_repeats(found.least / ratio, found.most / ratio)
    if not recorded.agrees and (unit := _unit_by_weight(recorded, found, ratio, shows)) is not None:
        yield unit
    elif found.most / found.least < _BETWEEN**2 and "r" in recorded.axis.config.model.nominal:
        value = math.copysign(float(f"{found.ratio:.3g}"), recorded.values["r"])
        yield Correction(("model", "nominal", "r"), value, unit_words.gear_by_weight(shows, found.ratio))


def _unit_by_weight(recorded: RecordedAxis, found: TurningWeight, ratio: float, shows: str) -> Correction | None:
    """The unit with which the weight turns like the arm."""
    before, width = recorded.factor("motion"), found.most / found.least
    counts = 2 * math.pi * ratio / found.ratio / abs(before)
    if recorded.in_whole_numbers("motion") and width < _BETWEEN**2 and counts > 2 * math.pi / _COUNTED:
        return _counts(recorded, counts, shows)
    units = {**_ANGLES[recorded.output], "that of the arm": 1 / ratio}
    for words, factor in units.items():
        if width < _SAME_ANGLE and found.least < ratio * factor < found.most:
            reason = unit_words.unit_shown(shows, unit_words.unit(recorded.output, words))
            return Correction(recorded.key("motion"), before * factor, reason)
    return None


def _counts(recorded: RecordedAxis, counts: float, shows: str) -> Correction:
    """The motion, which is in whole numbers, is in about so many counts of a turn: a power of two, as encoders have."""
    power = round(math.log2(counts))
    value = math.copysign(2 * math.pi / 2**power, recorded.factor("motion"))
    reason = unit_words.counts(unit_words.whole_numbers(shows, recorded.output), counts, power)
    return Correction(recorded.key("motion"), value, reason)


# --- By the nominal inertia -------------------------------------------------------------------------------------------


class _Candidate(NamedTuple):
    """A mistake: the factor by which it enlarges the inertia, its description, the key and its right value."""

    times: float
    words: Sentence
    key: tuple[str, ...]
    value: float


def by_inertia(recorded: RecordedAxis) -> Iterator[Correction]:
    """With one mass, the drive has another inertia than the nominal values give."""
    times = recorded.times_nominal
    if times is None or recorded.shown is None:
        return
    shows = unit_words.inertia(recorded.shown[0], times)
    torque_times = _torque_times(recorded, times)
    # If both are counts, the error of one may compensate that of the other.
    if _is_per_mille(recorded, torque_times):
        yield _per_mille(recorded, torque_times, shows)
    elif is_about_nominal(times):
        return
    elif recorded.in_whole_numbers("motion") and times < _COUNTED:
        yield _counts(recorded, 2 * math.pi / times / abs(recorded.factor("motion")), shows)
    elif (mistake := _nearest(recorded, times)) is not None:
        left = times / mistake.times
        sure = 1 / _MAX_MATCH_RATIO < left < _MAX_MATCH_RATIO
        yield Correction(mistake.key, mistake.value, unit_words.unit_likely(shows, mistake.words, left, sure))


def _torque_times(recorded: RecordedAxis, times: float) -> float:
    """Factor by which the torque is too large: by Coulomb friction if both signals may be wrong, or by the inertia."""
    friction = recorded.values.get("fc", 0.0)
    shown = 0.0 if recorded.shown is None else recorded.shown[1]
    return shown / friction if friction > 0 and shown > 0 and recorded.in_whole_numbers("motion") else times


def _is_per_mille(recorded: RecordedAxis, times: float) -> bool:
    """Whether a torque that is so many times too large is likely in per mille of the rated one."""
    is_torque = recorded.axis.config.torque.kT_Nm_per_A is None
    return is_torque and recorded.in_whole_numbers("torque") and _PER_MILLE[0] < times < _PER_MILLE[1]


def _per_mille(recorded: RecordedAxis, times: float, shows: str) -> Correction:
    before = recorded.factor("torque")
    rated = float(f"{1000 * abs(before) / times:.2g}")
    reason = unit_words.per_mille(unit_words.whole_numbers(shows, "torque"), rated)
    return Correction(recorded.key("torque"), math.copysign(rated / 1000, before), reason)


def _nearest(recorded: RecordedAxis, times: float) -> _Candidate | None:
    """The mistake that explains this inertia; None: no common mistake does."""
    found = min(_candidates(recorded), key=lambda c: abs(math.log(times / c.times)))
    return found if 1 / _MAX_NOMINAL_RATIO < times / found.times < _MAX_NOMINAL_RATIO else None


def _candidates(recorded: RecordedAxis) -> Iterator[_Candidate]:
    motion, torque = recorded.factor("motion"), recorded.factor("torque")
    key, name, ratio = recorded.key("motion"), recorded.output, recorded.ratio
    for words, factor in _ANGLES[name].items():
        yield _Candidate(factor, unit_words.unit(name, words), key, motion * factor)
    yield _Candidate(1e3, unit_words.unit("torque", "in N mm"), recorded.key("torque"), torque * 1e-3)
    times: dict[Signal, float] = {"torque": abs(torque), "motion": 1 / abs(motion)}
    for signal, factor in times.items():
        if not 1 / _MIN_GEAR_RATIO < factor < _MIN_GEAR_RATIO:
            what = unit_words.no_factor(recorded.quantity(signal))
            yield _Candidate(factor, what, recorded.key(signal), math.copysign(1.0, recorded.factor(signal)))
    if ratio is None or 1 / _MIN_GEAR_RATIO < ratio < _MIN_GEAR_RATIO:
        return
    yield _Candidate(1 / ratio, unit_words.unit(name, "that of the arm"), key, motion / ratio)
    degrees = math.pi / 180 / ratio
    yield _Candidate(degrees, unit_words.unit(name, "that of the arm, in degrees"), key, motion * degrees)


# --- By the gear ratio, where it can be seen --------------------------------------------------------------------------


def by_ratio(recorded: RecordedAxis) -> Iterator[Correction]:
    """The configured gear makes the arm faster than the motor, or does not agree with the nominal inertias."""
    given, key = recorded.axis.config.model.nominal.get("r"), ("model", "nominal", "r")
    if given is None or recorded.ratio is None:
        return
    if recorded.ratio > _MIN_GEAR_RATIO:
        yield Correction(key, 1 / given, unit_words.gear_turned(given))
        return
    times = recorded.times_nominal
    if times is None or _nearest(recorded, times) is not None or any(map(recorded.in_whole_numbers, SIGNALS)):
        return
    assert recorded.shown is not None
    found = _fitting_ratio(recorded, recorded.shown[0])
    if found is not None and not 1 / _RATIO_OFF < found / recorded.ratio < _RATIO_OFF:
        reason = unit_words.gear_by_inertia(unit_words.inertia(recorded.shown[0], times), found)
        yield Correction(key, math.copysign(float(f"{found:.3g}"), given), reason)


def _fitting_ratio(recorded: RecordedAxis, inertia: float) -> float | None:
    """The ratio with which the nominal inertias, motor + r^2 arm, give this one; None: no ratio below 1 does."""
    low, high = (recorded.inertia_with({"r": ratio}) for ratio in _TRIED)
    arm = (high - low) / (_TRIED[1] ** 2 - _TRIED[0] ** 2)
    motor = low - arm * _TRIED[0] ** 2
    if not (0 < motor < inertia and arm > 0):
        return None
    found = math.sqrt((inertia - motor) / arm)
    return found if found < 1 / _MIN_GEAR_RATIO else None


# --- By how fast a motor can turn -------------------------------------------------------------------------------------


def by_speed(recorded: RecordedAxis) -> Iterator[Correction]:
    """No motor turns as fast as the motion would be if it were in radians."""
    if recorded.agrees or recorded.in_whole_numbers("motion") or recorded.output == "speed":
        return
    unit = unit_in(recorded.unit_text("motion"), recorded.output)
    if unit is not None and unit.linear:
        return  # of a linear axis: fast in mm/s
    speed = top_speed(recorded.records)
    if FASTEST < speed < FASTEST * 180 / math.pi:
        yield Correction(recorded.key("motion"), recorded.factor("motion") * math.pi / 180, unit_words.too_fast(speed))
