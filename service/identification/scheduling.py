"""Parameters that follow measured signals, as the user asks for them.

    theta(t) = value + slope_1 (f_1(s_1(t)) - reference_1) + ...

The references are means over the records, so that value and slopes hardly correlate, and so that whoever does not
follow the signals has the value that holds in the middle of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.operating_conditions import Term
from monitor_core.drive.structure import split_name
from service.config import AxisConfig
from service.config.conditions import term_of
from service.identification.errors import IdentificationError
from service.identification.parameter_selection import Choice
from service.ingest.identification_records import Loaded
from service.texts.suggestions import did_you_mean

_CONSTANT = 1e-6
"""Relative: a signal that varies less is constant."""
_DIGITS = 2
"""Of the range: so exact is a reference."""


class Follows(NamedTuple):
    """One parameter follows one signal or function of it, ``term``, which in the records lies between low and high."""

    parameter: str
    term: str
    reference: float
    low: float
    high: float

    @property
    def slope(self) -> str:
        """Name of the slope among the estimates."""
        return f"{self.parameter} per {self.term}"


Asked = Mapping[str, tuple[str, ...]]
"""Terms by parameter."""


def asked(texts: Sequence[str], axis: AxisConfig) -> Asked:
    """What the user writes: "fm: temperature", "Ja: payload, cos(angle2)".

    Raises:
        IdentificationError: it is no such text, or there is no such signal or function.
    """
    found = dict[str, tuple[str, ...]]()
    for text in texts:
        parameter, colon, terms = (part.strip() for part in text.partition(":"))
        if not (parameter and colon and terms):
            raise IdentificationError(
                f'--schedule "{text}": write PARAMETER: SIGNAL, as "fm: temperature" or "Ja: payload, cos(angle2)"'
            )
        for term in terms.split(","):
            name = _term(term.strip(), axis)
            if name in found.get(parameter, ()):
                raise IdentificationError(f"{parameter} is to follow {name} twice")
            found[parameter] = (*found.get(parameter, ()), name)
    return found


def _term(text: str, axis: AxisConfig) -> str:
    """As it is called from here on."""
    try:
        return str(term_of(text, [one.name for one in axis.signal]))
    except ValueError as error:
        raise IdentificationError(str(error)) from None


def with_varying(choice: Choice, varying: Asked, free: Sequence[str]) -> Choice:
    """The choice with its parameters called as the varying ones are; ``free``: what the user named there.

    Raises:
        IdentificationError: what is to vary does not exist or is held.
    """
    names = list(choice.free)
    for name in varying:
        if name in names:
            continue
        base = split_name(name)[0]
        called = next((other for other in names if split_name(other)[0] == base), None)
        if base in choice.held:
            raise IdentificationError(
                f"{name} is to vary but is held ({choice.held[base]}): name it in --free"
            )
        if called is None:
            known = (*choice.free, *choice.held)
            raise IdentificationError(f"the drive has no parameter {name}: {did_you_mean(base, known)}")
        if called in free:
            raise IdentificationError(f"{name} is to vary, but free is {called}: write the same in both")
        names[names.index(called)] = name
    return Choice(tuple(names), choice.held)


def followed(
    varying: Asked, used: Sequence[Loaded], quarantined: Sequence[Loaded]
) -> tuple[tuple[Follows, ...], list[Loaded], list[Loaded]]:
    """Where the signals of the records lie, and the records with terms, less their references, for signals.

    Raises:
        IdentificationError: a signal that was never measured, or is the same throughout.
    """
    terms = dict.fromkeys(term for of in varying.values() for term in of)
    where = {term: _where(term, used) for term in terms}
    references = {term: _reference(*where[term]) for term in terms}
    follows = tuple(
        Follows(parameter, term, references[term], *where[term][1:])
        for parameter, of in varying.items()
        for term in of
    )
    made = [[_with_terms(one, references) for one in loaded] for loaded in (used, quarantined)]
    return follows, made[0], made[1]


def _where(term: str, used: Sequence[Loaded]) -> tuple[float, float, float]:
    """Mean, smallest and largest value."""
    values = np.concatenate([_values(term, one) for one in used])
    values = values[np.isfinite(values)]
    mean, low, high = float(values.mean()), float(values.min()), float(values.max())
    if high - low <= _CONSTANT * max(abs(low), abs(high)):
        raise IdentificationError(
            f"{term} is {mean:.6g} throughout the records, so nobody can tell what follows it: leave it out, or add"
            " records where it differs"
        )
    return mean, low, high


def _reference(mean: float, low: float, high: float) -> float:
    return round(mean, _DIGITS - math.floor(math.log10(high - low)))


def _values(name: str, loaded: Loaded) -> Floats:
    term = Term.read(name)
    values = loaded.record.signals.get(term.signal)
    if values is None or not np.isfinite(values).any():
        raise IdentificationError(f"{loaded.source.path}: the signal {term.signal} was never measured there")
    return term.of(values)


def _with_terms(loaded: Loaded, references: Mapping[str, float]) -> Loaded:
    terms = {term: _values(term, loaded) - reference for term, reference in references.items()}
    return loaded._replace(record=replace(loaded.record, signals={**loaded.record.signals, **terms}))
