"""Open alarms of one axis: keeps the alarms that a detector raises, changes or ends, and reports their changes.

One change of the axis is one alarm:

* While an alarm is open, or has just ended, a further change is reported only after it has got a name.  Until then the
  detector may find that the change belongs to the open alarm, and nothing is reported.
* If a cause is detected again not long after its alarm has ended, that alarm is reopened.
* An alarm without a name is reopened if the same test crosses again, also later.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple, TypeVar

import numpy as np

from monitor_core.detection.alarm import Alarm, AlarmKey
from monitor_core.kernel.state import NEVER
from monitor_core.samples import SampleBlock

E = TypeVar("E")

REOPEN_MEMORIES = 30
"""Memory lengths after the end of an alarm during which the same cause reopens it: ten times the time after which an
alarm ends.  The tests of a small change cross their thresholds only that often, and model errors may look like its
end."""
NAMELESS_S = 600.0
"""Time after the end of an alarm without a name during which the same test reopens it [s], if that is longer: a change
that shows in some motions only, as another payload, comes with each of them, and never long enough for a name."""


def reopen_s(memory_s: float) -> float:
    """Longest time after the end of an alarm in which it may be reopened [s], for an axis with this memory [s]."""
    return max(REOPEN_MEMORIES * memory_s, NAMELESS_S)


class AlarmChange(NamedTuple):
    """The change of an alarm in one update (``kind``), and the alarm after it."""

    kind: Literal["raised", "renamed", "updated", "ended", "reopened"]
    alarm: Alarm


class AlarmTracker:
    """The alarms of one axis, the oldest first.

    ``alarms``: alarms that are open, or have ended not long ago.  ``unreported``: open alarms that have no name yet.
    An ended alarm is reopened if its cause is detected again within ``reopen_us``, even if it gets its name later; one
    without a name, if the same test crosses again within ``nameless_us``.
    """

    def __init__(
        self, alarms: Iterable[Alarm] = (), unreported: Iterable[Alarm] = (), reopen_us: int = 0, nameless_us: int = 0
    ) -> None:
        known = list(alarms)
        self._open = {alarm.key: alarm for alarm in known if alarm.ended_us is None}
        self._ended = {alarm.key: alarm for alarm in known if alarm.ended_us is not None}
        self._unreported = {alarm.key: alarm for alarm in unreported}
        self._reopen_us, self._nameless_us = reopen_us, max(reopen_us, nameless_us)

    @property
    def open(self) -> tuple[Alarm, ...]:
        """The open alarms that have been reported."""
        return tuple(self._open.values())

    @property
    def ended(self) -> tuple[Alarm, ...]:
        """Alarms that may be reopened."""
        return tuple(self._ended.values())

    @property
    def unreported(self) -> tuple[Alarm, ...]:
        """Changes without a name, which may belong to another alarm."""
        return tuple(self._unreported.values())

    def is_open(self, parameter: str) -> bool:
        """Whether an open alarm names this parameter (or this other cause)."""
        return any(alarm.parameter == parameter for alarm in self._open.values())

    def adopt(self, open_alarms: Iterable[Alarm], ended: Iterable[Alarm] = ()) -> None:
        """Replace the open alarms, and add ``ended`` alarms that may be reopened."""
        self._open = {alarm.key: alarm for alarm in open_alarms if alarm.ended_us is None}
        self._ended |= {alarm.key: alarm for alarm in ended if alarm.ended_us is not None}
        for key in self._ended:
            self._unreported.pop(key, None)
        for alarms in (self._ended, self._unreported):
            for key in alarms.keys() & self._open.keys():
                del alarms[key]

    def update(
        self, events: Iterable[E], interpret: Callable[[E, Sequence[Alarm]], Iterable[Alarm]]
    ) -> list[AlarmChange]:
        """Take the events of a detector; returns each changed alarm once.

        ``interpret``: makes alarms of an event and of the alarms that are open at that event.
        """
        before, latest = {**self._ended, **self._open}, dict[AlarmKey, Alarm]()
        for event in events:
            for alarm in interpret(event, (*self.open, *self.unreported)):
                if (changed := self._take(alarm)) is not None:
                    latest[changed.key] = changed
        return [_change(before.get(key), alarm) for key, alarm in latest.items()]

    def _take(self, alarm: Alarm) -> Alarm | None:
        """Keep the new form of an alarm; returns the alarm to report, or None if nothing is reported."""
        key = alarm.key
        if key in self._open:
            self._open[key] = alarm
            if alarm.ended_us is not None:
                self._ended[key] = self._open.pop(key)
            return alarm
        self._unreported.pop(key, None)
        if alarm.ended_us is not None:  # the change belonged to another alarm
            return None
        recent = [a for a in self._ended.values() if self._is_recent(a, alarm.raised_us)]
        if alarm.stage == "changed" and (self._open or any(self._is_held(a, alarm.raised_us) for a in recent)):
            self._unreported[key] = alarm
            return None
        self._forget(alarm.raised_us)
        same = (a for a in recent if _cause_of(a) == _cause_of(alarm))
        if (ended := next(same, None)) is not None:
            alarm = self._ended.pop(ended.key).reopened(alarm)
        self._open[alarm.key] = alarm
        return alarm

    def _is_recent(self, ended: Alarm, raised_us: int) -> bool:
        """Whether a change detected at this time may reopen an ended alarm, no matter when the change gets its name."""
        longest_us = self._reopen_us if ended.stage == "named" else self._nameless_us
        return raised_us - (ended.ended_us or 0) <= longest_us

    def _is_held(self, ended: Alarm, raised_us: int) -> bool:
        """Whether a change detected at this time is not reported before it has a name, because of this ended alarm."""
        return raised_us - (ended.ended_us or 0) <= self._reopen_us

    def _forget(self, raised_us: int) -> None:
        """Discard the ended alarms that neither a change now nor one without a name yet can reopen."""
        oldest_us = min([raised_us, *(a.raised_us for a in self._unreported.values())])
        self._ended = {key: a for key, a in self._ended.items() if self._is_recent(a, oldest_us)}


def _cause_of(alarm: Alarm) -> tuple[str, str, str]:
    """What an ended alarm and a new one have in common if the new one reopens it."""
    return alarm.stage, alarm.parameter, alarm.direction


def _change(before: Alarm | None, alarm: Alarm) -> AlarmChange:
    if alarm.ended_us is not None:
        return AlarmChange("ended", alarm)
    if before is None:
        return AlarmChange("raised", alarm)
    if before.ended_us is not None:
        return AlarmChange("reopened", alarm)
    names = [(a.stage, a.parameter, a.direction) for a in (before, alarm)]
    return AlarmChange("updated" if names[0] == names[1] else "renamed", alarm)


# --- Context of an alarm: whether it was raised in the calibrated conditions, and which other causes look alike


Interpret = Callable[[E, Sequence[Alarm]], Iterable[Alarm]]
"""Function that returns the new and changed alarms for an event of a detector and the open alarms."""
LookAlike = Callable[[Alarm], Mapping[str, str] | None]
"""Function that returns other causes of an alarm, by name of the parameter that would seem to change; None: those that
the alarm has stated so far."""


def no_other_causes(_: Alarm) -> Mapping[str, str]:
    """The ``LookAlike`` of an axis without other causes."""
    return {}


def in_context(interpret: Interpret[E], samples: SampleBlock | None, look_alike: LookAlike) -> Interpret[E]:
    """``interpret`` with the context added to its alarms.

    Args:
        interpret: function of a detector.
        samples: the samples of the events; None, or without ``inside``: the calibrated conditions are not known.
        look_alike: other causes of an alarm.
    """

    def interpret_in_context(event: E, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
        before = {alarm.key: alarm for alarm in open_alarms}
        for alarm in interpret(event, open_alarms):
            if samples is not None and alarm.key not in before and alarm.inside_calibration is None:
                alarm = replace(alarm, inside_calibration=_inside(samples, alarm.raised_us))
            yield _with_alike(alarm, look_alike(alarm), before.get(alarm.key))

    return interpret_in_context


def _inside(samples: SampleBlock, t_us: int) -> bool | None:
    """Whether the conditions at that time were within the calibrated ranges; None: not known."""
    at = np.flatnonzero(samples.t_us == t_us)
    return bool(samples.inside[at[0]]) if samples.inside is not None and at.size else None


def _with_alike(alarm: Alarm, names: Mapping[str, str] | None, before: Alarm | None) -> Alarm:
    stated = {cause.parameter: cause.alike for cause in before.causes} if before and names is None else {}
    names = names or {}
    causes = []
    for cause in alarm.causes:
        more = (
            *stated.get(cause.parameter, ()),
            *([names[cause.parameter]] if cause.parameter in names else ()),
        )
        causes.append(cause._replace(alike=tuple(dict.fromkeys((*cause.alike, *more)))))
    return replace(alarm, causes=tuple(causes))


def last_open_us(samples: SampleBlock) -> int:
    """Time [us] of the last sample with an open gate and known conditions; NEVER if there is none."""
    is_open = np.ones(samples.size, np.bool_) if samples.gate is None else samples.gate
    if samples.shift is not None:
        is_open = is_open & np.isfinite(samples.shift).all(axis=1)
    return int(samples.t_us[is_open][-1]) if is_open.any() else NEVER
