"""Whether torque and motion go together: signs, and units by the inertia that they show."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.record import Record
from monitor_core.identification.record_checks.finding import Finding, Known
from monitor_core.identification.rigid_body import rigid_fit

_BACK = 3.0
"""The work of the torque falls by so many times what it ever rises.  Of a drive that is only driven by it the work
cannot fall by more than the energy stored before; with the sign reversed it cannot rise by more."""
_EXPLAINS = 0.5
"""Part of the torque's variance that one rigid mass explains; below that its inertia is not to be compared."""
_SLOW = 3.0
"""Periods of the antiresonance in a window: motions as fast as that do not get through, which would show less."""
_SURE = 4.0
"""Standard deviations."""
_AS_NOMINAL = 5.0
"""An inertia that far from the nominal one is no wrong guess any more: a guess is wrong by 3."""
_NEAR = 3.0
"""To a suspected factor: as far as a guess may be wrong."""
_SAME = 0.2
"""Speeds that differ less from those of the angle are a matter of filters."""


class Slip(NamedTuple):
    """By how much the inertia comes out too large, and by what mistake."""

    factor: float
    mistake: str


_SLIPS = (
    Slip(1000.0, "a torque in N mm or mN m"),
    Slip(1 / 1000, "a motion in mrad, or a torque in kN m"),
    Slip(1 / 57.3, "a motion in degrees"),
    Slip(57.3, "a motion divided by 57.3 twice"),
    Slip(1 / 9.55, "a speed in revolutions per minute"),
    Slip(6.28, "an angle in revolutions"),
)


def motion(record: Record, known: Known) -> Iterator[Finding]:
    """Wrong sign of the torque, wrong units, a speed that is not that of the angle."""
    sign = list(_wrong_sign(record, known)) if np.count_nonzero(record.measured) > 1 else []
    yield from sign
    if not sign:
        yield from _units(record, known)
    if record.quantity == "angle" and known.speed is not None and known.speed in record.signals:
        yield from _inconsistent(record, known.speed)


def work(record: Record) -> Floats:
    """What the torque has done to the axis by each sample (N,), J.

    With the angle it is exact, since the torque is held.  Of the speed the one at the end of the interval is taken:
    its noise cannot yet have acted on the torque through a controller.
    """
    y = np.interp(record.t, record.t[record.measured], record.y[record.measured])
    turned = np.diff(y) if record.quantity == "angle" else y[1:] * record.intervals
    return np.concatenate(([0.0], np.cumsum(record.u[:-1] * turned)))


def _wrong_sign(record: Record, known: Known) -> Iterator[Finding]:
    done = work(record)
    falls = float((np.maximum.accumulate(done) - done).max())
    rises = float((done - np.minimum.accumulate(done)).max())
    if falls <= _BACK * rises:
        return
    rigid = rigid_fit(record, known.speed_scale)
    negative = rigid is not None and rigid.inertia < -_SURE * rigid.sd and rigid.explained > _EXPLAINS
    shown = f", and as one mass it has an inertia of {rigid.inertia:.3g} kg m^2" if rigid and negative else ""
    yield Finding(
        "wrong-sign",
        "refuse" if negative else "warn",
        f"the axis gives the motor {falls:.3g} J of work and takes {rises:.3g} J from it{shown}: torque or motion has "
        "the wrong sign",
        rigid.inertia if rigid and negative else -falls,
    )


def _units(record: Record, known: Known) -> Iterator[Finding]:
    nominal = known.inertia
    if nominal is None:
        return
    rigid = rigid_fit(record, known.speed_scale, _SLOW * (known.antiresonance_s or 0.0))
    if rigid is None or rigid.inertia < _SURE * rigid.sd or rigid.explained < _EXPLAINS:
        return
    factor = rigid.inertia / nominal
    if 1 / _AS_NOMINAL < factor < _AS_NOMINAL:
        return
    slip = min(_SLIPS, key=lambda s: abs(np.log(factor / s.factor)))
    near = 1 / _NEAR < factor / slip.factor < _NEAR
    reason = (
        f"{slip.mistake} would make it {slip.factor:.3g} times" if near else "are units and gear ratio right?"
    )
    yield Finding(
        "units",
        "warn",
        f"as one mass the drive shows an inertia of {rigid.inertia:.3g} kg m^2, {factor:.3g} times the nominal "
        f"{nominal:.3g}: {reason}",
        factor,
    )


def _inconsistent(record: Record, name: str) -> Iterator[Finding]:
    found = mean_speed(record)
    speed = np.interp(found.t_mid, record.t, record.signals[name])
    fine = np.isfinite(speed)
    a, b = found.speed[fine] - found.speed[fine].mean(), speed[fine] - speed[fine].mean()
    if not (a @ a > 0 and b @ b > 0):
        return
    alike = float(a @ b / np.sqrt((a @ a) * (b @ b)))
    factor = float(np.sqrt((b @ b) / (a @ a)) * np.sign(alike))
    if abs(alike) > 1 - _SAME and abs(factor - 1) < _SAME:
        return
    yield Finding(
        "inconsistent",
        "warn",
        f"the signal {name} is {factor:.3g} times the speed by which the angle changes (correlation {alike:.2f})"
        f"{_guess(factor)}",
        factor,
    )


def _guess(factor: float) -> str:
    if factor < 0:
        return ": one of them has the wrong sign"
    for known, unit in ((57.3, "degrees"), (9.55, "revolutions per minute"), (1000.0, "thousandths")):
        if abs(np.log(factor / known)) < _SAME:
            return f": {unit}?"
        if abs(np.log(factor * known)) < _SAME:
            return f": is the angle in {unit}?"
    return ""


# --- Speed from the angle, as far as it can be had --------------------------------------------------------------------


# A difference of angles over their distance in time is the *mean* speed over that interval, exactly, whatever the
# axis did in between; to first order it is the speed in the middle of it.  Read as the speed at the end of the
# interval it is half a sample late, which a fit answers with wrong friction and torque constant (5 and 9 % on the
# reference drive). Its noise is that of the angle, differenced: large, sqrt(2) sd / h, and correlated from sample to
# sample. So a grey-box fit takes the angle itself.  This here is for plots and for models without physics, whose
# frequency response has to be divided by ``averaging`` to become that of the speed.


class MeanSpeed(NamedTuple):
    """Mean speeds between the measured samples of a record, (M,) each."""

    t_mid: Floats
    """s, the middle of each interval"""
    speed: Floats
    """rad/s, mean over the interval"""
    interval: Floats
    """s, its length"""
    end: Ints
    """index of the sample of the record that ends it"""


def mean_speed(record: Record) -> MeanSpeed:
    """The mean speed between each two successive measured angles; over a longer interval where some are missing.

    Raises:
        ValueError: the record holds the speed; fewer than two angles were measured.
    """
    if record.quantity != "angle":
        raise ValueError("the speed was measured: there is nothing to differentiate")
    end = np.flatnonzero(record.measured)
    if end.size < 2:
        raise ValueError(f"{end.size} measured angles: for a speed two are needed")
    t, angle = record.t[end], record.y[end]
    interval = np.diff(t)
    return MeanSpeed((t[:-1] + t[1:]) / 2, np.diff(angle) / interval, interval, end[1:])


def averaging(omega: Floats, interval_s: float) -> Floats:
    """What the mean over the interval that ends at t makes of a sine: complex factor for each omega [rad/s].

    (1 - exp(-i w h)) / (i w h) = sinc(w h / 2) exp(-i w h / 2): half an interval of delay, and some damping.
    """
    half = np.asarray(omega, dtype=np.float64) * interval_s / 2
    factor: Floats = np.sinc(half / np.pi) * np.exp(-1j * half)
    return factor
