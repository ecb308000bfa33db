"""What commissioning does about a motor that also moves with other axes: it finds their factors in the records."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.identification import CouplingFactor, MotorCoupling, Record, likely_coupling, motor_coupling
from monitor_core.wording import percent
from service.commands.commissioning.axis.axis_job import REFUSALS, AxisJob, CommissioningProgress
from service.commands.commissioning.axis.load_search import LinkLoad, LoadSearches
from service.config import AxisConfig
from service.config.rules.coupling_rules import may_be_coupled
from service.config.schema.robot_defaults import COUPLING
from service.config.written.corrections import SIGNAL, Correction
from service.ingest.records.loaded_records import load
from service.reports.commissioning_report import Outcome

_CONTRADICTS = 0.25
"""A given factor is in doubt if it differs from the one that is found by this share of it, .."""
_INTERVALS = 3.0
""".. and by so many halves of its 90 % interval."""


def with_coupling(
    job: AxisJob, outcome: Outcome, loads: LoadSearches, progress: CommissioningProgress
) -> tuple[AxisJob, Outcome]:
    """The job and the outcome with the coupling of the motor, if the friction in the records shows one.

    A coupling that is given is kept; a note says so if the records contradict it.  Without --yes a note says what would
    be set.
    """
    try:
        _, axis = job.configured()
        if axis.config.output != "angle":
            return job, outcome
        progress("identify", "looking for coupled motors", 0.0)
        found = _found(job, axis.config.coupling, loads)
    except REFUSALS:  # the drive has a weight, so it cannot be coupled; or identification says what is wrong
        return job, outcome
    if found is None:
        return job, outcome
    if axis.config.coupling:
        notes = _contradictions(axis.config.coupling, found)
        return job, replace(outcome, notes=(*outcome.notes, *notes))
    changes = tuple(_changes(found))
    if not job.shorten:
        words = f"{changes[0].reason[0].upper()}{changes[0].reason[1:]}. --yes applies {_line(_rounded(found))}."
        return job, replace(outcome, notes=(*outcome.notes, words))
    return job.corrected(changes), replace(outcome, corrections=(*outcome.corrections, *changes))


# --- The search in the records ----------------------------------------------------------------------------------------


def _found(job: AxisJob, given: Mapping[str, float], loads: LoadSearches) -> MotorCoupling | None:
    """The factors by the names of axes or signals, found one by one, with the load of links that each makes known."""
    plain, factors, found = job.uncoupled(), dict(given), None
    while True:
        links = loads.search(_coupled(plain, factors).text).links
        again = _one_more(plain, links, list(factors))
        if again is None and links is None and not factors:
            again = _with_hidden_load(plain, loads)
        if again is None or again.factors.keys() == factors.keys():
            return again or found
        factors, found = _rounded(again), again


def _coupled(plain: AxisJob, factors: Mapping[str, float]) -> AxisJob:
    return plain.corrected([Correction((COUPLING, name), factor, "") for name, factor in factors.items()])


def _with_hidden_load(plain: AxisJob, loads: LoadSearches) -> MotorCoupling | None:
    """The first factor, judged with the load of links that shows only with the likeliest factor."""
    records, used, _ = _recorded(plain, None, [])
    likely = likely_coupling(records, list(used.values())) if used else None
    if likely is None:
        return None
    names = {signal: name for name, signal in used.items()}
    trial = _coupled(plain, {names[signal]: factor.value for signal, factor in likely.factors.items()})
    links = loads.search(trial.text).links
    return _one_more(plain, links, []) if links else None


def _one_more(plain: AxisJob, links: LinkLoad | None, known: list[str]) -> MotorCoupling | None:
    """The coupling with one axis more than are known.

    ``plain``: the job without factors in its configuration; ``links``: the load of links with the known factors.
    """
    records, used, terms = _recorded(plain, links, known)
    if not used or not used.keys() >= {*known}:
        return None
    found = motor_coupling(records, list(used.values()), terms, [used[name] for name in known])
    names = {signal: name for name, signal in used.items()}
    return found and found._replace(factors={names[signal]: factor for signal, factor in found.factors.items()})


def _recorded(
    plain: AxisJob, links: LinkLoad | None, known: list[str]
) -> tuple[list[Record], dict[str, str], Sequence[str]]:
    """The records, the signals of the axes that may move the motor, by axis, and the terms of the load of links."""
    config, axis = plain.configured()
    partners = [o for o in config.axes if o.robot == axis.robot and may_be_coupled(axis.config, o.config)]
    signals = {other.config.name: _signal(other.config.name, axis.config) for other in partners}
    changes = [Correction((SIGNAL, signal, "axis"), name, "") for name, signal in signals.items()]
    changes += links.changes if links else ()
    config, _ = plain.corrected(changes).configured()
    records = [load(name, config, plain.axis_id).record for name in plain.records]
    signals |= {name: name for name in known if name not in signals}
    used = {n: s for n, s in signals.items() if all(np.isfinite(r.signals.get(s, np.nan)).any() for r in records)}
    return records, used, links.weights.terms if links else ()


def _signal(name: str, axis: AxisConfig) -> str:
    """A name, that no signal of the axis has, for the angle of another axis as it is sent."""
    signal = f"{name}-as-sent"
    while any(given.name == signal for given in axis.signal):
        signal += "-"
    return signal


# --- What follows from it ---------------------------------------------------------------------------------------------


def _rounded(found: MotorCoupling) -> dict[str, float]:
    return {name: float(f"{factor.value:.3g}") for name, factor in found.factors.items()}


def _changes(found: MotorCoupling) -> Iterator[Correction]:
    left = f"where it then moves against its axis, that leaves {percent(found.against)} of the squared errors"
    for name, value in _rounded(found).items():
        reason = (
            f"by its friction the motor also moves with {name}, by a factor {_interval(found.factors[name])}; {left},"
            " with values from the other half of the records; the data sheet has the exact factor"
        )
        yield Correction((COUPLING, name), value, reason)


def _contradictions(given: Mapping[str, float], found: MotorCoupling) -> Iterator[str]:
    for name, factor in found.factors.items():
        before = given.get(name, 0.0)
        if abs(factor.value - before) > max(_CONTRADICTS * abs(before), _INTERVALS * factor.error):
            words = (
                f"with the factor {before:g} that is given" if name in given else "which the given coupling leaves out"
            )
            yield (
                f"By its friction the motor moves with {name} by a factor {_interval(factor)}, {words}. The coupling is"
                f" kept as it is given; the records agree with {_line(_rounded(found))}."
            )


def _interval(factor: CouplingFactor) -> str:
    low, high = factor.value - factor.error, factor.value + factor.error
    return f"of {low:.3g} to {high:.3g} (90 %)"


def _line(factors: Mapping[str, float]) -> str:
    return f"{COUPLING} = {{ {', '.join(f'{name} = {value:g}' for name, value in factors.items())} }}"
