"""Records of linear drives: torques of the reference experiment, noise on torque and output."""

from collections.abc import Iterable, Mapping

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Drive
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS, Experiment
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES


def torques(rng: np.random.Generator, samples: int, axes: int) -> Floats:
    """Those of the reference experiment (samples, axes)."""
    return np.stack([multisine(rng, samples, INTERVAL_S, BAND_HZ, TORQUE_RMS) for _ in range(axes)], axis=1)


def simulated(
    rng: np.random.Generator,
    drive: Drive,
    u: Floats,
    torque_noise: float = 0.0,
    output_noise: float = 0.0,
    values: Mapping[str, float] = REFERENCE_VALUES,
) -> Experiment:
    """What is measured of an axis under a torque u (N,), or of axes side by side (N, W), from rest."""
    acting = u + torque_noise * rng.standard_normal(u.shape)
    y = changing_output(drive, [(values, acting)]) + output_noise * rng.standard_normal(u.shape)
    return Experiment(np.arange(len(u), dtype=np.int64) * round(INTERVAL_S * 1e6), u, y)


def changing_output(drive: Drive, parts: Iterable[tuple[Mapping[str, float], Floats]]) -> Floats:
    """The output without noise, from rest, of an axis (or axes side by side) with new values for each part of u."""
    x, outputs = None, []
    for values, u in parts:
        y, x = simulate_linear(drive, values, u.reshape(len(u), -1), INTERVAL_S, x)
        outputs.append(y.reshape(u.shape))
    return np.concatenate(outputs)
