"""Selection of the parameters of a drive that are estimated, that are held, and that follow measured signals."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.parameter_names import slope_name, split_name
from monitor_core.drive.signal_terms import Term
from monitor_core.drive.structure import Drive
from monitor_core.identification.problem import RELATIVE, IdentificationError
from monitor_core.identification.records.measured_record import Record
from monitor_core.modeling.identifiability import structural
from monitor_core.modeling.statespace import StateSpace
from monitor_core.wording import did_you_mean

ScheduledTerms = Mapping[str, tuple[str, ...]]
"""Terms (a signal or a function of it) by parameter."""


class ParameterSelection(NamedTuple):
    """Names of the free parameters, and the held ones, each with the reason; held ones keep their nominal values."""

    free: tuple[str, ...]
    held: Mapping[str, str]


def select_parameters(
    space: StateSpace, drive: Drive, nominal: Mapping[str, float], free: Sequence[str], fix: Sequence[str]
) -> ParameterSelection:
    """Select the parameters to be estimated.

    Args:
        space: state space of the drive, for its structural identifiability.
        drive: the drive with these parameters.
        nominal: values of all parameters; friction that is held at zero carries no information.
        free: names to be estimated, "1/Ja" for the reciprocal of Ja; empty: all that are identifiable.
        fix: names that are held.

    Raises:
        IdentificationError: an unknown name, a name that is both free and fixed, or parameters that no record can
            distinguish.
    """
    _check_names(drive, (*free, *fix))
    if both := {split_name(name)[0] for name in free} & {split_name(name)[0] for name in fix}:
        raise IdentificationError(f"{', '.join(sorted(both))}: cannot be both free and fixed")
    fixed = {split_name(name)[0]: "fixed by --fix" for name in fix}
    chosen = _chosen(drive, free, fixed) if free else _default(space, drive, fixed)
    if not chosen.free:
        raise IdentificationError(f"nothing is free: of {', '.join(p.name for p in drive.parameters)} all are held")
    inputs = np.flatnonzero(drive.acting(nominal, chosen.free)).tolist()
    _check_identifiable(space, chosen.free, inputs)
    return chosen


def with_schedule(selection: ParameterSelection, schedule: ScheduledTerms, free: Sequence[str]) -> ParameterSelection:
    """The selection with its free parameters named as in the schedule; ``free``: names that the user gave.

    Raises:
        IdentificationError: a scheduled parameter does not exist, is held, or has another name among the free ones.
    """
    names = list(selection.free)
    for name in schedule:
        if name in names:
            continue
        base = split_name(name)[0]
        other = next((other for other in names if split_name(other)[0] == base), None)
        if base in selection.held:
            raise IdentificationError(f"{name} is scheduled but held ({selection.held[base]}): name it in --free")
        if other is None:
            known = (*selection.free, *selection.held)
            raise IdentificationError(f"the drive has no parameter {name}: {did_you_mean(base, known)}")
        if other in free:
            raise IdentificationError(f"{name} is scheduled, but {other} is free: write the same in both")
        names[names.index(other)] = name
    return ParameterSelection(tuple(names), selection.held)


def _check_names(drive: Drive, names: Sequence[str]) -> None:
    known = [p.name for p in drive.parameters]
    for name in names:
        base, _ = split_name(name)
        if base in known:
            continue
        if base in {p.name for p in drive.drawn}:
            try:
                drive.parameter(base)
            except KeyError as error:
                raise IdentificationError(str(error.args[0]).replace("monitor that", "name that")) from None
        raise IdentificationError(f"the drive has no parameter {base}: {did_you_mean(base, known)}")


def _chosen(drive: Drive, free: Sequence[str], fixed: Mapping[str, str]) -> ParameterSelection:
    bases = {split_name(name)[0] for name in free}
    rest = {p.name: "not in --free" for p in drive.parameters if p.name not in bases}
    return ParameterSelection(tuple(dict.fromkeys(free)), {**rest, **fixed})


def _default(space: StateSpace, drive: Drive, fixed: Mapping[str, str]) -> ParameterSelection:
    """All parameters except fixed ones, torque constant, gear ratio, and those that are still not identifiable."""
    names = [p.name for p in drive.parameters]
    held = {**{name: "known from the data sheet" for name in RELATIVE if name in names}, **fixed}
    drawn = [p.name for p in space.drawn if p.name not in held]
    for name in structural(space, drawn).suggestion if drawn else ():
        held.setdefault(name, "the sensors cannot distinguish it from the others")
    return ParameterSelection(tuple(n for n in names if n not in held), {n: held[n] for n in names if n in held})


def _check_identifiable(space: StateSpace, free: Sequence[str], inputs: Sequence[int]) -> None:
    """Refuse parameters that no record identifies; merged parameters stand for those that they are merged from."""
    drawn = {p.name for p in space.drawn}
    bases = [split_name(name)[0] for name in free]
    if not set(bases) <= drawn:
        return
    found = structural(space, bases, inputs=inputs)
    if found.suggestion:
        raise IdentificationError(
            f"{len(bases)} parameters are free, but torque and motion can determine only {found.count} numbers:"
            f" {' '.join(found.words())}"
        )


# --- Parameters that follow measured signals, as in gain scheduling ---------------------------------------------------


#    theta(t) = value + slope_1 (f_1(s_1(t)) - reference_1) + ...
#
# The references are the means over the records.  So the value and the slopes are hardly correlated, and the value is
# the one in the middle of the range of the signals.

_CONSTANT = 1e-6
"""A signal whose relative variation is smaller counts as constant."""
_DIGITS = 2
"""A reference is rounded to this many digits of the signal's range."""


class ScheduledTerm(NamedTuple):
    """A parameter that follows a signal or a function of it (``term``), and the range of the term in the records."""

    parameter: str
    term: str
    reference: float
    low: float
    high: float

    @property
    def slope(self) -> str:
        """Name of the slope among the estimates."""
        return slope_name(self.parameter, self.term)


class Slope(NamedTuple):
    """Dependence of a parameter on a signal: value at the reference, slope and its standard deviation."""

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


def scheduled_terms(schedule: ScheduledTerms, records: Sequence[Record]) -> tuple[ScheduledTerm, ...]:
    """The terms of a schedule with their references and ranges in the records.

    Raises:
        IdentificationError: a signal was never measured, or is constant in all records.
    """
    where = {term: _where(term, records) for terms in schedule.values() for term in terms}
    return tuple(
        ScheduledTerm(parameter, term, *where[term]) for parameter, followed in schedule.items() for term in followed
    )


def with_terms(record: Record, scheduled: Iterable[ScheduledTerm]) -> Record:
    """The record with the scheduled terms, minus their references, as further signals.

    Raises:
        IdentificationError: a signal was never measured in it.
    """
    references = {s.term: s.reference for s in scheduled}
    terms = {term: _values(term, record) - reference for term, reference in references.items()}
    return replace(record, signals={**record.signals, **terms})


def _where(term: str, records: Sequence[Record]) -> tuple[float, float, float]:
    """Rounded mean, smallest and largest value of a term."""
    values = np.concatenate([_values(term, record) for record in records])
    values = values[np.isfinite(values)]
    mean, low, high = float(values.mean()), float(values.min()), float(values.max())
    if high - low <= _CONSTANT * max(abs(low), abs(high)):
        raise IdentificationError(
            f"{term} is {mean:.6g} throughout the records, so its effect cannot be estimated: leave it out, or add"
            " records in which it varies"
        )
    return round(mean, _DIGITS - math.floor(math.log10(high - low))), low, high


def _values(name: str, record: Record) -> Floats:
    term = Term.read(name)
    for signal in term.signals:
        values = record.signals.get(signal)
        if values is None or not np.isfinite(values).any():
            raise IdentificationError(f"{record.name}: the signal {signal} was never measured in it")
    return term.value(record.signals)
