"""Multi-model detector of one axis: a bank of hypotheses, and the alarms made of its events.

A change raises one alarm.  The alarm is named when there is enough evidence, may be renamed once when the size is well
known, and ends when its cause ends.  A further change of a cause with an open alarm belongs to that alarm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from monitor_core.detection.alarm import Alarm, Cause, direction_of
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
)
from monitor_core.detection.multimodel.candidates import hypothesis_of
from monitor_core.detection.multimodel.hypothesis import HEALTHY, Hypothesis
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank, default_hypotheses
from monitor_core.detection.multimodel.multimodel_events import CauseIdentified, ChangeDetected, Event
from monitor_core.detection.multimodel.naming import Share
from monitor_core.detection.multimodel.quantities import Quantity, causes_of, quantity_of
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import slowest_time_constant
from monitor_core.kernel.state import NEVER
from monitor_core.settings import Settings

SCHEMA = 2
"""Of a saved state; another one is not read."""


@dataclass(frozen=True)
class Limit:
    """Threshold and allowance of one hypothesis, from a calibration."""

    cause: str
    size: float
    h: float
    allowance: float = 0.0
    alike: tuple[str, ...] = ()


@dataclass(frozen=True)
class Limits:
    """Thresholds of the multi-model detector.

    ``own``: of each hypothesis, which are then those of the bank.  Empty: the candidates that change the data, all with
    the h that the guaranteed run length gives for one false alarm in ``samples``.
    """

    samples: float
    own: tuple[Limit, ...] = ()


def guaranteed(hypotheses: int, samples: float) -> float:
    """h with which so many hypotheses have at most one false alarm in ``samples``, for an exact model.

    The mean time between false alarms of each is at least e^h samples (Lorden), so that of all is at least e^h / H.
    """
    return math.log(max(hypotheses * samples, math.e))


def reason_unavailable(model: AxisModel, settings: Settings) -> str:
    """Why the detector is not available for an axis, in words; empty: it is."""
    if settings.unidentifiable:
        return "its nominal values cannot tell some of the parameters apart"
    gain = settings.gain(len(model.drive.states))
    if not math.isfinite(slowest_time_constant(model, gain, settings.interval_s)):
        return "its predictor is not stable"
    return ""


def bank_of(model: AxisModel, settings: Settings, limits: Limits) -> HypothesisBank:
    """The bank of an axis.

    Raises:
        KeyError: a limit of a cause that the axis does not have.
        ValueError: the detector is not available for it, or limits make no sense.
    """
    if not limits.own:
        hypotheses = _default(_Axis(model, settings))
        return HypothesisBank(model, settings, hypotheses, h=guaranteed(len(hypotheses), limits.samples))
    found = [
        replace(hypothesis_of(model, settings, limit.cause, limit.size), alike=limit.alike)
        for limit in limits.own
    ]
    h, allowance = (np.array([getattr(limit, name) for limit in limits.own]) for name in ("h", "allowance"))
    return HypothesisBank(model, settings, found, h, allowance)


class _Axis:
    """Axes with the same model and settings share their hypotheses, which are computed once."""

    def __init__(self, model: AxisModel, settings: Settings) -> None:
        self.model, self.settings = model, settings
        self._text = f"{model} {settings}"

    def __hash__(self) -> int:
        return hash(self._text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Axis) and self._text == other._text


@lru_cache(maxsize=256)
def _default(axis: _Axis) -> tuple[Hypothesis, ...]:
    return default_hypotheses(axis.model, axis.settings)


class MultiModelDetector:
    """The multi-model detector of one axis.

    The bank is created at first use, as the compiled kernel decides which hypotheses are distinguishable.

    Args:
        model: of the axis.
        settings: of the axis.
        limits: thresholds.

    Raises:
        ValueError: the detector is not available for the axis; limits of unknown causes.
    """

    name: DetectorName = "multimodel"

    def __init__(self, model: AxisModel, settings: Settings, limits: Limits) -> None:
        if reason := reason_unavailable(model, settings):
            raise ValueError(reason)
        self._model, self._settings, self._limits = model, settings, limits
        self.causes = causes_of(model)
        """Every cause that it may name"""
        if unknown := {limit.cause for limit in limits.own} - set(self.causes):
            raise ValueError(f"limits of {', '.join(sorted(unknown))}, which the axis does not have")

    @cached_property
    def bank(self) -> HypothesisBank:
        """The hypotheses and their state."""
        return bank_of(self._model, self._settings, self._limits)

    @property
    def made(self) -> bool:
        """Whether the bank has been created, and so has a state."""
        return "bank" in self.__dict__

    def quantity(self, cause: str) -> Quantity:
        """Nominal value and unit of a cause."""
        return quantity_of(self._model, self._settings, cause)

    def leading(self) -> Leading:
        """The cause with the largest g / h, and that ratio; none before the first sample."""
        return Leading(*self.bank.leading()) if self.made else Leading("", 0.0)

    def interpret(self, event: Event, open_alarms: Sequence[Alarm]) -> list[AlarmEvent]:
        """Alarm events that an event of the bank causes, given the open alarms."""
        return list(interpret(event, open_alarms, self.quantity))

    def adopt(self, alarms: Iterable[Alarm], previous: Iterable[Alarm]) -> None:
        """Take over open alarms: their causes are active faults from now on."""
        opened = list(alarms)
        if _seen_by_bank(opened) == _seen_by_bank(previous):
            return
        named = {a.parameter: self.quantity(a.parameter).size(a.size) for a in opened if a.stage == "named"}
        unnamed = [a.raised_us for a in opened if a.stage == "changed"]
        known = self.bank.causes
        active = {cause: size for cause, size in named.items() if cause in known}
        self.bank.adopt(active, unnamed[0] if unnamed else None)


def _seen_by_bank(alarms: Iterable[Alarm]) -> list[tuple[object, ...]]:
    """The part of the alarms that must agree with the active faults of the bank."""
    return sorted((a.raised_us, a.parameter, a.stage) for a in alarms)


def interpret(
    event: Event, open_alarms: Sequence[Alarm], quantity: Callable[[str], Quantity]
) -> Iterator[AlarmEvent]:
    """As ``MultiModelDetector.interpret``: it needs nothing but the open alarms and the units of the causes."""
    if isinstance(event, ChangeDetected):
        yield from _change(event, open_alarms, quantity)
    elif isinstance(event, CauseIdentified):
        yield from _name(event, open_alarms, quantity)
    else:  # an unnamed alarm ends with the cause, as nothing else has changed
        for a in open_alarms:
            if a.raised_us == event.since_us or a.parameter == event.cause:
                yield Ended(a.key, event.time_us)


def _change(
    event: ChangeDetected, open_alarms: Sequence[Alarm], quantity: Callable[[str], Quantity]
) -> Iterator[AlarmEvent]:
    share = event.shares[0]
    same = _named_alarm(open_alarms, share.cause)
    if same is not None:
        yield DetectedAgain(same.key, event.time_us)
    elif share.cause != HEALTHY:
        yield Raised(_raised(event.time_us, event, quantity))


def _name(
    event: CauseIdentified, open_alarms: Sequence[Alarm], quantity: Callable[[str], Quantity]
) -> Iterator[AlarmEvent]:
    share = event.shares[0]
    if share.cause == HEALTHY:  # an open alarm is about to end
        return
    unnamed = next((a for a in open_alarms if a.raised_us == event.since_us), None)
    same = _named_alarm(open_alarms, share.cause)
    if same is not None and (unnamed is None or same.key != unnamed.key):
        if unnamed is not None:
            yield Ended(unnamed.key, event.time_us)
        yield _named(same, event, quantity, Onset.of_alarm(same))
    elif unnamed is not None:
        yield _named(unnamed, event, quantity, _onset(event))
    else:
        alarm = _raised(event.since_us, event, quantity)
        alarm = replace(alarm, stage="named", updated_us=event.time_us, causes=_reported(event.shares))
        yield Raised(replace(alarm, direction=direction_of(alarm.size)))


def _raised(
    since_us: int, event: ChangeDetected | CauseIdentified, quantity: Callable[[str], Quantity]
) -> Alarm:
    share, onset = event.shares[0], _onset(event)
    size, size_sd = quantity(share.cause).change(share.size, share.size_sd)
    return Alarm(
        parameter=share.cause,
        direction=direction_of(share.size),
        onset_us=onset.time_us,
        raised_us=since_us,
        updated_us=since_us,
        ended_us=None,
        size=size,
        size_sd=size_sd,
        crossings=1,
        onset_low_us=onset.low_us,
        onset_high_us=onset.high_us,
    )


def _named(
    alarm: Alarm, event: CauseIdentified, quantity: Callable[[str], Quantity], onset: Onset
) -> CauseNamed:
    share = event.shares[0]
    size, size_sd = quantity(share.cause).change(share.size, share.size_sd)
    return CauseNamed(
        alarm=alarm.key,
        time_us=event.time_us,
        parameter=share.cause,
        size=size,
        size_sd=size_sd,
        causes=_reported(event.shares),
        doubt=alarm.doubt,
        onset=onset,
        kind=alarm.kind,
    )


def _reported(shares: Iterable[Share]) -> tuple[Cause, ...]:
    return tuple(
        Cause(s.cause, s.probability, s.alike) for s in shares if s.probability >= MIN_PROBABILITY and s.cause
    )


def _named_alarm(open_alarms: Sequence[Alarm], cause: str) -> Alarm | None:
    return next((a for a in open_alarms if a.parameter == cause and a.stage == "named"), None)


def _onset(event: ChangeDetected | CauseIdentified) -> Onset:
    """Onset of a change; its lower end is unknown where it lies before the first sample."""
    onset = event.onset
    low = onset.earliest_us if onset.earliest_us > NEVER // 2 else None
    best = onset.time_us if low is None else max(onset.time_us, low)
    return Onset(best, low, max(onset.latest_us, best))
