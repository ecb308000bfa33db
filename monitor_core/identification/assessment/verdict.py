"""The verdict on a fit: how much of the motion or of the torque the drive explains, and which effect it lacks.

One step ahead every drive predicts well.  What decides is the simulation of records that were not fitted; where there
are none, each half of the records is simulated with values from the other half.  Where a weight acts, or Coulomb
friction takes most of the torque, the simulation may run away, and the torque of the measured motion is compared
instead (explained_torque.py); so it is where slow motion is left out, which a simulation has to go through.
"""

from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.drive.structure import STIFFNESS, Drive
from monitor_core.identification.assessment.explained_torque import (
    explained_torque,
    follows_pose,
    holds_weight,
    lifts,
    rubs,
    with_torque_of_pose,
)
from monitor_core.identification.greybox import (
    Estimate,
    Trace,
    explained,
    fit,
    traces_of,
)
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record, between
from monitor_core.identification.torque_balance.rigid_body import rigid_fits
from monitor_core.identification.torque_balance.standstill import slow_motion
from monitor_core.identification.torque_balance.torque_windows import TorqueTerm, moves_one_way
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE

GOOD, FAIR = 80.0, 50.0
"""Per cent of the motion, 100 (1 - |errors| / |speed - mean|), from which on a fit is good, or fair.  Real axes with
the right drive reach 75 to 95 on records that were not fitted, an arm without its gravity 2 to 28."""
GOOD_TORQUE, FAIR_TORQUE = 85.0, 70.0
"""Per cent of the torque under a weight.  A robot's shoulder and elbow with the weight of all links reach 77 to 94,
with that of their own link only 25 to 54: most of the torque is the weight."""
_ITERATIONS = 30
"""Of the fit to a half, which starts at the estimates."""
_FEWEST = 200
"""Samples of a half."""
_LESS = 0.5
"""A further effect leaves less than this part of the torque that was not explained: it is missing in the drive."""
_MATTERS = 0.003
"""Part of the torque of slow motions that an effect takes; with less of it springs come first, which look like it."""
_MOSTLY = 0.5
"""Of the time in motion: if so much of it is slow, its friction outweighs all else."""
_RIGID = 0.9
"""Part of the torque of slow motions; if so much is explained, what is missing is faster."""


class Quality(Enum):
    """Of a fit."""

    GOOD = "good"
    FAIR = "fair"
    POOR = "poor"


class Basis(Enum):
    """What the verdict is based on."""

    RECORDS = "records"
    """Records that were kept aside."""
    HALVES = "halves"
    """Each half of the records, with values from the other."""
    NONE = "none"
    """The fitted records themselves: they cannot be divided."""


class Measure(Enum):
    """What is compared."""

    MOTION = "motion"
    """The speed of a simulation with the measured speed."""
    TORQUE = "torque"
    """The torque that the measured motion takes with the measured torque."""


class Effect(Enum):
    """What a drive may lack."""

    POSE = "pose"
    """Torque that depends on the angle: a weight, a balancing spring."""
    COULOMB = "coulomb"
    OFFSET = "offset"
    FRICTION_CURVE = "friction-curve"
    """Friction that is not proportional to the speed, beside Coulomb's."""
    FAST = "fast"
    """Slow motions are explained: elasticity, or a delay."""
    SLOW = "slow"
    """Mostly the motion is slow, with a friction that sticks and slips; faster motion is explained."""
    FOREIGN = "foreign"
    """Nothing of its own motion explains the torque: other axes, a load that changes, contact."""


_PARTS = {Effect.POSE, Effect.COULOMB, Effect.OFFSET}
"""Effects that a further component of the drive describes."""


class Verdict(NamedTuple):
    """How much of the motion or torque is explained, and what is missing where that is not enough."""

    own: float
    """per cent of the fitted records"""
    validation: float
    """per cent of what was not fitted; with Basis.NONE of the fitted records"""
    basis: Basis
    missing: tuple[Effect, ...]
    measure: Measure = Measure.MOTION
    slow: float = 0.0
    """With Effect.SLOW the speed below which it is [rad/s]"""

    @property
    def per_cent(self) -> float:
        """The figure that decides."""
        return min(self.own, self.validation)

    @property
    def quality(self) -> Quality:
        """By the worse of the two; poor where the drive lacks a part that the records show."""
        good, fair = (GOOD, FAIR) if self.measure is Measure.MOTION else (GOOD_TORQUE, FAIR_TORQUE)
        if self.per_cent >= good:
            return Quality.GOOD
        return Quality.FAIR if self.per_cent >= fair and not _PARTS & set(self.missing) else Quality.POOR


class _Tried(NamedTuple):
    """Values, and records that they were not fitted to."""

    problem: Problem
    records: Sequence[Record]


def verdict_of(
    estimate: Estimate,
    records: Sequence[Record],
    validation: Sequence[Record],
    traces: Sequence[Trace],
    validated: Sequence[Trace],
) -> Verdict:
    """The verdict on estimates from these records.

    Args:
        estimate: of the drive.
        records: that were fitted.
        validation: records that were kept aside; none: the fitted ones are divided.
        traces: of the fitted records with the estimates.
        validated: of those that were kept aside.
    """
    own = [_Tried(estimate.problem, records)]
    basis, others = Basis.RECORDS, [_Tried(estimate.problem, validation)]
    if not validation:
        others = _crosswise(estimate, records)
        basis = Basis.HALVES if others else Basis.NONE
        validated = [trace for problem, half in others for trace in traces_of(problem, half)] or traces
    found = Verdict(explained(traces), explained(validated), basis, ())
    ill_posed = found.quality is Quality.POOR and rubs(estimate.problem, records)
    leaves_out = estimate.problem.min_speed > 0
    if ill_posed or (found.quality is not Quality.GOOD and (leaves_out or _bears(estimate.problem, records))):
        fitted, other = (explained_torque(tried) for tried in (own, others or own))
        if min(fitted, other) > found.per_cent:
            found = Verdict(fitted, other, basis, (), Measure.TORQUE)
    if found.quality is Quality.GOOD:
        return found
    missing = missing_effects(estimate.problem, records)
    slow, share = slow_motion(records)
    sticks = share > _MOSTLY and not leaves_out
    if sticks and {Effect.FAST, Effect.FRICTION_CURVE} & set(missing) and not _PARTS & set(missing):
        return found._replace(missing=(Effect.SLOW,), slow=slow)
    if found.measure is Measure.TORQUE:  # which shows slow motions only
        missing = tuple(effect for effect in missing if effect is not Effect.FAST)
    return found._replace(missing=missing)


def _bears(problem: Problem, records: Sequence[Record]) -> bool:
    """Whether a weight acts that the drive has: one that is the same everywhere is a constant torque."""
    if holds_weight(problem):
        return True
    return lifts(problem) and not _PARTS & set(missing_effects(problem, records))


def _crosswise(estimate: Estimate, records: Sequence[Record]) -> list[_Tried]:
    """Each half with the values of the other one; none where a half is too short or cannot be fitted.

    Several records are divided into the first and the last ones, unless that leaves a half which does not determine all
    that they determine together, as one without the planned motion: then each record is divided.
    """
    found = list[_Tried]()
    for halves in _divisions(records):
        if any(sum(map(len, half)) < _FEWEST for half in halves):
            continue
        try:
            fits = [fit(estimate.problem, half, most_iterations=_ITERATIONS) for half in halves]
        except (ValueError, np.linalg.LinAlgError):
            continue
        if not found or _determined(estimate, fits):
            found = [_Tried(f.problem, other) for f, other in zip(fits, halves[::-1], strict=True)]
        if _determined(estimate, fits):
            break
    return found


def _determined(estimate: Estimate, fits: Sequence[Estimate]) -> bool:
    """Whether each of these fits determines what the records determine together."""
    size = abs(estimate.theta)
    known = estimate.sd < size
    return all(bool((f.sd < size)[known].all()) for f in fits)


Halves = tuple[Sequence[Record], Sequence[Record]]


def _divisions(records: Sequence[Record]) -> Iterator[Halves]:
    """The first and the last of several records; the first and the second half of each."""
    if len(records) > 1:
        middle = (len(records) + 1) // 2
        yield records[:middle], records[middle:]
    try:
        first = [between(record, 0.0, record.duration_s / 2) for record in records]
        second = [between(record, record.duration_s / 2, record.duration_s) for record in records]
    except ValueError:
        return
    yield first, second


# --- What is missing --------------------------------------------------------------------------------------------------


_TERMS: Mapping[Effect, tuple[TorqueTerm, ...]] = MappingProxyType(
    {
        Effect.POSE: ("angle", "angle^2", "angle^3"),
        Effect.COULOMB: ("coulomb",),
        Effect.OFFSET: ("offset",),
        Effect.FRICTION_CURVE: ("stribeck", "drag"),
    }
)


def missing_effects(problem: Problem, records: Sequence[Record]) -> tuple[Effect, ...]:
    """What the torque of slow motions shows and the drive does not have, what is likeliest first."""
    present = _present(problem.drive)
    base: tuple[TorqueTerm, ...] = ("viscous", *(term for effect in present for term in _TERMS[effect]))
    if follows_pose(problem):
        base, records = (*base, "signal"), with_torque_of_pose(problem, records)
    lacking = [effect for effect in _TERMS if effect not in present]
    if moves_one_way(records):
        lacking = [effect for effect in lacking if effect not in (Effect.POSE, Effect.OFFSET)]
    more = [(*base, *_TERMS[effect]) for effect in lacking]
    everything = (*base, *(term for effect in lacking for term in _TERMS[effect]))
    full, own, *others = rigid_fits(
        records, [everything, base, *more], problem.speed_scale, moving=True, min_speed=problem.min_speed
    )
    if full is None or own is None:
        return ()
    left = 1 - own.explained
    gains = {
        effect: (1 - other.explained) / left
        for effect, other in zip(lacking, others, strict=True)
        if other is not None and left > 0
    }
    named = tuple(effect for effect in sorted(gains, key=gains.__getitem__) if gains[effect] < _LESS)
    if named:
        small = left * (1 - min(gains.values())) < _MATTERS and own.explained > _RIGID
        return (Effect.FAST, *named) if small else named
    if own.explained > _RIGID:
        return (Effect.FAST,)
    elastic = any(p.unit == STIFFNESS for p in problem.drive.parameters)  # which takes torque by itself
    return () if elastic else (Effect.FOREIGN,)


def _present(drive: Drive) -> tuple[Effect, ...]:
    kinds = {
        Effect.POSE: {COSINE, SINE},
        Effect.COULOMB: {COULOMB},
        Effect.OFFSET: {ONE},
    }
    return tuple(effect for effect, those in kinds.items() if those & set(drive.inputs))
