"""Candidates for starting values, and the fit of the records from the best of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.drive.structure import split_name
from monitor_core.identification.greybox import Estimate, Problem, fit
from monitor_core.identification.record import Record
from monitor_core.identification.starting.modal import Response
from monitor_core.identification.starting.response import Measured
from monitor_core.identification.starting.search import SAME, Found

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
        origin: where they come from, in words.
        cost: squared relative errors of their frequency response over their variances.
        expected: what that is for the right values, as far as the response is known.
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
    for one in sorted(found, key=lambda one: one.cost):
        if one.cost > SAME * last:
            yield one
            last = one.cost


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
    rivals = [one for one in candidates[:_RIVALS] if one.cost <= _DOUBTFUL * candidates[0].cost]
    ends, problems = list[tuple[Estimate, Candidate]](), list[ValueError]()
    for i, one in enumerate(rivals):
        try:
            ends.append((_fit_one(problem, records, one, reached, i * _FIT), one))
        except ValueError as error:
            problems.append(error)
    if not ends:
        raise problems[0]
    reached(FITTING)
    best, winner = min(ends, key=lambda end: end[0].cost)
    return replace(best, started_from=_origin(winner, len(candidates), len(rivals)))


def _fit_one(
    problem: Problem, records: Sequence[Record], one: Candidate, reached: Callable[[int], None], first: int
) -> Estimate:
    def told(count: int, _: float) -> None:
        reached(first + min(count, _FIT))

    return fit(problem, records, _free(problem, one.values), progress=told)


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
