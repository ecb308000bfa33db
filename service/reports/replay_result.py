"""What a replay found, as its report needs it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from monitor_core.detection import Alarm
from monitor_core.monitoring import AxisStatus, ParameterTrend
from service.pipeline.alarms import Quantity
from service.reports.replay_course import Course
from service.reports.text_format import plain
from service.texts.timestamps import iso


class ReplayedAxis(NamedTuple):
    """One axis after its records."""

    id: str
    drive: str
    status: AxisStatus
    course: Course
    alarms: Sequence[Alarm]
    quantities: Mapping[str, Quantity]
    """Unit and nominal value of whatever its alarms name"""
    dropped: Mapping[str, int]
    """What never reached the monitor, by reason"""
    clock: Mapping[str, int]
    """How often its time line restarted, by cause"""
    trends: Sequence[ParameterTrend]
    """Slow courses, of parameters of which enough is known"""
    notes: Sequence[str]
    """What cannot be told, and what its time stamps say, in words"""


class Replayed(NamedTuple):
    """All axes, and where the samples come from."""

    axes: Sequence[ReplayedAxis]
    frames_dropped: Mapping[str, Mapping[str, int]]
    records: Sequence[str]
    config: str
    command: str
    version: str
    date: str


# --- Times and reasons of a replay in words ---------------------------------------------------------------------------


_DATED_US = 10**15
"""In 2001: times before are those of a record without dates."""
REASONS: Mapping[str, str] = MappingProxyType(
    {
        "used": "learned from",
        "seeding": "taken to find P(0)",
        "settling": "while the predictor settled, after its start or after lost samples",
        "gated": "while operating conditions forbade it, or were not known",
        "outlier": "far from their prediction, passed over",
        "starved": "while there was nothing to learn: the axis hardly moved",
        "started": "the predictor started with them",
        "gap": "after a gap, or a clock that was set: the predictor restarted",
        "not_finite": "not finite",
        "not_increasing": "not after the sample before",
        "diverged": "at which the prediction left the finite numbers",
        "projected": "at which a bound held an estimate (these are among the others, too)",
        "absurd": "beyond physical limits",
        "repeated": "the same again within half an interval",
        "out_of_order": "not after the last sample",
        "untimed": "the counter or the fitted clock contradicts the time of receipt",
        "unpaired": "torque or motion without its partner",
        "late": "arrived after its partner had been dropped",
        "missing": "samples that never came",
        "ambiguous": "more than half a turn since the sample before: which way is not known",
        "unwanted": "no axis asks for them",
        "too_short": "shorter than their message",
        "undecodable": "contradict the DBC file",
        "signal_absent": "of a multiplexed message, without the signal that was wanted",
        "other_bus": "of a bus that the configuration does not have",
        "clock_reanchored": "the time line of the samples restarted",
        "clock_set_back": "the clock of the receiver was set back",
    }
)
"""Of counters of samples, values, frames and clocks."""


class TimeUnit(NamedTuple):
    """In which times of a record are written."""

    name: str
    seconds: float

    def written(self, s: float | None) -> str:
        """A time to four digits at least, such as 5.21 s."""
        if s is None:
            return ""
        value = s / self.seconds
        return f"{value:.{2 if value < 1000 else 0}f} {self.name}"


def time_unit(length_s: float) -> TimeUnit:
    """That of a record of such a length."""
    for name, seconds, most in (("s", 1.0, 600.0), ("min", 60.0, 4 * 3600.0), ("h", 3600.0, 4 * 86400.0)):
        if length_s <= most:
            return TimeUnit(name, seconds)
    return TimeUnit("d", 86400.0)


def duration(s: float) -> str:
    """A time such as 10 s, 3 h or 4 d, to two digits."""
    for name, seconds, most in (("s", 1.0, 120.0), ("min", 60.0, 7200.0), ("h", 3600.0, 172800.0)):
        if abs(s) <= most:
            return f"{plain(abs(s) / seconds, 2)} {name}"
    return f"{plain(abs(s) / 86400, 2)} d"


def dated(t_us: int | None) -> str:
    """A time in UTC to a tenth of a second; empty where the times of the record have no date."""
    return "" if t_us is None or t_us < _DATED_US else iso(t_us)[:21].replace("T", " ")
