"""Alarms of the CUSUM tests: raised at a crossing, named by likelihood ratios of single faults, ended by evidence.

* The first crossing raises one alarm, "something has changed".  Until the alarm is named, crossings of any parameter
  belong to it.  So a first crossing of the wrong parameter causes no second alarm: the name is corrected, and the
  earlier name is kept.
* The name comes from the likelihood ratios of single faults (isolation.py), with the probabilities of all causes.
* While a named alarm is open, a crossing of another parameter is a second change only if the first change does not
  explain it.  Its cause is isolated given the first one: the named parameters may have changed by any amount, and the
  others are tested without them.  Nominal values and tests are not modified, so nothing has to be restored when the
  first fault is repaired.  If no other parameter stands out, the second change belongs to the first.  If another single
  parameter explains everything, the first alarm is renamed.
* The size of a named alarm is the mean deviation since its first crossing.  While the cause lasts, the tests cross
  again and again.  The alarm ends when they have not crossed for three memory lengths, and the estimates since then are
  much more likely for the nominal value than for that size.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from math import hypot, log, sqrt
from typing import Any

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import (
    MIN_PROBABILITY,
    MODEL_ERROR,
    NO_PARAMETER,
    TORQUE_CONSTANT,
    Alarm,
    Cause,
    ChangeKind,
    DetectorName,
    Doubt,
    Leading,
    Onset,
    direction_of,
)
from monitor_core.detection.cusum.cusum_evidence import INVALID, Crossing, CusumEvent, Evidence
from monitor_core.detection.isolation import Causes, single_faults, sizes
from monitor_core.detection.onset import SURE, change_of, return_of, scatters
from monitor_core.drive.structure import LOAD

MIN_NAME_PROBABILITY = 0.05
"""An alarm is renamed when the probability of its cause falls below this."""

UNEXPLAINED_MOTION = 2.0
"""Ratio of the innovation variance to lambda_0 above which the torque does not explain the motion."""

FIRST_CROSSING_ODDS = 8.0
"""Prior odds of the parameter that crossed first, against each other parameter.  Among eight parameters it was the
right one in 55 of 100 large changes, and more often for small changes."""

SURELY_BACK = log(100)
"""Log-likelihood ratio of the nominal value against the size of an alarm from which the alarm ends."""

MIN_EVIDENCE = 1.0
"""An alarm without a name ends if twice the log-likelihood ratio of the likeliest cause is below this."""


class CusumDetector:
    """The CUSUM tests of one axis.  The kernel computes g (paper eq. 21-23); this class makes alarms of the crossings.

    ``parameters`` (p,): the monitored ones.  g (2, p), for both directions, and the thresholds h (p,) are views into
    the batch.
    """

    name: DetectorName = "cusum"

    def __init__(self, parameters: tuple[str, ...], g: Floats, h: Floats) -> None:
        self.causes = parameters
        self._g, self._h = g, h

    def leading(self) -> Leading:
        """The parameter whose test is nearest its threshold, and g / h."""
        evidence = (self._g.max(axis=0) / self._h).tolist()
        largest = max(evidence)
        return Leading(self.causes[evidence.index(largest)], largest)

    def adopt(self, alarms: Iterable[Alarm], previous: Iterable[Alarm]) -> None:
        """Do nothing: the evidence of this detector does not depend on open alarms."""

    @staticmethod
    def interpret(event: CusumEvent, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
        """The alarms that a crossing or new evidence raises, changes or ends; the last form of each counts.

        ``open_alarms``: the oldest first.
        """
        if isinstance(event, Crossing):
            yield from _crossing(event, open_alarms)
        elif open_alarms:
            yield from _evidence(event, open_alarms)


def _crossing(c: Crossing, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
    same = [a for a in open_alarms if a.parameter == c.parameter]
    unnamed = [a for a in open_alarms if a.stage == "changed"]
    if same:
        yield same[0].detected_again(c.time_us).turned(c.time_us, c.direction)
    elif unnamed:
        yield unnamed[0].detected_again(c.time_us)
    elif not any(a.doubt in NO_PARAMETER for a in open_alarms):
        # Otherwise all estimates drift away: one alarm is enough.
        times = c.onset_us, c.time_us, c.time_us, None
        yield Alarm(c.parameter, c.direction, *times, size=None, size_sd=None, crossings=1)


def _evidence(e: Evidence, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
    named = [a for a in open_alarms if a.stage == "named"]
    unnamed = [a for a in open_alarms if a.stage == "changed"]
    if payload := next((a for a in named if a.parameter == LOAD), None):
        e = e.with_payload(payload.size or 0.0)
    over = [a for a in named if _is_over(a, named, e)]
    yield from (a.ended(e.time_us) for a in over)
    lasting = [a for a in named if a not in over]
    if unnamed and lasting:
        yield from _second_change(unnamed[0], lasting, e)
    elif unnamed:
        yield from _first_change(unnamed[0], e)
    elif len(lasting) == 1:
        yield from _resized(e, [_reconsidered(lasting[0], e)])
    else:
        yield from _resized(e, lasting)


def _is_over(alarm: Alarm, named: Sequence[Alarm], e: Evidence) -> bool:
    """Whether the parameter is back at its nominal value, or at least as near to it as the tests can resolve.

    The allowance for differences between healthy records is not used: it would be in both values that are compared.
    """
    if not e.is_old(alarm.updated_us):
        return False
    now, sd = _sizes(e, alarm.updated_us, named, np.zeros_like(e.allowed))[named.index(alarm)]
    before = np.inf if alarm.size is None else alarm.size
    # An unknown size is larger than what the tests can resolve.
    back = (before - 2 * now) * before / (2 * sd**2) if np.isfinite(before) else SURELY_BACK
    return bool(back > SURELY_BACK or (back > 0 and sd < abs(before) and e.is_forgotten(alarm.updated_us)))


def _first_change(alarm: Alarm, e: Evidence) -> Iterator[Alarm]:
    """Name the only alarm.  Without enough evidence, wait for more, or end the alarm if the tests no longer cross.

    A small change needs more than three memory lengths to stand out.
    """
    causes = _causes(e, alarm)
    if _doubt(e, causes.best, causes) in NO_PARAMETER or causes.stands_out(e.tolerance):
        yield _named(alarm, e, causes, alone=True)
    elif e.is_old(alarm.updated_us) and (causes.T.max() < MIN_EVIDENCE or e.is_forgotten(alarm.updated_us)):
        yield alarm.ended(e.time_us)


def _second_change(new: Alarm, named: Sequence[Alarm], e: Evidence) -> Iterator[Alarm]:
    """Name the newer alarm given the older ones, or end it if its change belongs to one of them."""
    others, alone = _causes(e, new, named), _causes(e, new)
    first, *later = named
    likeliest_named = max(alone.probability[e.parameters.index(a.parameter)] for a in named)
    # A payload also lowers or raises friction, by the same share as kT.
    payload = alone.in_proportion and e.parameters[alone.best] == first.parameter and alone.explains(e.tolerance)
    if likeliest_named < MIN_NAME_PROBABILITY and alone.explains(e.tolerance):
        yield from (a.ended(e.time_us) for a in (new, *later))
        changed = [_named(first, e, alone, alone=True)]
    elif others.stands_out(e.tolerance) and not payload:
        # Each alarm once: a cause that is reopened continues an ended alarm.
        *older, newest = _resized(e, [*named, _named(new, e, others, alone=False)])
        yield from (newest, *older)
        return
    else:
        yield new.ended(e.time_us)
        changed = [first.detected_again(new.updated_us, new.crossings), *later]
    yield from _resized(e, changed)


def _reconsidered(alarm: Alarm, e: Evidence) -> Alarm:
    """The only alarm, after new evidence.

    It is renamed only if its cause is unlikely, and was already unlikely three memory lengths before: for a short time
    model errors may look like any cause.
    """
    causes, i = _causes(e, alarm), e.parameters.index(alarm.parameter)
    if not causes.stands_out(e.tolerance):  # it is about to end
        return alarm
    if causes.probability[i] < MIN_NAME_PROBABILITY and causes.explains(e.tolerance):
        before = _causes(e.earlier(), alarm).probability[i]
        return _named(alarm, e, causes, alone=True) if before < MIN_NAME_PROBABILITY else alarm
    if causes.best == i:
        doubt = alarm.doubt if alarm.doubt in NO_PARAMETER else _doubt(e, i, causes)
        return replace(alarm, causes=_reported(e, causes), doubt=doubt)
    return alarm


def _named(alarm: Alarm, e: Evidence, causes: Causes, alone: bool) -> Alarm:
    """The alarm, named after the likeliest cause, with size and onset (from the kept past, if that is possible)."""
    i = causes.best
    onset, kind = _onset(alarm, e, i, alone and causes.explains(e.tolerance))
    size = _stated(float(causes.size[i]), float(causes.size_sd[i]))
    details = {"causes": _reported(e, causes), "doubt": _doubt(e, i, causes), "kind": kind, **onset._asdict()}
    return alarm.named(e.time_us, e.parameters[i], direction_of(size["size"]), **size, **details)


def _resized(e: Evidence, alarms: Sequence[Alarm]) -> Iterator[Alarm]:
    """All named alarms with new sizes, given that their parameters have changed and no others.

    All samples since the alarms have their names count with equal weights, up to the return of the parameter if the
    estimates show one: the size is that while the cause lasted.  An alarm keeps its size while the parameter seems to
    be back at its nominal value: the kept size decides whether the alarm ends.
    """
    if not alarms:
        return
    since_us = max(map(_size_since_us, alarms))
    latest = _sizes(e, e.time_us, alarms, e.allowed)
    for k, (alarm, (now, _)) in enumerate(zip(alarms, latest, strict=True)):
        size = _stated_sizes(_while_lasting(e, alarm, since_us, len(alarms) == 1), since_us, alarms)[k]
        back = alarm.size is not None and now * alarm.size < alarm.size**2 / 2 and e.is_old(alarm.updated_us)
        yield alarm if back else replace(alarm.turned(e.time_us, direction_of(size[0])), **_stated(*size))


def _while_lasting(e: Evidence, alarm: Alarm, since_us: int, alone: bool) -> Evidence:
    """The evidence up to the return of the parameter of an alarm, if it shows one."""
    until_us, odds = return_of(e.past, e.parameters.index(alarm.parameter), alone, since_us)
    return e.until(until_us) if odds > SURELY_BACK else e


def _size_since_us(alarm: Alarm) -> int:
    """Time from which the size of an alarm is averaged: the detection, or the last change of its name or direction."""
    renamed = alarm.past and alarm.past[-1].stage == "named"
    return max(alarm.since_us, alarm.past[-1].until_us) if renamed else alarm.since_us


def _onset(alarm: Alarm, e: Evidence, i: int, alone: bool) -> tuple[Onset, ChangeKind]:
    """Onset and kind of the change of parameter i from the past; those of the alarm if the past is not known."""
    past = e.past
    change = change_of(past, i, alone)
    if change is None:
        return alarm.onset, alarm.kind
    last_us = int(past.t_us[-1])
    low, best, high = (last_us + round(t) for t in (change.low, change.best, change.high))
    if low <= past.t_us[0]:  # before the kept past
        return alarm.onset_by(Onset(alarm.onset_us, None, high)), alarm.kind
    kind: ChangeKind = "" if abs(change.drift) < SURE else "drift" if change.drift > 0 else "step"
    return alarm.onset_by(Onset.within(best, low, high)), kind


def _causes(e: Evidence, alarm: Alarm, named: Sequence[Alarm] = ()) -> Causes:
    """Probabilities of the causes; parameters of the ``named`` alarms may have changed by any amount."""
    known = [e.parameters.index(a.parameter) for a in named]
    prior = np.array([FIRST_CROSSING_ODDS if name == alarm.first[0] else 1.0 for name in e.parameters])
    d, V = e.since(alarm.since_us)
    return single_faults(d, V + e.allowed, known, prior, e.payload)


def _sizes(e: Evidence, since_us: int, changed: Sequence[Alarm], allowed: Floats) -> list[tuple[float, float]]:
    """Size and standard deviation since ``since_us`` of each alarm, given that no other parameters have changed."""
    d, V = e.since(since_us)
    estimates = sizes(d, V + allowed, [e.parameters.index(alarm.parameter) for alarm in changed], e.payload)
    return [(float(size), float(sd)) for size, sd in zip(*estimates, strict=True)]


def _stated_sizes(e: Evidence, since_us: int, changed: Sequence[Alarm]) -> list[tuple[float, float]]:
    """Size and standard deviation of each alarm, as reported.

    P has the same scatter for all parameters, their mean; here each has the scatter of its own estimate.
    """
    random = _sizes(e, since_us, changed, np.zeros_like(e.allowed))
    total = _sizes(e, since_us, changed, e.allowed)
    own = scatters(e.past)
    own /= np.sqrt(np.mean(own**2))
    stated = []
    for alarm, (_, sd), (size, with_allowed) in zip(changed, random, total, strict=True):
        lasting = max(with_allowed**2 - sd**2, 0.0)
        stated.append((size, hypot(sd * own[e.parameters.index(alarm.parameter)], sqrt(lasting))))
    return stated


def _stated(size: float, sd: float) -> dict[str, Any]:
    """A size with its reported standard deviation, as fields of ``Alarm``."""
    return {"size": size, "size_sd": hypot(sd, MODEL_ERROR * size)}


def _reported(e: Evidence, causes: Causes) -> tuple[Cause, ...]:
    """The causes that are likely enough to be reported, the likeliest first."""
    order = np.argsort(-causes.probability, kind="stable")
    names = [e.parameters[k] for k in order]
    ordered = [
        Cause(name, float(causes.probability[k]), _alike(e, causes, name)) for name, k in zip(names, order, strict=True)
    ]
    return tuple(cause for cause in ordered if cause.probability >= MIN_PROBABILITY)


def _alike(e: Evidence, causes: Causes, name: str) -> tuple[str, ...]:
    """Other causes that look like a change of a parameter."""
    if name == TORQUE_CONSTANT and causes.is_like_payload(e.parameters.index(name)):
        return (LOAD,)
    return e.alike.get(name, ())


def _doubt(e: Evidence, i: int, causes: Causes) -> Doubt:
    """Reason why the likeliest cause i may not be the true one."""
    held = dict(zip(e.parameters, e.held, strict=True))
    if held.get(TORQUE_CONSTANT) == -1:
        return "sign" if e.excess > UNEXPLAINED_MOTION else "still"
    if held[e.parameters[i]] or e.excess > INVALID:
        return "model"
    return "" if causes.explains(e.tolerance) else "several"
