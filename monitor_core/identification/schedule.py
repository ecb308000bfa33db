"""Parameters that follow measured signals, as in gain scheduling.

    theta(t) = value + slope_1 (f_1(s_1(t)) - reference_1) + ...

The references are the means over the records.  So the value and the slopes hardly correlate, and a reader who ignores
the signals gets the value that holds in the middle of their range.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.operating_conditions import Term
from monitor_core.identification.problem import IdentificationError
from monitor_core.identification.record import Record

_CONSTANT = 1e-6
"""A signal whose relative variation is smaller counts as constant."""
_DIGITS = 2
"""A reference is rounded to this many digits of the signal's range."""

Schedule = Mapping[str, tuple[str, ...]]
"""Terms (a signal or a function of it) by parameter."""


class ScheduledTerm(NamedTuple):
    """One parameter follows one signal or function of it, ``term``, which lies between low and high in the records."""

    parameter: str
    term: str
    reference: float
    low: float
    high: float

    @property
    def slope(self) -> str:
        """Name of the slope among the estimates."""
        return f"{self.parameter} per {self.term}"


class Slope(NamedTuple):
    """How a parameter follows a signal: its value at the reference, the slope and its standard deviation."""

    scheduled: ScheduledTerm
    value: float
    slope: float
    sd: float

    def at(self, signal: float) -> float:
        """The parameter at this value of the signal."""
        return self.value + self.slope * (signal - self.scheduled.reference)

    @property
    def is_significant(self) -> bool:
        """Whether the slope differs from zero by more than three standard deviations."""
        return abs(self.slope) > 3.0 * self.sd


def scheduled_terms(schedule: Schedule, records: Sequence[Record]) -> tuple[ScheduledTerm, ...]:
    """Where the terms of a schedule lie in the records.

    Raises:
        IdentificationError: a signal was never measured, or is constant in all records.
    """
    terms = _distinct(schedule)
    where = {term: _where(term, records) for term in terms}
    return tuple(
        ScheduledTerm(parameter, term, _reference(*where[term]), *where[term][1:])
        for parameter, followed in schedule.items()
        for term in followed
    )


def with_terms(record: Record, scheduled: Iterable[ScheduledTerm]) -> Record:
    """The record with the scheduled terms, minus their references, as further signals.

    Raises:
        IdentificationError: a signal was never measured in it.
    """
    references = {s.term: s.reference for s in scheduled}
    terms = {term: _values(term, record) - reference for term, reference in references.items()}
    return replace(record, signals={**record.signals, **terms})


def _distinct(schedule: Schedule) -> Iterable[str]:
    return dict.fromkeys(term for terms in schedule.values() for term in terms)


def _where(term: str, records: Sequence[Record]) -> tuple[float, float, float]:
    """Mean, smallest and largest value."""
    values = np.concatenate([_values(term, record) for record in records])
    values = values[np.isfinite(values)]
    mean, low, high = float(values.mean()), float(values.min()), float(values.max())
    if high - low <= _CONSTANT * max(abs(low), abs(high)):
        raise IdentificationError(
            f"{term} is {mean:.6g} throughout the records, so no record shows what follows it: leave it out, or add"
            " records in which it differs"
        )
    return mean, low, high


def _reference(mean: float, low: float, high: float) -> float:
    return round(mean, _DIGITS - math.floor(math.log10(high - low)))


def _values(name: str, record: Record) -> Floats:
    term = Term.read(name)
    values = record.signals.get(term.signal)
    if values is None or not np.isfinite(values).any():
        raise IdentificationError(f"{record.name}: the signal {term.signal} was never measured in it")
    return term.value(values)
