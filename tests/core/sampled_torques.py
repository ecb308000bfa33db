"""Records of a rigid axis whose drive changes its torque between the samples, sent in one way or another."""

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.records.measured_record import Record

STEPS = 12
"""Steps of the drive in each interval between samples"""
J, FM, FC = 0.01, 0.01, 0.3
"""kg m^2, N m s/rad, N m"""
LATE = {"held": 0.0, "at the sample": 0.5, "mean of the interval before": 1.0}


def record_of(
    sends: str, interval_s: float, rng: np.random.Generator, weight: float = 0.0, noise: float = 0.02
) -> Record:
    """A rigid mass that follows random accelerations; the drive changes its torque in each step.

    ``weight``: amplitude of the weight of the arm [N m]; ``noise``: of the torque [N m].
    """
    fine, seconds = interval_s / STEPS, 240.0
    count = round(seconds / fine) // STEPS * STEPS
    jumps = rng.uniform(-400, 400, round(2 * seconds) + 1)
    change = np.interp(fine * np.arange(count), 0.5 * np.arange(jumps.size), jumps)
    w = 40 * np.sin(np.cumsum(change) * fine / 40)
    angle = np.cumsum(w) * fine
    torque = J * np.gradient(w, fine) + FM * w + FC * np.tanh(w / 0.5) + weight * np.sin(angle / 100)
    means = torque.reshape(-1, STEPS).mean(axis=1)
    sent = {"held": means, "at the sample": torque[::STEPS], "mean of the interval before": np.roll(means, 1)}[sends]
    y: Floats = angle[::STEPS]
    N = y.size - 1
    of_torque, of_angle = noise * rng.standard_normal(N), 1e-4 * rng.standard_normal(N)
    t = interval_s * np.arange(N, dtype=np.float64)
    return Record(t, sent[1:] + of_torque, y[1:] + of_angle, "angle", "x")
