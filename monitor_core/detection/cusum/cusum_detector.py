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
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.detection.alarm import (
    MIN_PROBABILITY,
    NO_PARAMETER,
    Alarm,
    Cause,
    DetectorName,
    Doubt,
    Kind,
    Leading,
    Onset,
    direction_of,
)
from monitor_core.detection.cusum.cusum_evidence import INVALID, Crossing, CusumEvent, Evidence, Recovered
from monitor_core.detection.isolation import Causes, single_faults, sizes
from monitor_core.detection.onset import SURE, change_of, scatter

DISMISSED = 0.05
"""An alarm is renamed when the probability of its cause falls below this."""

UNEXPLAINED = 2.0
"""Innovation variance over lambda_0 of a motion that the torque does not explain."""

FIRST_CROSSING_ODDS = 8.0
"""Prior odds of the parameter that crossed first against each other one: among eight parameters it was the right one in
55 of 100 large changes, and more often for small changes."""

TORQUE_CONSTANT = "kT"


class CusumDetector:
    """The CUSUM tests of one axis.  The kernel computes g (paper eq. 21-23); this class makes alarms of the crossings.

    ``parameters`` (p,) are those monitored.  g (2, p) of both directions, the thresholds h (p,), and ``calm`` (p,), the
    samples without deviation so far, are views of the batch.
    """

    name: DetectorName = "cusum"

    def __init__(self, parameters: tuple[str, ...], g: Floats, h: Floats, calm: Ints) -> None:
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

    @staticmethod
    def interpret(event: CusumEvent, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
        """The alarms that a crossing, a recovery or new evidence raises, changes or ends; the last form of each counts.

        ``open_alarms``: the oldest first.
        """
        if isinstance(event, Crossing):
            yield from _crossing(event, open_alarms)
        elif isinstance(event, Recovered):
            yield from (a.ended(event.time_us) for a in open_alarms if a.parameter == event.parameter)
        elif event.past is not None and open_alarms:
            yield from _evidence(event, open_alarms)


def _crossing(c: Crossing, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
    same = [a for a in open_alarms if a.parameter == c.parameter]
    unnamed = [a for a in open_alarms if a.stage == "changed"]
    if same:
        yield same[0].detected_again(c.time_us).resized(c.time_us, c.direction, c.size, c.size_sd)
    elif unnamed:
        yield unnamed[0].detected_again(c.time_us)
    elif not any(a.doubt in NO_PARAMETER for a in open_alarms):
        # Otherwise all estimates drift away: one alarm is enough.
        times = c.onset_us, c.time_us, c.time_us, None
        yield Alarm(c.parameter, c.direction, *times, c.size, c.size_sd, crossings=1)


def _evidence(e: Evidence, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
    named = [a for a in open_alarms if a.stage == "named"]
    unnamed = [a for a in open_alarms if a.stage == "changed"]
    if not named:
        causes = _causes(e, unnamed[0])
        no_parameter = _doubt(e, causes.best, causes) in NO_PARAMETER
        # Otherwise wait for more evidence, or for recovery.
        if no_parameter or causes.stands_out(e.tolerance):
            yield _named(unnamed[0], e, causes, alone=True)
    elif unnamed:
        yield from _second_alarm(unnamed[0], named, e)
    elif len(named) == 1:
        yield from _resized(e, [_reconsidered(named[0], e)])
    else:
        yield from _resized(e, named)


def _second_alarm(new: Alarm, named: Sequence[Alarm], e: Evidence) -> Iterator[Alarm]:
    """Name the newer alarm given the older ones, or find that it belongs to them."""
    others, alone = _causes(e, new, named), _causes(e, new)
    first, *later = named
    if e.parameters[alone.best] not in {a.parameter for a in named} and alone.explains(e.tolerance):
        yield from (a.ended(e.time_us) for a in (new, *later))
        changed = [_named(first, e, alone, alone=True)]
    elif others.stands_out(e.tolerance):
        new = _named(new, e, others, alone=False)
        yield new
        changed = [*named, new]
    else:
        yield new.ended(e.time_us)
        changed = [first.detected_again(e.time_us, new.crossings), *later]
    yield from _resized(e, changed)


def _reconsidered(alarm: Alarm, e: Evidence) -> Alarm:
    """The only alarm in the light of new evidence; it is renamed only where its cause has become unlikely."""
    causes, i = _causes(e, alarm), e.parameters.index(alarm.parameter)
    if not causes.stands_out(e.tolerance):  # it is about to end
        return alarm
    if causes.probability[i] < DISMISSED and causes.explains(e.tolerance):
        return _named(alarm, e, causes, alone=True)
    if causes.best == i:
        doubt = alarm.doubt if alarm.doubt in NO_PARAMETER else _doubt(e, i, causes)
        return replace(alarm, causes=_reported(e, causes), doubt=doubt)
    return alarm


def _named(alarm: Alarm, e: Evidence, causes: Causes, alone: bool) -> Alarm:
    """The alarm of the likeliest cause with its size, and with the onset as far as the kept past shows it."""
    i = causes.best
    ((size, size_sd),) = _sizes(e, [i])
    onset, kind = _onset(alarm, e, i, alone and causes.explains(e.tolerance))
    details = {"causes": _reported(e, causes), "doubt": _doubt(e, i, causes), "kind": kind, **onset._asdict()}
    return alarm.named(e.time_us, e.parameters[i], size, size_sd=size_sd, **details)


def _resized(e: Evidence, alarms: Sequence[Alarm]) -> Iterator[Alarm]:
    """All named alarms with their sizes, given that their parameters and no others have changed."""
    found = _sizes(e, [e.parameters.index(alarm.parameter) for alarm in alarms])
    for alarm, (size, size_sd) in zip(alarms, found, strict=True):
        yield alarm.resized(e.time_us, direction_of(size), size, size_sd)


def _onset(alarm: Alarm, e: Evidence, i: int, alone: bool) -> tuple[Onset, Kind]:
    """Onset and kind of the change of parameter i; those of the alarm where the past is not known."""
    past = e.past
    change = None if past is None else change_of(past, i, alone)
    if past is None or change is None:
        return alarm.onset, alarm.kind
    last_us = int(past.t_us[-1])
    high = min(last_us + round(change.high), alarm.raised_us)
    low = min(last_us + round(change.low), high)
    if low <= past.t_us[0]:  # older than what is kept
        return alarm.onset._replace(onset_high_us=high), alarm.kind
    onset = min(max(last_us + round(change.best), low), high)
    kind: Kind = "" if abs(change.drift) < SURE else "drift" if change.drift > 0 else "step"
    return Onset(onset, low, high), kind


def _causes(e: Evidence, alarm: Alarm, named: Sequence[Alarm] = ()) -> Causes:
    """Probabilities of the causes; parameters of the ``named`` alarms may have changed by any amount."""
    known = [e.parameters.index(a.parameter) for a in named]
    prior = np.array([FIRST_CROSSING_ODDS if name == alarm.first[0] else 1.0 for name in e.parameters])
    return single_faults(np.array(e.since), np.array(e.since_covariance), known, prior)


def _sizes(e: Evidence, changed: Sequence[int]) -> list[tuple[float, float]]:
    """Size and standard deviation of each, given that these have changed and no others."""
    found, sd = sizes(np.array(e.deviation), np.array(e.covariance), changed)
    times = [1.0 if e.past is None else scatter(e.past, i) for i in changed]
    return [(float(f), float(s) * more) for f, s, more in zip(found, sd, times, strict=True)]


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
    if held[e.parameters[i]] or e.excess > INVALID:
        return "model"
    return "" if causes.explains(e.tolerance) else "several"
