"""The paper's reference experiment: these numbers reproduce its Figures 5 and 6."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.structure import Output
from monitor_core.excitation.multisine_signals import multisine
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, three_mass

SAMPLES = 2000
FAULT_AT = 1000
BAND_HZ = (0.0, 30.0)
TORQUE_RMS = 1.23
"""N m"""
NOISE: Mapping[Output, float] = {"speed": 1.0, "angle": INTERVAL_S / np.sqrt(2), "mean speed": 1.0}
"""Standard deviation of the white noise on the output: 1 rad/s; on an angle, the value whose differences give this."""


class Experiment(NamedTuple):
    """Samples of one axis, fields (N,); or of W axes, t_us (N,) and the others (N, W)."""

    t_us: NDArray[np.int64]
    u: Floats
    y: Floats


def faulty(values: Mapping[str, float], fault: Mapping[str, float]) -> dict[str, float]:
    """``values`` with each parameter of ``fault`` times its factor: {"1/Ja": 1.2} divides Ja by 1.2."""
    changed = dict(values)
    for name, factor in fault.items():
        base, inverse = split_name(name)
        changed[base] *= 1 / factor if inverse else factor
    return changed


def experiment(
    seed: int,
    fault: Mapping[str, float] | None = None,
    *,
    output: Output = "speed",
    samples: int = SAMPLES,
    fault_at: int = FAULT_AT,
    noise: float | None = None,
) -> Experiment:
    """One record of the three-mass drive from rest: t_us, u, y (samples,), every 5 ms, under a multisine torque.

    ``fault``: factors of parameters from sample ``fault_at`` on: {"kT": 1.2}; {"1/Ja": 1.2} divides Ja by 1.2.
    ``noise``: standard deviation of the white noise on the output, in its unit (rad/s or rad); default NOISE.

    Raises:
        KeyError: the drive has no parameter of that name.
    """
    t_us, u, y = experiments([seed], fault, output=output, samples=samples, fault_at=fault_at, noise=noise)
    return Experiment(t_us, u[:, 0], y[:, 0])


def experiments(
    seeds: Sequence[int],
    fault: Mapping[str, float] | None = None,
    *,
    output: Output = "speed",
    samples: int = SAMPLES,
    fault_at: int = FAULT_AT,
    noise: float | None = None,
) -> Experiment:
    """As ``experiment``, one column for each seed."""
    rngs = [np.random.default_rng(seed) for seed in seeds]
    u = np.stack([multisine(rng, samples, INTERVAL_S, BAND_HZ, TORQUE_RMS) for rng in rngs], axis=1)
    white = np.stack([rng.standard_normal(samples) for rng in rngs], axis=1)
    drive = three_mass(output)
    before, x = simulate_linear(drive, REFERENCE_VALUES, u[:fault_at], INTERVAL_S)
    after, _ = simulate_linear(drive, faulty(REFERENCE_VALUES, fault or {}), u[fault_at:], INTERVAL_S, x)
    y = np.concatenate([before, after]) + (NOISE[output] if noise is None else noise) * white
    t_us = np.arange(samples, dtype=np.int64) * round(INTERVAL_S * 1e6)
    return Experiment(t_us, u, y)
