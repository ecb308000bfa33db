"""Multi-model detector of one axis: a bank of hypotheses, and the alarms made of its events.

A change raises one alarm.  The alarm is named when there is enough evidence.  It may be renamed once, when the size is
well known, and it ends when its cause ends.  A further change of a cause with an open alarm belongs to that alarm.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, finite
from monitor_core.detection.alarm import MIN_PROBABILITY, MODEL_ERROR, Alarm, Cause, DetectorName, Leading, direction_of
from monitor_core.detection.multimodel.candidates import CauseQuantity, candidate_cause, candidates, causes_of
from monitor_core.detection.multimodel.hypothesis import HEALTHY, Hypothesis
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.isolability import Distinct, chosen, distinct_candidates
from monitor_core.detection.multimodel.naming import CauseIdentified, ChangeDetected, Event, Share, SizeCorrected
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import slowest_time_constant
from monitor_core.drive.structure import DELAY
from monitor_core.settings import Settings

SCHEMA = 4
"""Version of the saved state; states of other versions are not read."""


@dataclass(frozen=True)
class HypothesisThreshold:
    """Threshold and allowance of one hypothesis, from a calibration.

    ``size_error``: standard deviation of the error of the size of its cause on the healthy axis, in the unit of
    ``size``.
    """

    cause: str
    size: float
    h: float
    allowance: float = 0.0
    alike: tuple[str, ...] = ()
    size_error: float = 0.0


@dataclass(frozen=True)
class MultiModelThresholds:
    """Thresholds of the multi-model detector.

    ``own``: one for each hypothesis of the bank.  Empty: the hypotheses are the distinct candidates, all with the h
    that guarantees a mean run length of ``samples`` between false alarms.  ``evidence_share``: see CausePosterior.
    """

    samples: float
    own: tuple[HypothesisThreshold, ...] = ()
    evidence_share: float = 1.0


def guaranteed(hypotheses: int, samples: float) -> float:
    """Threshold h with which H hypotheses have at most one false alarm in ``samples``, for an exact model.

    The mean time between false alarms of one hypothesis is at least e^h samples (Lorden), so of all at least e^h / H.
    """
    return math.log(max(hypotheses * samples, math.e))


def least_delay(healthy: Floats, faulty: Floats, lam0: float, samples_between: float) -> float:
    """Theoretical limit of the detection delay: samples from the onset until the information suffices (Lorden).

    This is the first n at which  sum (yhat_faulty - yhat_healthy)^2 / (2 lam0),  averaged over records, reaches
    log(samples_between), for one false alarm in ``samples_between`` samples.  ``healthy`` and ``faulty`` (N, W):
    predictions from the onset on.  Returns inf if N samples do not suffice.
    """
    information = np.cumsum(((faulty - healthy) ** 2).mean(axis=1)) / (2 * lam0)
    enough = information >= math.log(samples_between)
    return float(enough.argmax() + 1) if enough.any() else math.inf


def reason_unavailable(model: AxisModel, settings: Settings) -> str:
    """Reason why the detector is not available for an axis, in words; empty if it is available."""
    if settings.unidentifiable:
        return "its nominal values cannot distinguish some of the parameters"
    gain = settings.gain(len(model.drive.states))
    if not math.isfinite(slowest_time_constant(model, gain, settings.interval_s)):
        return "its predictor is not stable"
    return ""


def bank_of(model: AxisModel, settings: Settings, thresholds: MultiModelThresholds) -> HypothesisBank:
    """The bank of an axis.

    Raises:
        KeyError: a threshold has a cause that the axis does not have.
        ValueError: the detector is not available for the axis, or a threshold is out of range.
    """
    if not thresholds.own:
        hypotheses = _defaults(model, settings).hypotheses
        h = guaranteed(len(hypotheses), thresholds.samples)
        return HypothesisBank(model, settings, hypotheses, h, evidence_share=thresholds.evidence_share)
    # A positive allowance of DELAY means that healthy records show a delay that is in the axis and not in its model, as
    # if the drive filters its torque.  Its evidence varies with the motion and with any fault, so faults would be
    # reported as a delay: leave these hypotheses out.
    own = [t for t in thresholds.own if not (t.cause == DELAY and t.allowance > 0)]
    found = [replace(candidate_cause(model, settings, t.cause).hypothesis(t.size), alike=t.alike) for t in own]
    limits, allowance = (np.array([getattr(t, name) for t in own]) for name in ("h", "allowance"))
    return HypothesisBank(model, settings, found, limits, allowance, thresholds.evidence_share)


class _Defaults(NamedTuple):
    distinct: tuple[Distinct, ...]
    hypotheses: tuple[Hypothesis, ...]


def _defaults(model: AxisModel, settings: Settings, distinct: tuple[Distinct, ...] | None = None) -> _Defaults:
    """Hypotheses for axes without calibrated thresholds: the distinct candidates, which are computed if not given.

    Raises:
        ValueError: ``distinct`` has an index beyond the candidates.
    """
    shared = f"{model} {settings}"
    if shared not in _DEFAULTS:
        every = candidates(model, settings)
        known = distinct or distinct_candidates(model, settings, every)
        _DEFAULTS[shared] = _Defaults(known, chosen(every, known))
    return _DEFAULTS[shared]


_DEFAULTS: dict[str, _Defaults] = {}
"""Cache: axes with the same model and settings share their hypotheses."""


_DISTINCT = "distinct"
"""Name of an array of a saved state: the distinct candidates, as the bytes of a JSON text"""


class MultiModelDetector:
    """The multi-model detector of one axis.

    The bank is created at first use, as it needs the compiled kernel to find the distinct hypotheses.

    Raises:
        ValueError: the detector is not available for the axis, or thresholds have unknown causes.
    """

    name: DetectorName = "multimodel"

    def __init__(self, model: AxisModel, settings: Settings, thresholds: MultiModelThresholds) -> None:
        if reason := reason_unavailable(model, settings):
            raise ValueError(reason)
        self._model, self._settings, self._thresholds = model, settings, thresholds
        errors = settings.size_errors(len(model.monitored)) * model.scale
        self._errors = dict(zip(model.monitored, errors.tolist(), strict=True))
        self._size_errors = {threshold.cause: threshold.size_error for threshold in thresholds.own}
        self.causes = causes_of(model)
        """All causes that the detector may name"""
        if unknown := {threshold.cause for threshold in thresholds.own} - set(self.causes):
            raise ValueError(f"thresholds of {', '.join(sorted(unknown))}, which the axis does not have")

    @cached_property
    def bank(self) -> HypothesisBank:
        """The hypotheses and their state."""
        return bank_of(self._model, self._settings, self._thresholds)

    @property
    def has_bank(self) -> bool:
        """Whether the bank has been created, so that there is a state."""
        return "bank" in self.__dict__

    def to_arrays(self) -> dict[str, NDArray[np.generic]] | None:
        """The state to save: that of the bank, and its distinct candidates; None: the bank has not been created."""
        if not self.has_bank:
            return None
        arrays = self.bank.to_arrays()
        if not self._thresholds.own:
            distinct = json.dumps(_defaults(self._model, self._settings).distinct)
            arrays[_DISTINCT] = np.frombuffer(distinct.encode(), np.uint8)
        return arrays

    def from_arrays(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Restore a saved state.  This does not wait for the kernel to be compiled.

        Raises:
            KeyError: an array is missing.
            ValueError: the state does not belong to these hypotheses, or is damaged.
        """
        if _DISTINCT in arrays and not self._thresholds.own:
            saved = json.loads(np.asarray(arrays[_DISTINCT], np.uint8).tobytes())
            distinct = tuple(Distinct(int(place), tuple(alike)) for place, alike in saved)
            _defaults(self._model, self._settings, distinct)
        self.bank.from_arrays(arrays)

    def quantity(self, cause: str) -> CauseQuantity:
        """Nominal value and unit of a cause."""
        return candidate_cause(self._model, self._settings, cause).quantity

    def leading(self) -> Leading:
        """The cause with the largest g / h, and that ratio; none before the first sample."""
        return Leading(*self.bank.leading()) if self.has_bank else Leading("", 0.0)

    def interpret(self, event: Event, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
        """The alarms that an event of the bank raises, changes or ends; the last form of each counts."""
        if isinstance(event, ChangeDetected):
            yield from self._change(event, open_alarms)
        elif isinstance(event, CauseIdentified):
            yield from self._name(event, open_alarms)
        elif isinstance(event, SizeCorrected):
            yield from self._correct_size(event, open_alarms)
        else:  # an unnamed alarm ends with the cause, as nothing else has changed
            ends = (a for a in open_alarms if a.since_us == event.since_us or a.parameter == event.cause)
            yield from (a.ended(event.time_us) for a in ends)

    def _change(self, event: ChangeDetected, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
        cause = event.shares[0].cause
        same = _named_alarm(open_alarms, cause)
        if same is not None:
            yield same.detected_again(event.time_us)
        elif cause != HEALTHY:
            yield self._raised(event.time_us, event)

    def _name(self, event: CauseIdentified, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
        share = event.shares[0]
        if share.cause == HEALTHY:  # an open alarm is about to end
            return
        size, size_sd = self._size(share)
        facts: dict[str, Any] = {"size": size, "size_sd": size_sd}
        unnamed = next((a for a in open_alarms if a.since_us == event.since_us), None)
        same = _named_alarm(open_alarms, share.cause)
        name = event.time_us, share.cause, direction_of(share.size)
        if same is not None and (unnamed is None or same.key != unnamed.key):
            if unnamed is not None:
                yield unnamed.ended(event.time_us)
            # The cause of this alarm was decided before: only its size is updated, once the change has lasted.
            yield same.named(*name, **facts) if event.settled else same.detected_again(event.time_us)
            return
        facts["causes"] = _reported(event)
        if unnamed is not None:
            yield unnamed.named(*name, **(facts | unnamed.onset_by(event.onset)._asdict()))
        else:
            alarm = self._raised(event.since_us, event)
            yield replace(alarm, stage="named", updated_us=event.time_us, **facts)

    def _correct_size(self, event: SizeCorrected, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
        share, same = event.share, _named_alarm(open_alarms, event.share.cause)
        if same is not None:
            size, size_sd = self._size(share)
            direction = direction_of(share.size)
            yield same.named(event.time_us, share.cause, direction, size=size, size_sd=size_sd)

    def _size(self, share: Share) -> tuple[float | None, float | None]:
        """Size of a cause and its standard deviation; None: the cause has no size, or the size is not known."""
        quantity = self.quantity(share.cause)
        size, size_sd = (finite(value) for value in quantity.change(share.size, share.size_sd))
        if size is None or size_sd is None:
            return None, None
        _, healthy = quantity.change(share.size, self._size_errors.get(share.cause, 0.0))
        error = max(self._errors.get(share.cause, 0.0), healthy)
        return size, math.hypot(size_sd, MODEL_ERROR * size, error)

    def _raised(self, since_us: int, event: ChangeDetected | CauseIdentified) -> Alarm:
        share = event.shares[0]
        return Alarm(
            parameter=share.cause,
            direction=direction_of(share.size),
            raised_us=since_us,
            updated_us=since_us,
            ended_us=None,
            size=None,
            size_sd=None,
            crossings=1,
            **event.onset.until(since_us)._asdict(),
        )

    def adopt(self, alarms: Iterable[Alarm], previous: Iterable[Alarm]) -> None:
        """Adopt open alarms: their causes become the active faults of the bank."""
        opened = list(alarms)
        if _seen_by_bank(opened) == _seen_by_bank(previous):
            return
        named = {
            a.parameter: math.nan if a.size is None else self.quantity(a.parameter).size(a.size)
            for a in opened
            if a.stage == "named"
        }
        unnamed = [a.since_us for a in opened if a.stage == "changed"]
        known = self.bank.causes
        active = {cause: size for cause, size in named.items() if cause in known}
        self.bank.adopt(active, unnamed[0] if unnamed else None)


def _seen_by_bank(alarms: Iterable[Alarm]) -> list[tuple[object, ...]]:
    """The part of the alarms that must agree with the active faults of the bank."""
    return sorted((a.since_us, a.parameter, a.stage) for a in alarms)


def _reported(event: CauseIdentified) -> tuple[Cause, ...]:
    likely = (s for s in event.shares if s.probability >= MIN_PROBABILITY and s.cause)
    return tuple(Cause(s.cause, s.probability, s.alike) for s in likely)


def _named_alarm(open_alarms: Sequence[Alarm], cause: str) -> Alarm | None:
    return next((a for a in open_alarms if a.parameter == cause and a.stage == "named"), None)
