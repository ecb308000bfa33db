"""How many masses a drive has: chains grow as long as the records ask for one more mass (grown.py says what that is).

Every model's estimates start the next one (growth.py).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.drive.structure import Output
from monitor_core.identification.greybox import Estimate, Problem, compare
from monitor_core.identification.record import Record
from monitor_core.identification.starting.candidates import FITTING, best_fit, candidate
from monitor_core.identification.starting.chains import FRICTION, chain, names
from monitor_core.identification.starting.grown import Grown, Growth, asked, doubt_of, judged, verdict
from monitor_core.identification.starting.growth import Stem, longer, rigid
from monitor_core.identification.starting.modal import Response
from monitor_core.identification.starting.response import Measured, measure
from monitor_core.identification.starting.search import Found
from monitor_core.identification.starting.search_progress import Progress, Steps
from monitor_core.identification.starting.slots import Slots


def grow(
    records: Sequence[Record],
    upto: int = 5,
    *,
    like: Problem | None = None,
    friction: Sequence[str] = FRICTION,
    validation: Sequence[Record] = (),
    progress: Progress | None = None,
) -> Growth:
    """Fit chains of one mass, two, and so on, until one more is not asked for.

    Args:
        records: to fit.
        upto: masses at most.
        like: a problem whose predictor, disturbance, loss, delay, speed scale and so on are taken; its drive, values,
            free parameters and bounds are not.  None: output error, friction from the simulated speed.
        friction: which of fm, fc and tau0 are free; the others are zero.
        validation: records kept aside.
        progress: called with steps done and how many there are at most.

    Raises:
        ValueError: the records tell no frequency response, ``upto`` is below 1, friction of another name; what
            ``fit`` refuses.
    """
    _check(upto, friction)
    measured, steps = measure(records), Steps(progress, upto * FITTING)
    stems, models, failed = rigid(measured), list[Grown](), ""
    for masses in range(1, upto + 1):
        problem = problem_of(masses, measured.output, like, friction)
        if models:
            stems = longer(problem, (_stem(models[-1]), *stems), measured)
        try:
            found = _fitted(problem, records, stems, measured, steps.part((masses - 1) * FITTING, FITTING))
        except ValueError as error:
            if not models:
                raise
            failed = str(error)
            break
        models = judged([*models, _of(masses, found, measured, validation)], records)
        if len(models) > 1 and not asked(*models[-2:]):
            break
    steps.reached(upto * FITTING)
    return verdict(models, failed)


def problem_of(
    masses: int, output: Output, like: Problem | None = None, friction: Sequence[str] = FRICTION
) -> Problem:
    """The chain of so many masses, all of which is free, with the settings of ``like``; its values mean nothing."""
    given = {**dict.fromkeys(names(masses), 1.0), **{name: float(name in friction) for name in FRICTION[:1]}}
    nominal = {**given, **dict.fromkeys(FRICTION[1:], 0.0)}
    drive, free = chain(masses, output), (*names(masses), *friction)
    if like is None:
        return Problem(drive, nominal, free, predictor="output-error", motion="simulated")
    return replace(like, drive=drive, nominal=nominal, free=free, K=None, bounds={}, varying={}, slopes={})


def _check(upto: int, friction: Sequence[str]) -> None:
    if upto < 1:
        raise ValueError(f"chains of up to {upto} masses: need at least one")
    unknown = [name for name in friction if name not in FRICTION]
    if unknown:
        raise ValueError(f"friction {unknown[0]!r}: a chain has {', '.join(FRICTION)}")


def _of(masses: int, found: Estimate, measured: Measured, validation: Sequence[Record]) -> Grown:
    aside = tuple(one.one_step for one in compare(found.problem, validation)) if validation else ()
    chain_found = Slots(found.problem).chain(found.problem.nominal)
    return Grown(masses, found, 0.0, 0.0, 0.0, aside, doubt_of(chain_found, float(measured.frequency_hz[0])))


def _stem(model: Grown) -> Stem:
    """The chain as the records themselves have it; a damper below zero has no logarithm and stays as it is."""
    problem = model.estimate.problem
    response = Response(problem)
    return Stem(response, Found(response.start, np.inf), Slots(problem) if model.masses > 1 else None)


def _fitted(
    problem: Problem,
    records: Sequence[Record],
    stems: Sequence[Stem],
    measured: Measured,
    reached: Callable[[int], None],
) -> Estimate:
    if not stems:
        raise ValueError("the frequency response shows no further resonance")
    origin = "a chain that grew mass by mass"
    found = [candidate(stem.response, stem.end, measured, origin) for stem in stems]
    return best_fit(problem, records, found, reached)
