"""The open alarms of one axis: events in, alarms raised, named, corrected and ended out.

* Whatever crosses first raises one alarm, "something has changed"; crossings of any parameter belong to it until it is
  named.  So a wrong first crossing is not a second alarm: its name is corrected, and what it was called is kept.
* The name comes from single-fault likelihood ratios (isolation.py), with the probabilities of all causes.
* While a named alarm stands, a crossing of another parameter raises a second one.  It is named given the first: the
  named parameters may be off by anything, and the others are judged by themselves.  Nothing is taken out of the nominal
  values or the tests, so nothing has to be put back when the first fault is repaired.  If then nothing else stands out,
  the second belongs to the first and ends; if another single parameter explains all, the first is corrected to it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monitor_core.detection.alarm import (
    NO_PARAMETER,
    Alarm,
    Cause,
    Crossing,
    Doubt,
    Event,
    Evidence,
    Kind,
    Recovered,
)
from monitor_core.detection.change_time import SURE
from monitor_core.detection.detector_protocol import SHOWN, Book, direction_of, with_name
from monitor_core.detection.isolation import Causes, single_faults, sizes
from monitor_core.detection.onset import change_of, scatter

DISMISSED = 0.05
"""An alarm that has a name is corrected when its cause is less likely than this."""

MODEL_LOST = 100.0
"""Innovation variance over lambda_0 with which the model does not hold (errors ten times as large)."""

UNEXPLAINED = 2.0
"""Innovation variance over lambda_0 of a motion that the torque does not explain."""

FIRST = 8.0
"""Odds beforehand of the parameter that crossed first against each other one: among eight parameters it was the right
one in 55 of 100 large changes, and more often of small ones."""

TORQUE_CONSTANT = "kT"


class EpisodeBook(Book[Event]):
    """The open episodes of one axis, at most one of each parameter, and at most one that has no name yet."""

    def _take(self, event: Event) -> None:
        if isinstance(event, Crossing):
            self._cross(event)
        elif isinstance(event, Recovered):
            self._end([e for e in self._open if e.parameter == event.parameter])
        elif isinstance(event, Evidence) and event.past is not None and self._open:
            self._judge(event)

    def _cross(self, c: Crossing) -> None:
        unnamed = [e for e in self._open if e.stage == "changed"]
        own = [e for e in self._open if e.parameter == c.parameter]
        if own:
            self._put(_updated(own[0], c))
        elif unnamed:
            self._put(replace(unnamed[0], updated_us=c.time_us, crossings=unnamed[0].crossings + 1))
        elif not any(
            e.doubt in NO_PARAMETER for e in self._open
        ):  # else all go astray, and one alarm will do
            self._open.append(_raised(c))

    def _judge(self, evidence: Evidence) -> None:
        known = [e for e in self._open if e.stage == "named"]
        fresh = [e for e in self._open if e.stage == "changed"]
        if not known:
            causes = _causes(evidence, fresh[0])
            no_parameter = _doubt(evidence, causes.best, causes) in NO_PARAMETER
            if no_parameter or causes.stands_out(
                evidence.tolerance
            ):  # else it waits for more, or for its end
                self._name(fresh[0], evidence, causes, alone=True)
            return
        if fresh:
            self._second(fresh[0], known, evidence)
        elif len(known) == 1:
            self._look_again(known[0], evidence)
        self._measure(evidence)

    def _second(self, fresh: Alarm, known: Sequence[Alarm], evidence: Evidence) -> None:
        """Name the newer alarm given the older ones, or find that it belongs to them."""
        others = _causes(evidence, fresh, known)
        alone = _causes(evidence, fresh)
        corrected = evidence.parameters[alone.best] not in {e.parameter for e in known}
        if corrected and alone.explains(evidence.tolerance):
            self._end([fresh, *known[1:]])
            self._name(known[0], evidence, alone, alone=True)
        elif others.stands_out(evidence.tolerance):
            self._name(fresh, evidence, others, alone=False)
        else:
            self._end([fresh])
            crossings = known[0].crossings + fresh.crossings
            self._put(replace(known[0], crossings=crossings, updated_us=evidence.time_us))

    def _look_again(self, e: Alarm, evidence: Evidence) -> None:
        """The causes of the only alarm, by what is known now; its name is corrected only where it has to be."""
        causes = _causes(evidence, e)
        if not causes.stands_out(evidence.tolerance):  # it is about to end
            return
        i = evidence.parameters.index(e.parameter)
        if causes.probability[i] < DISMISSED and causes.explains(evidence.tolerance):
            self._name(e, evidence, causes, alone=True)
        elif causes.best == i:
            doubt = e.doubt if e.doubt in NO_PARAMETER else _doubt(evidence, i, causes)
            self._put(replace(e, causes=_told(evidence, causes), doubt=doubt))

    def _name(self, e: Alarm, evidence: Evidence, causes: Causes, alone: bool) -> None:
        """Give an alarm its name, size, and onset."""
        i = causes.best
        ((size, sd),) = _sizes(evidence, [i])
        new = replace(
            e,
            parameter=evidence.parameters[i],
            direction=direction_of(size),
            stage="named",
            updated_us=evidence.time_us,
            size=size,
            size_sd=sd,
            causes=_told(evidence, causes),
            doubt=_doubt(evidence, i, causes),
            past=with_name(e, evidence.time_us),
        )
        explained = alone and causes.explains(evidence.tolerance)
        self._put(_with_onset(new, evidence, i, explained))

    def _measure(self, evidence: Evidence) -> None:
        """Sizes of all named alarms, given that these parameters and no others have changed."""
        named = [e for e in self._open if e.stage == "named"]
        changed = [evidence.parameters.index(e.parameter) for e in named]
        for e, (size, size_sd) in zip(named, _sizes(evidence, changed), strict=True):
            past = e.past if direction_of(size) == e.direction else with_name(e, evidence.time_us)
            new = replace(e, size=size, size_sd=size_sd, direction=direction_of(size), past=past)
            self._put(replace(new, updated_us=evidence.time_us))


def _raised(c: Crossing) -> Alarm:
    return Alarm(
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


def _updated(e: Alarm, c: Crossing) -> Alarm:
    """With one more crossing of its own parameter; the other way round, it has turned."""
    past = e.past if c.direction == e.direction else with_name(e, c.time_us)
    return replace(
        e,
        direction=c.direction,
        updated_us=c.time_us,
        size=c.size,
        size_sd=c.size_sd,
        crossings=e.crossings + 1,
        past=past,
    )


def _with_onset(e: Alarm, evidence: Evidence, i: int, alone: bool) -> Alarm:
    """With the onset and the kind of the change, as far as what is kept of the past can tell."""
    past = evidence.past
    change = None if past is None else change_of(past, i, alone)
    if past is None or change is None:
        return e
    last_us = int(past.t_us[-1])
    high = min(last_us + round(change.high), e.raised_us)
    low = min(last_us + round(change.low), high)
    if low <= past.t_us[0]:  # older than what is kept
        return replace(e, onset_high_us=high)
    onset = min(max(last_us + round(change.best), low), high)
    return replace(e, onset_us=onset, onset_low_us=low, onset_high_us=high, kind=_kind(change.drift))


def _scatter(evidence: Evidence, i: int) -> float:
    return 1.0 if evidence.past is None else scatter(evidence.past, i)


def _kind(drift: float) -> Kind:
    if abs(drift) < SURE:
        return ""
    return "drift" if drift > 0 else "step"


def _causes(evidence: Evidence, crossed: Alarm, known: Sequence[Alarm] = ()) -> Causes:
    left_out = [evidence.parameters.index(e.parameter) for e in known]
    prior = np.array([FIRST if name == crossed.first[0] else 1.0 for name in evidence.parameters])
    return single_faults(np.array(evidence.since), np.array(evidence.since_covariance), left_out, prior)


def _sizes(evidence: Evidence, changed: Sequence[int]) -> list[tuple[float, float]]:
    """Size and standard deviation of each, given that these have changed and no others."""
    found, sd = sizes(np.array(evidence.deviation), np.array(evidence.covariance), changed)
    return [(float(f), float(s) * _scatter(evidence, i)) for i, f, s in zip(changed, found, sd, strict=True)]


def _told(evidence: Evidence, causes: Causes) -> tuple[Cause, ...]:
    """The causes that are worth telling, the likeliest first."""
    order = np.argsort(-causes.probability, kind="stable")
    found = [(evidence.parameters[k], float(causes.probability[k])) for k in order]
    return tuple(Cause(*cause) for cause in found if cause[1] >= SHOWN)


def _doubt(evidence: Evidence, i: int, causes: Causes) -> Doubt:
    """Why the likeliest cause may not be the cause at all."""
    held = dict(zip(evidence.parameters, evidence.held, strict=True))
    if held.get(TORQUE_CONSTANT) == -1:
        return "sign" if evidence.excess > UNEXPLAINED else "still"
    if held[evidence.parameters[i]] or evidence.excess > MODEL_LOST:
        return "model"
    return "" if causes.explains(evidence.tolerance) else "several"
