"""The bank of hypotheses of one axis as a detector: samples in, what it says and the alarms made of it out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import Alarm
from monitor_core.detection.alarm_arrays import episodes_from_array, episodes_to_array
from monitor_core.detection.multimodel.candidates import change
from monitor_core.detection.multimodel.events import Event
from monitor_core.detection.multimodel.hypothesis import Hypothesis
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank, default_hypotheses
from monitor_core.detection.multimodel.multimodel_tracker import HypothesisBook
from monitor_core.detection.multimodel.quantities import Quantity, causes_of, quantity_of
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import slowest_time_constant
from monitor_core.kernel.hypotheses import BankTrace
from monitor_core.settings import Settings

SCHEMA = 1
"""Of a saved state; another one is not read."""


@dataclass(frozen=True)
class Limit:
    """Threshold and allowance of one hypothesis, as a healthy record asks for them."""

    cause: str
    size: float
    h: float
    allowance: float = 0.0
    alike: tuple[str, ...] = ()


@dataclass(frozen=True)
class Limits:
    """When the bank alarms.

    ``own``: of each hypothesis, which are then those that are looked for.  Empty: the candidates that change the data,
    all with the h that the guaranteed run length gives for one false alarm in ``samples``.
    """

    samples: float
    own: tuple[Limit, ...] = ()


def guaranteed(hypotheses: int, samples: float) -> float:
    """h with which so many hypotheses have one false alarm in so many samples, or fewer, if the model is exact.

    The mean time between false alarms of each is at least e^h samples (Lorden), so that of all is at least e^h / H.
    """
    return math.log(max(hypotheses * samples, math.e))


def unfit(model: AxisModel, settings: Settings) -> str:
    """Why there can be no bank for an axis, in words; empty: there can."""
    if settings.untold:
        return "its nominal values cannot tell some of the parameters apart"
    gain = settings.gain(len(model.drive.states))
    if not math.isfinite(slowest_time_constant(model, gain, settings.interval_s)):
        return "its predictor is not stable by itself"
    return ""


def bank_of(model: AxisModel, settings: Settings, limits: Limits) -> HypothesisBank:
    """The bank of an axis.

    Raises:
        KeyError: a limit of a cause that the axis does not have.
        ValueError: it cannot have a bank, or limits make no sense.
    """
    if not limits.own:
        hypotheses = _default(_Axis(model, settings))
        return HypothesisBank(model, settings, hypotheses, h=guaranteed(len(hypotheses), limits.samples))
    found = [replace(change(model, settings, one.cause, one.size), alike=one.alike) for one in limits.own]
    h, allowance = (np.array([getattr(one, name) for one in limits.own]) for name in ("h", "allowance"))
    return HypothesisBank(model, settings, found, h, allowance)


class _Axis:
    """Axes with the same model and settings have the same hypotheses; these are found once."""

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
    """The bank of one axis and the book of its alarms.

    The bank is made when it is needed first: its hypotheses are told apart by the compiled kernel.

    Args:
        model: of the axis.
        settings: of the axis.
        limits: when it alarms.

    Raises:
        ValueError: the axis cannot have a bank; limits of unknown causes.
    """

    def __init__(self, model: AxisModel, settings: Settings, limits: Limits) -> None:
        if reason := unfit(model, settings):
            raise ValueError(reason)
        self._model, self._settings, self._limits = model, settings, limits
        self.causes = causes_of(model)
        """Whatever it may name"""
        if unknown := {one.cause for one in limits.own} - set(self.causes):
            raise ValueError(f"limits of {', '.join(sorted(unknown))}, which the axis does not have")
        self.book = HypothesisBook(self.quantity)

    @cached_property
    def bank(self) -> HypothesisBank:
        """The hypotheses and their state."""
        return bank_of(self._model, self._settings, self._limits)

    @property
    def made(self) -> bool:
        """Whether there is a bank by now, and so a state."""
        return "bank" in self.__dict__

    def quantity(self, cause: str) -> Quantity:
        """Nominal value and unit of a cause."""
        return quantity_of(self._model, self._settings, cause)

    def run(
        self,
        t_us: NDArray[np.int64],
        u: Floats,
        y: Floats,
        gate: NDArray[np.bool_] | None = None,
        shift: Floats | None = None,
    ) -> list[Event]:
        """Samples (N,) as for ``HypothesisBank.run``; what it says of them."""
        return self.bank.run(t_us, u, y, gate, shift)

    def run_traced(
        self,
        t_us: NDArray[np.int64],
        u: Floats,
        y: Floats,
        gate: NDArray[np.bool_] | None = None,
        shift: Floats | None = None,
    ) -> tuple[list[Event], BankTrace]:
        """As ``run``, with what happened at every sample, as ``HypothesisBank.run_traced``."""
        return self.bank.run_traced(t_us, u, y, gate, shift)

    def apply(self, event: Event) -> list[Alarm]:
        """Take an event into the book; returns the episodes that it raised, changed or ended."""
        return self.book.apply(event)

    def leading(self) -> tuple[str, float]:
        """The cause that is nearest its threshold, and g over h; none before the first sample."""
        return self.bank.leading() if self.made else ("", 0.0)

    def adopt(self, open_alarms: Iterable[Alarm]) -> None:
        """Have these open alarms and no others; what is named in them stands from now on."""
        episodes = list(open_alarms)
        if _told(episodes) == _told(self.book.open):
            self.book = HypothesisBook(self.quantity, episodes)
            return
        self.book = HypothesisBook(self.quantity, episodes)
        named = {e.parameter: self.quantity(e.parameter).size(e.size) for e in episodes if e.stage == "named"}
        fresh = [e.raised_us for e in episodes if e.stage == "changed"]
        known = self.bank.causes
        self.bank.adopt({c: size for c, size in named.items() if c in known}, fresh[0] if fresh else None)

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        """The whole state, to be saved: arrays by name."""
        return self.bank.to_arrays() | {"episodes": episodes_to_array(self.book.open)}

    def from_arrays(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Go on from a saved state.

        Raises:
            KeyError: an array is missing.
            ValueError: it does not belong to this axis, or is damaged.
        """
        episodes = episodes_from_array(arrays["episodes"], self.causes)
        self.bank.from_arrays(arrays)
        self.book = HypothesisBook(self.quantity, episodes)


def _told(episodes: Iterable[Alarm]) -> list[tuple[object, ...]]:
    """What the bank has to know of them."""
    return sorted((e.raised_us, e.parameter, e.stage) for e in episodes)
