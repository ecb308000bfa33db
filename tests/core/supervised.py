"""The reference drive, supervised as the daemon does by default, and its records with pauses."""

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.kalman import filter_gain, gains_after
from monitor_core.drive.structure import Output
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, NOISE, TORQUE_RMS, Experiment
from monitor_core.modeling.standard_drives import reference_model, three_mass
from monitor_core.settings import Settings
from tests.core.simulated import simulated

H = 0.005
MODEL = reference_model()
FLOOR, STARVED = 0.05, 0.05
TORQUE_NOISE = 0.3
"""N m"""
K, LAM0 = filter_gain(MODEL, H, TORQUE_NOISE, NOISE["speed"])
SUPERVISED = Settings.paper(
    H,
    K=tuple(K),
    K_after=gains_after(MODEL, H, TORQUE_NOISE, NOISE["speed"]),
    lam0=LAM0,
    settle_s=1.0,
    information_floor=FLOOR,
    min_excitation=STARVED,
)


def lively_then_still(rng: np.random.Generator, lively: int, still: int, again: int) -> Floats:
    """Torque (N,)."""
    parts = [multisine(rng, n, H, BAND_HZ, TORQUE_RMS) for n in (lively, again)]
    return np.concatenate([parts[0], np.zeros(still), parts[1]])


def moved(output: Output, u: Floats, rng: np.random.Generator) -> Experiment:
    """The reference drive's linear part under this torque; what it lacks of another drive is noise to that."""
    return simulated(rng, three_mass(output), u, output_noise=NOISE[output])
