"""Starting values of a drive, from the records alone or from its nominal values, and the fits from the best of them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.drive.parameter_names import split_name, value_of, with_values
from monitor_core.drive.structure import DAMPING, INERTIA, STIFFNESS
from monitor_core.identification.greybox import Estimate, fit
from monitor_core.identification.problem import Problem
from monitor_core.identification.record_checks.known_axis import rigid_inertia
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.starting.growing_chains import FittedChain, grown_chains
from monitor_core.identification.starting.response import Measured, Response, measure
from monitor_core.identification.starting.search import (
    MOST,
    SearchEnd,
    SearchProgress,
    StepCounter,
    distinct,
    explained,
    search,
)
from monitor_core.identification.torque_balance.rigid_body import rigid_fits, speed_scales
from monitor_core.identification.torque_balance.torque_windows import POSE
from monitor_core.identification.weight.weight_balance import WeightBalance, slow_parts

_FEWER = 20
"""Largest number of searches around a chain that does not explain the response."""
_RIVALS = 2
"""Number of candidates from which the records themselves are fitted."""
_DOUBTFUL = 10.0
"""A rival is not tried if its cost exceeds that of the best by this factor."""
_ALIKE = 1.0
"""Simulated fits that differ by less than this (per cent) count as equal."""
_NOTHING = -100.0
"""Simulated fits below this (per cent) count as equally bad."""
_BETTER = 1 - 1e-4
"""A lower cost counts if it is lower by this factor."""
_FIT = 20
"""Steps of the progress for the fit from one candidate: one per evaluation; further evaluations do not count."""
_GROWN = "a chain that was extended mass by mass"
FITTING = _RIVALS * _FIT
"""Steps of ``best_fit``."""

Reached = Callable[[int], None]
"""Called with the number of completed steps."""


@dataclass(frozen=True)
class Candidate:
    """Starting values."""

    values: Mapping[str, float]  # of all parameters of the drive
    origin: str  # the method, in words
    cost: float  # squared relative errors of their frequency response over their variances
    expected: float  # the cost of the right values, within the uncertainty of the response


def fit_from_scratch(
    problem: Problem, records: Sequence[Record], *, progress: SearchProgress | None = None
) -> Estimate:
    """The fit from the records alone; the nominal values of free parameters are not used.

    ``progress`` is called with the steps done and their maximum.

    Raises:
        ValueError: the records give no frequency response; the motor does not see a chain of masses that are all free,
            or the response shows no chain of so many; as ``fit``.
    """
    return _fit(problem, records, from_records, progress)


def fit_from(problem: Problem, records: Sequence[Record], *, progress: SearchProgress | None = None) -> Estimate:
    """The fit from the nominal values, which may be far off.

    ``progress`` is called with the steps done and their maximum.

    Raises:
        ValueError: the records give no frequency response; as ``fit``.
    """
    return _fit(problem, records, around_nominal, progress)


def fit_from_torque_balance(problem: Problem, records: Sequence[Record]) -> Estimate:
    """The fit of a rigid drive from its torque balance: where a slow motion under a weight gives no frequency response.

    The signals that act on the drive as torques are in the balance, too.

    Raises:
        ValueError: the drive is not one free inertia, or the torque balance explains nothing; as ``fit``.
    """
    terms = [signal for _, signal in problem.followed_torques]
    nominal = _balanced_values(problem, records, terms) if terms else None
    if nominal is None:
        (found,) = rigid_fits(records, [POSE], problem.speed_scale)
        if _rigid_inertia_of(problem) is None or found is None or found.inertia <= 0:
            raise ValueError("the torque balance of the records gives no starting values of this drive")
        nominal = _with_rigid_mass(problem, found.inertia, max(found.torques["viscous"], 0.0))
    fitted = fit(replace(problem, nominal=nominal), records)
    return replace(fitted, started_from="Started from the torque balance of the records as one mass.")


def hold_balanced_inertia(problem: Problem, records: Sequence[Record], terms: Sequence[str]) -> Problem | None:
    """The problem with the inertia held that the torque balance shows; None: no rigid drive, or it shows none.

    A torque that rings with the arm, which the motor hardly follows, is noise to one mass.  The next sample is then
    predicted best with little torque, so with an inertia far too large.  Over longer times the torque explains the
    motion.

    ``terms``: signals that act on the drive as torques, too.
    """
    nominal = _balanced_values(problem, records, terms)
    if nominal is None:
        return None
    inertia = _rigid_inertia_of(problem)
    free = tuple(name for name in problem.free if split_name(name)[0] != inertia)
    return replace(problem, nominal=nominal, free=free)


def _balanced_values(problem: Problem, records: Sequence[Record], terms: Sequence[str]) -> Mapping[str, float] | None:
    """The nominal values with the rigid mass of the torque balance; None: as of ``hold_balanced_inertia``."""
    parts, window = slow_parts(records, terms)
    if _rigid_inertia_of(problem) is None or not parts:
        return None
    balance = WeightBalance(parts, window, speed_scales(records)[1])
    found = balance.rigid_mass([balance.column(part.signals[term] for part in parts) for term in terms])
    return None if found is None else _with_rigid_mass(problem, *found)


def _rigid_inertia_of(problem: Problem) -> str | None:
    """The inertia of a rigid drive, if just one is free."""
    elastic = any(p.unit == STIFFNESS for p in problem.drive.parameters)
    inertias = _free_of(problem, INERTIA)
    return None if elastic or len(inertias) != 1 else inertias[0]


def _free_of(problem: Problem, unit: str) -> list[str]:
    """The free parameters of this unit."""
    bases = dict.fromkeys(split_name(name)[0] for name in problem.free)
    return [name for name in bases if problem.drive.parameter(name).unit == unit]


def _with_rigid_mass(problem: Problem, inertia: float, viscous: float) -> Mapping[str, float]:
    """The nominal values with these of one mass, as the motor sees it."""
    name, dampers = _free_of(problem, INERTIA)[0], _free_of(problem, DAMPING)
    # Scale the inertia as seen by the motor, as it may be behind a gear, or the torque constant may differ from 1.
    nominal = {**problem.nominal, **dict.fromkeys(dampers, 1.0)}  # without friction it has no time constant
    nominal[name] *= inertia / rigid_inertia(problem.drive, nominal)
    return nominal | dict.fromkeys(dampers[:1], viscous)


def _fit(
    problem: Problem,
    records: Sequence[Record],
    candidates: Callable[[Problem, Measured, Reached], Sequence[Candidate]],
    progress: SearchProgress | None,
) -> Estimate:
    steps = StepCounter(progress, MOST + FITTING)
    found = candidates(problem, measure(records), steps.part(0, MOST))
    steps.reached(MOST)
    return best_fit(problem, records, found, steps.part(MOST, FITTING))


# --- Candidates, the best first; ``reached`` gets how many of MOST searches are done -------------------------------


def around_nominal(problem: Problem, measured: Measured, reached: Reached) -> list[Candidate]:
    """Candidates from searches around the nominal values."""
    response = Response(problem)
    ends = search(response, measured, reached=reached)
    return [_candidate(response, end, measured, "a search around the values given") for end in ends]


def from_records(problem: Problem, measured: Measured, reached: Reached) -> list[Candidate]:
    """Chains that were extended mass by mass; if none of them explains the response, also searches around the best.

    Raises:
        ValueError: the motor does not see a chain of masses that are all free, or the response shows none.
    """
    found = from_chains(grown_chains(problem, measured), measured)
    if not found:
        raise ValueError("the frequency response does not show that many masses: give start values")
    if found[0].cost > explained(measured):
        response = Response(problem, found[0].values)
        ends = search(response, measured, _FEWER, reached=lambda done: reached(done * MOST // _FEWER))
        found += [_candidate(response, end, measured, f"a search around {_GROWN}") for end in ends]
    return list(distinct(found))


def from_chains(grown: Iterable[FittedChain], measured: Measured) -> list[Candidate]:
    """Chains that were extended mass by mass."""
    return [_candidate(chain.response, chain.end, measured, _GROWN) for chain in grown]


def _candidate(response: Response, end: SearchEnd, measured: Measured, origin: str) -> Candidate:
    """The candidate at the end of a search in the frequency response."""
    return Candidate(response.named(end.x), origin, end.cost, measured.expected)


# --- The fit of the records from the best of them ---------------------------------------------------------------------


def best_fit(
    problem: Problem, records: Sequence[Record], candidates: Sequence[Candidate], reached: Reached
) -> Estimate:
    """The best of the fits from the best candidates, with a word on which won.

    ``reached`` gets how many of ``FITTING`` steps are done.

    Raises:
        ValueError: none can be fitted from.
    """
    rivals = [c for c in candidates[:_RIVALS] if c.cost <= _DOUBTFUL * candidates[0].cost]
    ends, problems = list[tuple[Estimate, Candidate]](), list[ValueError]()
    for i, rival in enumerate(rivals):

        def report(count: int, _: float, before: int = i * _FIT) -> None:
            reached(before + min(count, _FIT))

        try:
            ends.append((fit(_started(problem, rival.values), records, progress=report), rival))
        except ValueError as error:
            problems.append(error)
    if not ends:
        raise problems[0]
    reached(FITTING)
    best = best_of([found for found, _ in ends])
    winner = next(rival for found, rival in ends if found is best)
    return replace(best, started_from=_origin(winner, len(candidates), len(rivals)))


def best_of(found: Sequence[Estimate]) -> Estimate:
    """The estimate that explains the records best.

    With a model that is not exact there are several minima with almost equal one-step predictions, as the gain corrects
    their errors.  The one that also simulates the motion best is right; among equally good ones the least cost decides,
    and then the first.
    """
    rivals = [e for e in found if e.converged] or list(found)
    if len(rivals) == 1:
        return rivals[0]
    most = max(_simulates(e) for e in rivals)
    alike = [e for e in rivals if _simulates(e) >= most - _ALIKE]
    least = min(e.cost for e in alike)
    return next(e for e in alike if e.cost <= least / _BETTER)


def _simulates(found: Estimate) -> float:
    return max(min(found.fit_simulation), _NOTHING)


def _origin(winner: Candidate, candidates: int, rivals: int) -> str:
    ratio = winner.cost / winner.expected
    return (
        f"Started from {winner.origin}, the best of {rivals} fits from {candidates} candidates; its frequency response"
        f" differs from the measured one by {np.sqrt(ratio):.2g} times the uncertainty of the latter."
    )


def _started(problem: Problem, values: Mapping[str, float]) -> Problem:
    """The problem with its free parameters at these values, inside their bounds."""
    bounds = [problem.bounds.get(name, (-np.inf, np.inf)) for name in problem.free]
    inside = [float(np.clip(value_of(values, n), *b)) for n, b in zip(problem.free, bounds, strict=True)]
    return replace(problem, nominal=with_values(problem.nominal, problem.free, inside))
