"""All checks of a record, and the comparison of torque and motion: signs and units."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.record_checks.findings import RecordFinding
from monitor_core.identification.record_checks.known_axis import KnownAxis
from monitor_core.identification.record_checks.sample_checks import implausible_values, times
from monitor_core.identification.record_checks.stuck_signals import signals
from monitor_core.identification.record_checks.unsigned_torque import unsigned
from monitor_core.identification.record_checks.value_patterns import stands
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import Rigid, rigid_fit, rigid_fits, speed_scales
from monitor_core.identification.torque_balance.torque_windows import POSE, USUAL

_BACK = 3.0
"""The sign is wrong if the work of the torque falls by this multiple of its largest rise.  In a driven axis the work
can fall only by the energy stored before; with the wrong sign it can rise only by that energy."""
_EXPLAINS = 0.5
"""Least share of the torque's variance that one rigid mass must explain before its inertia is compared."""
_EXCHANGED_EXPLAINS, _LESS_LEFT, _SURER = 0.6, 4.0, 8.0
"""Torque and angle are exchanged if one mass explains at least this share of the torque when they change places, leaves
less unexplained by this factor, and its inertia is known better by this factor.  Of the measured angles of nine axes,
each gives the inertia at least twice as surely as it would as a torque; of most, over eight times."""
_SLOW = 3.0
"""Length of a window in periods of the antiresonance, which suppresses faster motions, as these show less inertia."""
_SURE = 4.0
"""Least number of standard deviations of an inertia that is compared."""
_AS_NOMINAL = 5.0
"""An inertia that differs from the nominal one by more than this factor is a mistake; a guess may be off by 3."""
_NEAR = 3.0
"""Largest factor between an inertia and that of a suspected mistake: the error of a guess."""
_NOTHING_KNOWN = KnownAxis()
_WEIGHT = 0.5
"""A weight acts if terms of the pose reduce the torque that one mass leaves unexplained to less than this share."""


class UnitMistake(NamedTuple):
    """A mistake of units: factor by which the inertia comes out too large, and the correction."""

    factor: float
    description: str


_UNIT_MISTAKES = (
    UnitMistake(1000.0, "a torque in N mm or mN m"),
    UnitMistake(1 / 1000, "a motion in mrad, or a torque in kN m"),
    UnitMistake(1 / 57.3, "a motion in degrees"),
    UnitMistake(57.3, "a motion converted from degrees to radians twice"),
    UnitMistake(1 / 9.55, "a speed in revolutions per minute"),
    UnitMistake(6.28, "an angle in revolutions"),
)


def check_record(record: Record, known: KnownAxis = _NOTHING_KNOWN) -> tuple[RecordFinding, ...]:
    """Findings about a record; those that refuse it come first.

    Torque and motion are compared only where each of them is sound by itself.
    """
    found = [*implausible_values(record), *times(record, known), *signals(record)]
    if not _refused(found):
        found += _still(record)
    if not _refused(found):
        if np.count_nonzero(record.measured) > 1:
            found += (
                list(_exchanged(record))
                or list(unsigned(record))
                or list(_wrong_sign(record, known))
                or _units(record, known)
            )
        else:
            found += _units(record, known)
    return tuple(sorted(found, key=lambda finding: finding.severity != "refuse"))


def _refused(found: Sequence[RecordFinding]) -> bool:
    return any(finding.severity == "refuse" for finding in found)


def _still(record: Record) -> Iterator[RecordFinding]:
    if stands(record):
        noise = float(np.nanstd(record.y))
        yield RecordFinding(
            "still",
            "refuse",
            f"the {record.quantity} shows nothing but noise of {noise:.1g} {record.unit}: the axis does not move;"
            " record its motion, or leave this axis out",
            noise,
        )


def exchanged_share(record: Record) -> float | None:
    """Share of the torque that one mass explains if torque and angle change places; None: they need not.

    A speed explains its torque about as well either way, so there is no answer for a speed.
    """
    if record.quantity == "speed":
        return None
    y, u = np.interp(record.t, record.t[record.measured], record.y[record.measured]), record.u
    if np.ptp(y) == 0 or np.ptp(u) == 0:
        return None
    other = Record(record.t, y, u, record.quantity, record.name)
    own, found = (rigid_fit(each, speed_scales([each])[1]) for each in (record, other))
    if found is None or found.explained < _EXCHANGED_EXPLAINS or found.inertia_sigmas < _SURE:
        return None
    surer = own is None or found.inertia_sigmas > _SURER * own.inertia_sigmas
    less_left = own is None or _LESS_LEFT * (1 - found.explained) < 1 - own.explained
    return found.explained if surer and less_left else None


def _exchanged(record: Record) -> Iterator[RecordFinding]:
    share = exchanged_share(record)
    if share is not None:
        yield RecordFinding(
            "exchanged",
            "refuse",
            f"torque and angle are exchanged, in the configuration or in the record: if they change places, one mass "
            f"explains {100 * share:.0f} % of the torque, and its inertia is found far more surely",
            share,
        )


def _work(record: Record) -> Floats:
    """Work of the torque on the axis up to each sample (N,), J.

    With the angle it is exact, since the torque is held.  Of the speed the one at the end of the interval is taken:
    its noise cannot yet have acted on the torque through a controller.
    """
    y = np.interp(record.t, record.t[record.measured], record.y[record.measured])
    turned = np.diff(y) if record.quantity == "angle" else y[1:] * record.intervals
    return np.concatenate(([0.0], np.cumsum(record.u[:-1] * turned)))


def shown_inertia(record: Record, known: KnownAxis = _NOTHING_KNOWN) -> Rigid | None:
    """The record explained by one mass, with a weight if there is one; None: this does not explain its torque."""
    shortest_s = _SLOW * (known.antiresonance_s or 0.0)
    # With a speed scale of another order than the speed, friction would be viscous only: an angle of the arm is slow.
    scales = speed_scales([record])
    scale = known.speed_scale if scales[0] <= known.speed_scale <= scales[-1] else scales[1]
    weighed, mass = rigid_fits([record], [POSE, USUAL], scale, shortest_s, moving=True)
    if mass is None:
        return None
    if weighed is not None and 1 - weighed.explained < _WEIGHT * (1 - mass.explained):
        mass = weighed
    return mass if abs(mass.inertia) > _SURE * mass.sd and mass.explained > _EXPLAINS else None


def has_wrong_sign(record: Record) -> bool:
    """Whether torque or motion has the wrong sign, for any units.

    If the signs of inertia and friction of one mass agree, they decide; otherwise the work of the torque does, if it is
    clear, as a weight gives back its energy.  Where one mass explains nothing and the work is about as often taken as
    given, as on an axis of an arm that the other axes push, nothing speaks against the sign.
    """
    mass = shown_inertia(record)
    if mass is not None and mass.inertia * mass.torques["coulomb"] > 0:
        return mass.inertia < 0
    falls, rises = _given_and_taken(record)
    if max(falls, rises) > _BACK * min(falls, rises):
        return falls > rises
    return mass is not None and mass.inertia < 0


def _given_and_taken(record: Record) -> tuple[float, float]:
    """Largest fall and largest rise of the work of the torque, J."""
    done = _work(record)
    falls, rises = np.maximum.accumulate(done) - done, done - np.minimum.accumulate(done)
    return float(falls.max()), float(rises.max())


def _wrong_sign(record: Record, known: KnownAxis) -> Iterator[RecordFinding]:
    falls, rises = _given_and_taken(record)
    mass = shown_inertia(record, replace(known, antiresonance_s=None))
    negative = mass is not None and mass.inertia < 0
    # A weight gives back its energy, but it cannot make both inertia and friction negative.
    pushes = negative and mass is not None and mass.torques["coulomb"] < 0 and rises <= _BACK * falls
    if falls <= _BACK * rises and not pushes:
        return
    shown = f", and as one mass it has an inertia of {mass.inertia:.3g} kg m^2" if mass and negative else ""
    yield RecordFinding(
        "wrong-sign",
        "refuse" if negative else "warn",
        f"the motor takes {falls:.3g} J of work from the axis and gives {rises:.3g} J to it{shown}: torque or motion "
        "has the wrong sign",
        mass.inertia if mass and negative else -falls,
    )


def _units(record: Record, known: KnownAxis) -> Iterator[RecordFinding]:
    nominal = known.inertia
    mass = None if nominal is None else shown_inertia(record, known)
    if nominal is None or mass is None or mass.inertia < 0:
        return
    factor = mass.inertia / nominal
    if is_about_nominal(factor):
        return
    mistake = min(_UNIT_MISTAKES, key=lambda m: abs(math.log(factor / m.factor)))
    reason = "are units and gear ratio right?"
    if 1 / _NEAR < factor / mistake.factor < _NEAR:
        reason = f"{mistake.description} would give a factor of {mistake.factor:.3g}"
    yield RecordFinding(
        "units",
        "warn",
        f"as one mass the drive shows an inertia of {mass.inertia:.3g} kg m^2, {factor:.3g} times the nominal "
        f"{nominal:.3g}: {reason}",
        factor,
    )


def is_about_nominal(factor: float) -> bool:
    """Whether an inertia that is ``factor`` times the nominal one is plausible, the nominal one being a rough guess."""
    return 1 / _AS_NOMINAL < factor < _AS_NOMINAL
