"""Starting values of a given drive, from the records alone or from given values, and the fits from the best of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.drive.structure import split_name
from monitor_core.identification.greybox import Estimate, Problem, fit
from monitor_core.identification.records.record import Record
from monitor_core.identification.starting.chains import Slots, chain_of_modes
from monitor_core.identification.starting.growing_chains import longer, stems
from monitor_core.identification.starting.modes import black_boxes, modal
from monitor_core.identification.starting.response import Measured, Response, measure
from monitor_core.identification.starting.search import (
    MOST,
    SAME,
    Found,
    Progress,
    Steps,
    explained,
    polish,
    search,
)

_FEWER = 20
"""Searches around what the closed form has found."""


def fit_from_scratch(
    problem: Problem, records: Sequence[Record], *, progress: Progress | None = None
) -> Estimate:
    """The fit from the records alone; the nominal values of free parameters are not used.

    ``progress`` is called with the steps done and their maximum.

    Raises:
        ValueError: as ``candidates`` and ``fit``.
    """
    return _fit(problem, records, None, progress)


def fit_from(
    problem: Problem,
    records: Sequence[Record],
    given: Mapping[str, float] | None = None,
    *,
    progress: Progress | None = None,
) -> Estimate:
    """The fit from values that may be far off; default: the nominal ones of the problem.

    ``progress`` is called with the steps done and their maximum.

    Raises:
        KeyError: values for a parameter that is not free.
        ValueError: as ``candidates`` and ``fit``.
    """
    return _fit(problem, records, given or {}, progress)


def _fit(
    problem: Problem, records: Sequence[Record], given: Mapping[str, float] | None, progress: Progress | None
) -> Estimate:
    steps = Steps(progress, MOST + FITTING)
    found = candidates(problem, records, given, steps.part(0, MOST))
    steps.reached(MOST)
    return best_fit(problem, records, found, steps.part(MOST, FITTING))


def candidates(
    problem: Problem,
    records: Sequence[Record],
    given: Mapping[str, float] | None = None,
    reached: Callable[[int], None] = lambda _: None,
) -> tuple[Candidate, ...]:
    """Starting values for the free parameters, the best first.

    Args:
        problem: what is free; nominal values of what is free are used only as ``given`` says.
        records: of the drive.
        given: values to search from, for free parameters that are not as in the problem's nominal ones.  None: the
            records alone, in closed form or by growth.
        reached: told how many of ``MOST`` searches are done.

    Raises:
        ValueError: the records tell no frequency response; without ``given``: the motor does not see a chain of
            masses that are all free, or the response shows no chain of so many.
    """
    measured = measure(records)
    if given is None:
        return _from_records(problem, measured, reached)
    return _from_given(problem, measured, given, reached)


def _from_given(
    problem: Problem, measured: Measured, given: Mapping[str, float], reached: Callable[[int], None]
) -> tuple[Candidate, ...]:
    response = Response(problem, _by_base(problem, given))
    ends = search(response, measured, reached=reached)
    return tuple(candidate(response, end, measured, "a search around the values given") for end in ends)


def _from_records(
    problem: Problem, measured: Measured, reached: Callable[[int], None]
) -> tuple[Candidate, ...]:
    """The cheapest method first: closed form, growth, search; the next one where the result is doubtful."""
    slots = Slots(problem)
    found = list(_closed(problem, slots, measured))
    if _doubtful(found, measured):
        found += _grown(problem, slots, measured)
    if not found:
        raise ValueError(
            "the frequency response shows no chain of so many masses: give values to search from"
        )
    if _doubtful(found, measured):
        best = min(found, key=lambda candidate: candidate.cost)
        response = Response(problem, best.values)
        ends = search(response, measured, _FEWER, reached=lambda done: reached(done * MOST // _FEWER))
        origin = f"a search around {best.origin}"
        found += [candidate(response, end, measured, origin) for end in ends]
    return tuple(distinct_candidates(found))


def _doubtful(found: Sequence[Candidate], measured: Measured) -> bool:
    """As in the search: one end may be stuck next to the right minimum, two alike that explain the response are not."""
    best = min((candidate.cost for candidate in found), default=np.inf)
    agreed = sum(candidate.cost < SAME * best for candidate in found) > 1
    return not agreed or best > explained(measured)


def _closed(problem: Problem, slots: Slots, measured: Measured) -> Iterator[Candidate]:
    """Closed form, polished, one for each black box that shows enough resonances."""
    for name, poles, residues in black_boxes(measured, slots.masses):
        try:
            seen = modal(measured, slots.masses, poles, residues)
            values = slots.values(chain_of_modes(seen.p, seen.a), seen.decay)
        except (ValueError, np.linalg.LinAlgError):
            continue
        response = Response(problem, values)
        end = polish(response, measured, response.start)
        if np.isfinite(end.cost):
            yield candidate(response, end, measured, f"the resonances of {name}")


def _grown(problem: Problem, slots: Slots, measured: Measured) -> Iterator[Candidate]:
    """Chains that grew mass by mass; a single mass has nothing to grow from."""
    if slots.masses == 1:
        return
    for stem in longer(problem, stems(measured, slots.masses - 1), measured):
        yield candidate(stem.response, stem.end, measured, f"a chain that grew to {slots.masses} masses")


def _by_base(problem: Problem, given: Mapping[str, float]) -> dict[str, float]:
    """The values of what the names invert.

    Raises:
        KeyError: a name that is not free.
    """
    for name in given:
        if name not in problem.free:
            raise KeyError(f"start of {name}: it is not free")
    split = {name: split_name(name) for name in given}
    return {base: 1 / given[name] if inverse else given[name] for name, (base, inverse) in split.items()}


# --- Candidates for starting values, and the fit of the records from the best of them ---------------------------------


_RIVALS = 2
"""Candidates from which the records themselves are fitted."""
_DOUBTFUL = 10.0
"""A rival whose cost is so many times that of the best is not tried."""
_FIT = 20
"""Steps that the fit from one candidate counts for in the progress; one evaluation each, further ones do not count."""
FITTING = _RIVALS * _FIT
"""Steps of ``best_fit``."""


@dataclass(frozen=True)
class Candidate:
    """Starting values.

    Args:
        values: of all parameters of the drive.
        origin: the method, in words.
        cost: squared relative errors of their frequency response over their variances.
        expected: the cost of the right values, within the uncertainty of the response.
    """

    values: Mapping[str, float]
    origin: str
    cost: float
    expected: float


def candidate(response: Response, end: Found, measured: Measured, origin: str) -> Candidate:
    """Where a search in the frequency response ended."""
    return Candidate(response.named(end.x), origin, end.cost, measured.expected)


def distinct_candidates(found: Sequence[Candidate]) -> Iterator[Candidate]:
    """Sorted by cost, each minimum once."""
    last = 0.0
    for candidate in sorted(found, key=lambda candidate: candidate.cost):
        if candidate.cost > SAME * last:
            yield candidate
            last = candidate.cost


def best_fit(
    problem: Problem,
    records: Sequence[Record],
    candidates: Sequence[Candidate],
    reached: Callable[[int], None],
) -> Estimate:
    """The best of the fits from the best candidates, with a word on which won.

    ``reached`` is told how many of ``FITTING`` steps are done.

    Raises:
        ValueError: none can be fitted from.
    """
    rivals = [
        candidate for candidate in candidates[:_RIVALS] if candidate.cost <= _DOUBTFUL * candidates[0].cost
    ]
    ends, problems = list[tuple[Estimate, Candidate]](), list[ValueError]()
    for i, candidate in enumerate(rivals):
        try:
            ends.append((_fit_one(problem, records, candidate, reached, i * _FIT), candidate))
        except ValueError as error:
            problems.append(error)
    if not ends:
        raise problems[0]
    reached(FITTING)
    best, winner = min(ends, key=lambda end: end[0].cost)
    return replace(best, started_from=_origin(winner, len(candidates), len(rivals)))


def _fit_one(
    problem: Problem,
    records: Sequence[Record],
    candidate: Candidate,
    reached: Callable[[int], None],
    first: int,
) -> Estimate:
    def report(count: int, _: float) -> None:
        reached(first + min(count, _FIT))

    return fit(problem, records, _free(problem, candidate.values), progress=report)


def _origin(winner: Candidate, candidates: int, rivals: int) -> str:
    ratio = winner.cost / winner.expected
    return (
        f"Started from {winner.origin}, the best of {rivals} fits from {candidates} candidates; its frequency response"
        f" misses the measured one by {np.sqrt(ratio):.2g} times what the record leaves unsure."
    )


def _free(problem: Problem, values: Mapping[str, float]) -> dict[str, float]:
    """As ``fit`` takes them: free parameters by their names, inside their bounds."""
    out = {}
    for name in problem.free:
        base, inverse = split_name(name)
        value = 1 / values[base] if inverse else values[base]
        lower, upper = problem.bounds.get(name, (-np.inf, np.inf))
        out[name] = float(np.clip(value, lower, upper))
    return out
