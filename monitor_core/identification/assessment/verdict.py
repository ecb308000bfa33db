"""The verdict on a fit: how much of the motion or of the torque the drive explains, and which effect is missing in it.

Every drive predicts well one step ahead, so the simulation of records that were not fitted decides.  If there are none,
each half of the records is simulated with values from the other half.  If a weight acts, or Coulomb friction takes most
of the torque, the simulation may run away; then the torque that the measured motion needs is compared instead
(explained_torque.py).  The same is done if slow motion is left out, as a simulation cannot leave it out.
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
    friction_dominates,
    holds_weight,
    offset_exceeds_friction,
    with_torque_of_pose,
)
from monitor_core.identification.greybox import (
    ComparedRecord,
    Estimate,
    explained,
    fit,
    traces_of,
)
from monitor_core.identification.problem import Problem
from monitor_core.identification.record_checks.sample_checks import samples_too_far_apart
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.record_parts import between
from monitor_core.identification.torque_balance.repeated_motion import repeated_after
from monitor_core.identification.torque_balance.rigid_body import rigid_fits
from monitor_core.identification.torque_balance.standstill import slow_motion
from monitor_core.identification.torque_balance.torque_windows import TorqueTerm, moves_one_way
from monitor_core.kernel.tables import COULOMB, OF_ANGLE, ONE

GOOD, FAIR = 80.0, 50.0
"""Per cent of the motion, 100 (1 - |errors| / |speed - mean|), from which on a fit is good, or fair.  Real axes with
the right drive reach 75 to 95 on records that were not fitted, an arm without its gravity 2 to 28."""
GOOD_TORQUE, FAIR_TORQUE = 85.0, 70.0
"""Per cent of the torque under a weight.  A robot's shoulder and elbow with the weight of all links reach 77 to 94,
with that of their own link only 25 to 54: most of the torque is the weight."""
_MAX_ITERATIONS = 30
"""Iterations of the fit to a half, which starts at the estimates."""
_MIN_HALF_SAMPLES = 200
"""Least number of samples in a half."""
_MAX_REMAINING = 0.5
"""An effect is missing in the drive if it reduces the unexplained torque to less than this share."""
_MIN_EFFECT = 0.003
"""Least share of an effect in the torque of slow motions; a smaller one is more likely due to springs."""
_MIN_SLOW_SHARE = 0.5
"""If the motion is slow for this share of the time in motion, its friction outweighs everything else."""
_MIN_RIGID_SHARE = 0.9
"""If this share of the torque of slow motions is explained, the missing effect is a fast one."""


class FitQuality(Enum):
    """Quality of a fit."""

    GOOD = "good"
    FAIR = "fair"
    POOR = "poor"


class VerdictBasis(Enum):
    """Data on which the verdict is based."""

    RECORDS = "records"
    """Validation records."""
    HALVES = "halves"
    """Each half of the records, with values from the other."""
    NONE = "none"
    """The fitted records themselves, as they cannot be divided."""


class Measure(Enum):
    """Quantities that are compared."""

    MOTION = "motion"
    """The speed of a simulation and the measured speed."""
    TORQUE = "torque"
    """The torque that the measured motion needs and the measured torque."""


class Effect(Enum):
    """Effects that may be missing in a drive."""

    POSE = "pose"
    """Torque that depends on the angle: a weight, a balancing spring."""
    COULOMB = "coulomb"
    OFFSET = "offset"
    FRICTION_CURVE = "friction-curve"
    """Friction that is neither proportional to the speed nor Coulomb friction."""
    FAST = "fast"
    """Elasticity, or a delay: only slow motions are explained."""
    SLOW = "slow"
    """Stick-slip friction: most of the motion is slow; faster motion is explained."""
    SAMPLES = "samples"
    """The motion between the samples, which are too far apart."""
    FOREIGN = "foreign"
    """The motion of the axis does not explain the torque: other axes, a load that changes, contact."""


_PARTS = {Effect.POSE, Effect.COULOMB, Effect.OFFSET}
"""Effects that another component in the drive would describe"""


class Verdict(NamedTuple):
    """Explained share of the motion or torque, and the missing effects if that is not enough."""

    own: float
    """Per cent in the fitted records"""
    validation: float
    """Per cent in the data that were not fitted; with Basis.NONE in the fitted records"""
    basis: VerdictBasis
    missing: tuple[Effect, ...]
    measure: Measure = Measure.MOTION
    slow: float = 0.0
    """With Effect.SLOW: speed below which the motion is slow [rad/s]"""
    repeats_s: float | None = None
    """Time after which the motion in all records repeats itself [s]: what was not fitted is the same motion; None: it
    does not repeat"""
    halves: tuple[Estimate, ...] = ()
    """The estimates from each half alone; empty: there are validation records, or the halves cannot be fitted"""

    @property
    def per_cent(self) -> float:
        """The figure that decides."""
        return min(self.own, self.validation)

    @property
    def quality(self) -> FitQuality:
        """Quality by the worse of both figures; poor if the records show a part that is missing in the drive."""
        good, fair = (GOOD, FAIR) if self.measure is Measure.MOTION else (GOOD_TORQUE, FAIR_TORQUE)
        if self.per_cent >= good:
            return FitQuality.GOOD
        return FitQuality.FAIR if self.per_cent >= fair and not _PARTS & set(self.missing) else FitQuality.POOR


_Tried = tuple[Problem, Sequence[Record]]
"""Values, and records that they were not fitted to."""


def verdict_of(
    estimate: Estimate,
    records: Sequence[Record],
    validation: Sequence[Record],
    traces: Sequence[ComparedRecord],
    validated: Sequence[ComparedRecord],
) -> Verdict:
    """The verdict on estimates from these records, with their ``traces``, and those of ``validation`` in ``validated``.

    If there are no validation records, the fitted ones are divided.
    """
    own: list[_Tried] = [(estimate.problem, records)]
    basis, others, halves = VerdictBasis.RECORDS, [(estimate.problem, validation)], tuple[Estimate, ...]()
    if not validation:
        halves, others = _cross_validated(estimate, records)
        basis = VerdictBasis.HALVES if others else VerdictBasis.NONE
        validated = [trace for problem, half in others for trace in traces_of(problem, half)] or traces
    repeats_s = repeated_after([*records, *validation])
    found = Verdict(explained(traces), explained(validated), basis, (), repeats_s=repeats_s, halves=halves)
    ill_posed = found.quality is FitQuality.POOR and friction_dominates(estimate.problem, records)
    leaves_out = estimate.problem.min_speed > 0
    if ill_posed or (found.quality is not FitQuality.GOOD and (leaves_out or _weight_acts(estimate.problem, records))):
        fitted, other = (explained_torque(tried) for tried in (own, others or own))
        if min(fitted, other) > found.per_cent:
            found = found._replace(own=fitted, validation=other, measure=Measure.TORQUE)
    if found.quality is FitQuality.GOOD:
        return found
    if any(samples_too_far_apart(record) for record in records):
        return found._replace(missing=(Effect.SAMPLES,))
    missing = missing_effects(estimate.problem, records)
    slow, share = slow_motion(records)
    sticks = share > _MIN_SLOW_SHARE and not leaves_out
    if sticks and {Effect.FAST, Effect.FRICTION_CURVE} & set(missing) and not _PARTS & set(missing):
        return found._replace(missing=(Effect.SLOW,), slow=slow)
    if found.measure is Measure.TORQUE:  # which shows slow motions only
        missing = tuple(effect for effect in missing if effect is not Effect.FAST)
    return found._replace(missing=missing)


def _weight_acts(problem: Problem, records: Sequence[Record]) -> bool:
    """Whether the drive has a weight that acts; a weight that is the same in all poses is just a constant torque."""
    if holds_weight(problem):
        return True
    return offset_exceeds_friction(problem) and not _PARTS & set(missing_effects(problem, records))


def _cross_validated(estimate: Estimate, records: Sequence[Record]) -> tuple[tuple[Estimate, ...], list[_Tried]]:
    """Each half with the values from the other, and these fits; empty if a half is too short or cannot be fitted.

    Several records are divided into the first and the last ones.  If such a half does not determine all parameters that
    the records determine together (as one without the planned motion), each record is divided instead.
    """
    found, used = list[_Tried](), tuple[Estimate, ...]()
    for halves in _divisions(records):
        if any(sum(map(len, half)) < _MIN_HALF_SAMPLES for half in halves):
            continue
        try:
            fits = [fit(estimate.problem, half, most_iterations=_MAX_ITERATIONS) for half in halves]
        except (ValueError, np.linalg.LinAlgError):
            continue
        if not found or _determined(estimate, fits):
            used, found = tuple(fits), [(f.problem, other) for f, other in zip(fits, halves[::-1], strict=True)]
        if _determined(estimate, fits):
            break
    return used, found


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


# --- Missing effects --------------------------------------------------------------------------------------------------


_TERMS: Mapping[Effect, tuple[TorqueTerm, ...]] = MappingProxyType(
    {
        Effect.POSE: ("angle", "angle^2", "angle^3"),
        Effect.COULOMB: ("coulomb",),
        Effect.OFFSET: ("offset",),
        Effect.FRICTION_CURVE: ("stribeck", "drag"),
    }
)


def missing_effects(problem: Problem, records: Sequence[Record]) -> tuple[Effect, ...]:
    """Effects that the torque of slow motions shows and the drive does not have, the likeliest first."""
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
    named = tuple(effect for effect in sorted(gains, key=gains.__getitem__) if gains[effect] < _MAX_REMAINING)
    if named:
        small = left * (1 - min(gains.values())) < _MIN_EFFECT and own.explained > _MIN_RIGID_SHARE
        return (Effect.FAST, *named) if small else named
    if own.explained > _MIN_RIGID_SHARE:
        return (Effect.FAST,)
    elastic = any(p.unit == STIFFNESS for p in problem.drive.parameters)  # which takes torque by itself
    return () if elastic else (Effect.FOREIGN,)


def _present(drive: Drive) -> tuple[Effect, ...]:
    kinds = {
        Effect.POSE: set(OF_ANGLE),
        Effect.COULOMB: {COULOMB},
        Effect.OFFSET: {ONE},
    }
    return tuple(effect for effect, those in kinds.items() if those & set(drive.inputs))
