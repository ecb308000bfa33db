"""Speed from the angle, as far as it can be had.

A difference of angles over their distance in time is the *mean* speed over that interval, exactly, whatever the axis
did in between; to first order it is the speed in the middle of it.  Read as the speed at the end of the interval it is
half a sample late, which a fit answers with wrong friction and torque constant (5 and 9 % on the reference drive).
Its noise is that of the angle, differenced: large, sqrt(2) sd / h, and correlated from sample to sample.

So a grey-box fit takes the angle itself.  This here is for plots and for models without physics, whose frequency
response has to be divided by ``averaging`` to become that of the speed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.record import Record


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
