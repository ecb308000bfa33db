"""Number of masses of a drive: chains grow as long as the records support one more mass (growing_chains.py).

The estimates of every model start the next one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.identification.greybox import Estimate, traces_of
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.starting.chains import (
    FRICTION,
    Chain,
    ChainParameters,
    modes_of_chain,
    problem_of,
)
from monitor_core.identification.starting.growing_chains import FittedChain, grown_chains, longer
from monitor_core.identification.starting.response import Measured, Response, measure
from monitor_core.identification.starting.search import SearchEnd, SearchProgress, StepCounter
from monitor_core.identification.starting.starting_fits import FITTING, best_fit, from_chains


def grow(
    records: Sequence[Record],
    upto: int = 5,
    *,
    like: Problem | None = None,
    friction: Sequence[str] = FRICTION,
    validation: Sequence[Record] = (),
    progress: SearchProgress | None = None,
) -> Growth:
    """Fit chains of one mass, two, and so on, until one more is not supported.

    Args:
        records: to fit.
        upto: largest number of masses.
        like: a problem whose predictor, disturbance, loss, delay, speed scale and so on are used; its drive, values,
            free parameters and bounds are not.  None: output error, friction from the simulated speed.
        friction: which of fm, fc and tau0 are free; the others are zero.
        validation: records kept aside.
        progress: called with the steps done and their maximum.

    Raises:
        ValueError: the records yield no frequency response, ``upto`` is below 1; errors of ``fit``.
    """
    if upto < 1:
        raise ValueError(f"chains of up to {upto} masses: need at least one")
    measured, steps = measure(records), StepCounter(progress, upto * FITTING)
    grown = grown_chains(problem_of(1, measured.output, friction=("fm",)), measured)
    models, failed = list[ChainModel](), ""
    for masses in range(1, upto + 1):
        problem = problem_of(masses, measured.output, like, friction)
        if models:
            # The chain as the records themselves have it; a damper below zero has no logarithm and stays as it is.
            before = models[-1].estimate.problem
            response = Response(before)
            fitted = FittedChain(response, SearchEnd(response.start, np.inf), ChainParameters(before))
            grown = longer(problem, (fitted, *grown), measured)
        try:
            if not grown:
                raise ValueError("the frequency response shows no further resonance")
            reached = steps.part((masses - 1) * FITTING, FITTING)
            found = best_fit(problem, records, from_chains(grown, measured), reached)
        except ValueError as error:
            if not models:
                raise
            failed = str(error)
            break
        if models and not found.cost < models[-1].estimate.cost:
            # With a stiff spring it is the shorter chain: larger errors only show that the search failed.
            failed = "its search ended at larger errors than that with one mass fewer, so it missed the best fit"
            break
        models = judged([*models, _of(masses, found, measured, validation)], records)
        if len(models) > 1 and not is_supported(*models[-2:]):
            break
    steps.reached(upto * FITTING)
    return verdict(models, failed)


def _of(masses: int, found: Estimate, measured: Measured, validation: Sequence[Record]) -> ChainModel:
    aside = tuple(trace.fit for trace in traces_of(found.problem, validation)) if validation else ()
    chain_found = ChainParameters(found.problem).chain(found.problem.nominal)
    return ChainModel(masses, found, 0.0, 0.0, 0.0, aside, doubt_of(chain_found, float(measured.frequency_hz[0])))


# --- Chains of different length compared ------------------------------------------------------------------------------


# What decides is Schwarz' criterion,
# BIC = N ln(V / samples) + p ln N + 2 s,        N = samples / (1 + 2 sum_l r_l^2),
# with the autocorrelation r of the errors, since samples whose errors are correlated tell no more than these fewer
# (Bartlett).  The s initial states count as in Akaike's: a longer record tells no more of them.  On records that are
# kept aside the longer chain must predict better, too.

_LIGHTEST = 1e-3
"""A mass below this share of the total inertia is not real: it only absorbs errors of friction and disturbances."""
_WHITE = 0.01
"""A p-value below which errors are not white."""
_PLAIN = 0.25
"""If the larger chain leaves less than this share of the squared error, its additional mass counts even if doubtful."""


@dataclass(frozen=True, eq=False)
class ChainModel:
    """A chain of some masses, fitted."""

    masses: int
    estimate: Estimate  # all values as the motor sees them, J1, k1, .. outwards
    samples: float  # N of the criteria
    aic: float  # Akaike's criterion
    bic: float  # Schwarz' criterion
    validation: tuple[float, ...]  # NRMSE in per cent of each record kept aside, one step ahead
    doubt: str  # why one of the masses is not real, in words; empty: there is no doubt


@dataclass(frozen=True, eq=False)
class Growth:
    """Chains of one, two, .. masses."""

    models: tuple[ChainModel, ...]  # the last one may be unsupported
    recommended: int  # the number of masses that the records support
    words: tuple[str, ...]  # why, in sentences


def judged(models: Sequence[ChainModel], records: Sequence[Record]) -> list[ChainModel]:
    """The models with their criteria, all for the same N: that of the model whose errors are whitest."""
    count = sum(int(record.measured.sum()) for record in records)
    N = max(count / (1 + 2 * float(np.sum(model.estimate.whiteness.values**2))) for model in models)
    out = []
    for model in models:
        initial = model.estimate.problem.initial == "free"
        states = initial * len(model.estimate.drive.states) * len(records)
        fit, p = float(N * np.log(model.estimate.cost / count)) + 2 * states, len(model.estimate.names)
        out.append(replace(model, samples=N, aic=fit + 2 * p, bic=fit + p * float(np.log(N))))
    return out


def doubt_of(chain: Chain, lowest_hz: float) -> str:
    """Why a chain (seen from the motor), known above some frequency, has a mass that is not real."""
    lightest = float(chain.J.min() / chain.J.sum())
    if lightest < _LIGHTEST:
        return f"one of them is only {lightest:.1g} of the whole inertia, too little for a part of a drive"
    slowest = float(modes_of_chain(chain)[0][1:].min(initial=np.inf)) / (2 * np.pi)
    if slowest < lowest_hz:
        return f"its resonance at {slowest:.2g} Hz is below {lowest_hz:.2g} Hz, the lowest that the records show"
    return ""


def is_supported(smaller: ChainModel, larger: ChainModel) -> bool:
    """Whether the records support the larger one; a doubtful mass weighs little where most of the error vanishes."""
    odd = larger.doubt and larger.estimate.cost > _PLAIN * smaller.estimate.cost
    if odd or not larger.bic < smaller.bic:
        return False
    return not larger.validation or sum(larger.validation) > sum(smaller.validation)


def verdict(models: Sequence[ChainModel], failed: str) -> Growth:
    """The recommendation from models of one mass, two, ..; ``failed``: why the next could not be fitted, if so."""
    enough = len(models) > 1 and not is_supported(*models[-2:])
    recommended = len(models) - enough
    if enough:
        why = _why_unsupported(*models[-2:])
    elif failed:
        why = f"No chain of {recommended + 1} masses could be fitted: {failed}."
    else:
        why = "That is the most that was tried; with fewer the records are explained less well."
    words = (
        f"{_masses(recommended).capitalize()} suffice{'s' if recommended == 1 else ''}. {why}",
        _white(models[recommended - 1]),
    )
    return Growth(tuple(models), recommended, words)


def _why_unsupported(smaller: ChainModel, larger: ChainModel) -> str:
    gain = 100 * (1 - larger.estimate.cost / smaller.estimate.cost)
    more = f"With {_masses(larger.masses)} the squared errors are {gain:.2g} % less"
    if larger.bic < smaller.bic and larger.doubt:
        return f"{more}, but {larger.doubt}."
    if larger.bic < smaller.bic:
        a, b = (float(np.mean(model.validation)) for model in (smaller, larger))
        return f"{more}, but the records kept aside are predicted with {b:.4g} % instead of {a:.4g} %."
    return (
        f"{more}: no more than chance alone gives with the further parameters (BIC rises by"
        f" {larger.bic - smaller.bic:.3g})."
    )


def _white(model: ChainModel) -> str:
    p = model.estimate.whiteness.p_value
    if p >= _WHITE:
        return f"Its errors are white (p = {p:.2g}): the model explains all that is not noise in the record."
    return (
        f"Its errors are not white (p = {p:.2g}): they contain an effect that no further mass explains, as friction"
        " that depends on the direction, backlash, or a disturbance."
    )


def _masses(count: int) -> str:
    return "one mass" if count == 1 else f"{count} masses"
