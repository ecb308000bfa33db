"""Alarms of the CUSUM tests: raised at a crossing, named by likelihood ratios of single faults, ended on recovery.

* The first crossing raises one alarm, "something has changed".  Until it is named, crossings of any parameter belong to
  it.  So a first crossing of the wrong parameter is not a second alarm: the name is corrected, the earlier one is kept.
* The name comes from the likelihood ratios of single faults (isolation.py), with the probabilities of all causes.
* While a named alarm is open, a crossing of another parameter raises a second alarm.  Its cause is isolated given the
  first: the named parameters may have changed by any amount, and the others are judged without them.  Nominal values
  and tests are not modified, so nothing has to be restored when the first fault is repaired.  If no other parameter
  stands out then, the second alarm belongs to the first and ends; if another single parameter explains everything, the
  first alarm is renamed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import NO_PARAMETER, Alarm, AlarmKey, Cause, Doubt, Kind, direction_of
from monitor_core.detection.change_time import SURE
from monitor_core.detection.cusum.cusum_events import Crossing, CusumEvent, Evidence, Recovered
from monitor_core.detection.detector import (
    MIN_PROBABILITY,
    AlarmEvent,
    CauseNamed,
    DetectedAgain,
    DetectorName,
    Ended,
    Leading,
    Onset,
    Raised,
    SizeUpdated,
)
from monitor_core.detection.isolation import Causes, single_faults, sizes
from monitor_core.detection.onset import change_of, scatter

DISMISSED = 0.05
"""An alarm is renamed when the probability of its cause falls below this."""

MODEL_LOST = 100.0
"""Innovation variance over lambda_0 above which the model does not hold (errors ten times as large)."""

UNEXPLAINED = 2.0
"""Innovation variance over lambda_0 of a motion that the torque does not explain."""

FIRST_CROSSING_ODDS = 8.0
"""Prior odds of the parameter that crossed first against each other one: among eight parameters it was the right one in
55 of 100 large changes, and more often for small changes."""

TORQUE_CONSTANT = "kT"


class CusumDetector:
    """The CUSUM tests of one axis.  The kernel computes g (paper eq. 21-23); this class makes alarms of the crossings.

    Args:
        parameters: names of the monitored parameters (p,).
        g: test variables of both directions (2, p), a view of the state.
        h: thresholds (p,), a view of the constants.
        calm: samples without deviation so far (p,), a view of the state.
    """

    name: DetectorName = "cusum"

    def __init__(self, parameters: tuple[str, ...], g: Floats, h: Floats, calm: NDArray[np.int64]) -> None:
        self.causes = parameters
        self._g, self._h, self._calm = g, h, calm

    def leading(self) -> Leading:
        """The parameter whose test is nearest its threshold, and g / h."""
        evidence = self._g.max(axis=0) / self._h
        i = int(evidence.argmax())
        return Leading(self.causes[i], float(evidence[i]))

    def adopt(self, alarms: Iterable[Alarm], previous: Iterable[Alarm]) -> None:
        """Take over open alarms: a recovery is reported once only, so it is counted from now for a new alarm."""
        known = {alarm.parameter for alarm in previous}
        for alarm in alarms:
            if alarm.parameter not in known:
                self._calm[self.causes.index(alarm.parameter)] = 0

    def interpret(self, event: CusumEvent, open_alarms: Sequence[Alarm]) -> list[AlarmEvent]:
        """What a crossing, a recovery or new evidence means for the open alarms."""
        return list(interpret(event, open_alarms))


def interpret(event: CusumEvent, open_alarms: Sequence[Alarm]) -> Iterator[AlarmEvent]:
    """As ``CusumDetector.interpret``: it needs nothing but the open alarms."""
    if isinstance(event, Crossing):
        yield from _crossing(event, open_alarms)
    elif isinstance(event, Recovered):
        yield from (Ended(a.key, event.time_us) for a in open_alarms if a.parameter == event.parameter)
    elif event.past is not None and open_alarms:
        yield from _evidence(event, open_alarms)


def _crossing(c: Crossing, open_alarms: Sequence[Alarm]) -> Iterator[AlarmEvent]:
    unnamed = [a for a in open_alarms if a.stage == "changed"]
    same = [a for a in open_alarms if a.parameter == c.parameter]
    if same:
        yield SizeUpdated(same[0].key, c.time_us, c.direction, c.size, c.size_sd, crossings=1)
    elif unnamed:
        yield DetectedAgain(unnamed[0].key, c.time_us)
    elif not any(
        a.doubt in NO_PARAMETER for a in open_alarms
    ):  # otherwise all estimates drift away: one alarm is enough
        yield Raised(
            Alarm(
                parameter=c.parameter,
                direction=c.direction,
                onset_us=c.onset_us,
                raised_us=c.time_us,
                updated_us=c.time_us,
                ended_us=None,
                size=c.size,
                size_sd=c.size_sd,
                crossings=1,
            )
        )


def _evidence(e: Evidence, open_alarms: Sequence[Alarm]) -> Iterator[AlarmEvent]:
    named = [a for a in open_alarms if a.stage == "named"]
    unnamed = [a for a in open_alarms if a.stage == "changed"]
    if not named:
        causes = _causes(e, unnamed[0])
        no_parameter = _doubt(e, causes.best, causes) in NO_PARAMETER
        if no_parameter or causes.stands_out(
            e.tolerance
        ):  # otherwise wait for more evidence, or for recovery
            yield _name(unnamed[0], e, causes, alone=True)
    elif unnamed:
        yield from _second_alarm(unnamed[0], named, e)
    elif len(named) == 1:
        yield from _single_alarm(named[0], e)
    else:
        yield from _new_sizes(e, [(a.key, a.parameter) for a in named])


def _second_alarm(new: Alarm, named: Sequence[Alarm], e: Evidence) -> Iterator[AlarmEvent]:
    """Name the newer alarm given the older ones, or find that it belongs to them."""
    others = _causes(e, new, named)
    alone = _causes(e, new)
    changed = [(a.key, a.parameter) for a in named]
    if e.parameters[alone.best] not in {a.parameter for a in named} and alone.explains(e.tolerance):
        yield from (Ended(a.key, e.time_us) for a in (new, *named[1:]))
        yield _name(named[0], e, alone, alone=True)
        changed = [(named[0].key, e.parameters[alone.best])]
    elif others.stands_out(e.tolerance):
        yield _name(new, e, others, alone=False)
        changed.append((new.key, e.parameters[others.best]))
    else:
        yield Ended(new.key, e.time_us)
        yield DetectedAgain(named[0].key, e.time_us, new.crossings)
    yield from _new_sizes(e, changed)


def _single_alarm(alarm: Alarm, e: Evidence) -> Iterator[AlarmEvent]:
    """The only alarm in the light of new evidence; it is renamed only where its cause has become unlikely."""
    causes = _causes(e, alarm)
    i, parameter = e.parameters.index(alarm.parameter), alarm.parameter
    reported: tuple[Cause, ...] | None = None
    doubt: Doubt | None = None
    if causes.stands_out(e.tolerance):  # otherwise it is about to end
        if causes.probability[i] < DISMISSED and causes.explains(e.tolerance):
            yield _name(alarm, e, causes, alone=True)
            parameter = e.parameters[causes.best]
        elif causes.best == i:
            reported = _reported(e, causes)
            doubt = alarm.doubt if alarm.doubt in NO_PARAMETER else _doubt(e, i, causes)
    yield from _new_sizes(e, [(alarm.key, parameter)], reported, doubt)


def _name(alarm: Alarm, e: Evidence, causes: Causes, alone: bool) -> CauseNamed:
    """The likeliest cause with its size, and with the onset as far as the kept past shows it."""
    i = causes.best
    ((size, size_sd),) = _sizes(e, [i])
    onset, kind = _onset(alarm, e, i, alone and causes.explains(e.tolerance))
    return CauseNamed(
        alarm=alarm.key,
        time_us=e.time_us,
        parameter=e.parameters[i],
        size=size,
        size_sd=size_sd,
        causes=_reported(e, causes),
        doubt=_doubt(e, i, causes),
        onset=onset,
        kind=kind,
    )


def _new_sizes(
    e: Evidence,
    changed: Sequence[tuple[AlarmKey, str]],
    causes: tuple[Cause, ...] | None = None,
    doubt: Doubt | None = None,
) -> Iterator[AlarmEvent]:
    """Sizes of all named alarms, given that these parameters and no others have changed."""
    found = _sizes(e, [e.parameters.index(parameter) for _, parameter in changed])
    for (key, _), (size, size_sd) in zip(changed, found, strict=True):
        yield SizeUpdated(key, e.time_us, direction_of(size), size, size_sd, 0, causes, doubt)


def _onset(alarm: Alarm, e: Evidence, i: int, alone: bool) -> tuple[Onset, Kind]:
    """Onset and kind of the change of parameter i; those of the alarm where the past is not known."""
    past, before = e.past, Onset.of_alarm(alarm)
    change = None if past is None else change_of(past, i, alone)
    if past is None or change is None:
        return before, alarm.kind
    last_us = int(past.t_us[-1])
    high = min(last_us + round(change.high), alarm.raised_us)
    low = min(last_us + round(change.low), high)
    if low <= past.t_us[0]:  # older than what is kept
        return before._replace(high_us=high), alarm.kind
    onset = min(max(last_us + round(change.best), low), high)
    return Onset(onset, low, high), _kind(change.drift)


def _kind(drift: float) -> Kind:
    if abs(drift) < SURE:
        return ""
    return "drift" if drift > 0 else "step"


def _causes(e: Evidence, alarm: Alarm, named: Sequence[Alarm] = ()) -> Causes:
    """Probabilities of the causes; parameters of the ``named`` alarms may have changed by any amount."""
    known = [e.parameters.index(a.parameter) for a in named]
    prior = np.array([FIRST_CROSSING_ODDS if name == alarm.first[0] else 1.0 for name in e.parameters])
    return single_faults(np.array(e.since), np.array(e.since_covariance), known, prior)


def _sizes(e: Evidence, changed: Sequence[int]) -> list[tuple[float, float]]:
    """Size and standard deviation of each, given that these have changed and no others."""
    found, sd = sizes(np.array(e.deviation), np.array(e.covariance), changed)
    return [(float(f), float(s) * _scatter(e, i)) for i, f, s in zip(changed, found, sd, strict=True)]


def _scatter(e: Evidence, i: int) -> float:
    return 1.0 if e.past is None else scatter(e.past, i)


def _reported(e: Evidence, causes: Causes) -> tuple[Cause, ...]:
    """The causes that are likely enough to be reported, the likeliest first."""
    order = np.argsort(-causes.probability, kind="stable")
    found = [Cause(e.parameters[k], float(causes.probability[k])) for k in order]
    return tuple(cause for cause in found if cause.probability >= MIN_PROBABILITY)


def _doubt(e: Evidence, i: int, causes: Causes) -> Doubt:
    """Why the likeliest cause may not be the true one."""
    held = dict(zip(e.parameters, e.held, strict=True))
    if held.get(TORQUE_CONSTANT) == -1:
        return "sign" if e.excess > UNEXPLAINED else "still"
    if held[e.parameters[i]] or e.excess > MODEL_LOST:
        return "model"
    return "" if causes.explains(e.tolerance) else "several"
