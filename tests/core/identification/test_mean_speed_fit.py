"""A speed that the drive averages is fitted without bias; its predictor and gradients: test_predictor.py."""

from __future__ import annotations

import numpy as np

from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS
from monitor_core.identification import Record
from monitor_core.identification.greybox import fit
from monitor_core.identification.problem import Disturbance, Problem
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass

H = 0.005
AVERAGED = three_mass("speed").with_mean_speed()
NOISE = Disturbance(torque=0.05, output=0.05)
FREE = ("Jm", "Ja", "fm")


def measured(seed: int, samples: int) -> Record:
    """A record of the reference drive."""
    rng = np.random.default_rng(seed)
    u = multisine(rng, samples, H, BAND_HZ, TORQUE_RMS)
    acting = (u + 0.05 * rng.standard_normal(samples))[:, np.newaxis]
    y = simulate_linear(AVERAGED, REFERENCE_VALUES, acting, H)[0][:, 0] + 0.05 * rng.standard_normal(samples)
    return Record(H * np.arange(samples, dtype=np.float64), u, y, "speed")


def test_the_fit_is_without_bias(seed: int) -> None:
    """Read as the speed at the samples, Jm is 8 to 10 % off in such a record; its standard deviation is 0.05 %."""
    record = measured(seed, 6000)
    start = {**REFERENCE_VALUES, "Jm": 1.1 * REFERENCE_VALUES["Jm"]}
    found, read_as_speed = (
        fit(Problem(drive, start, FREE, disturbance=NOISE), [record])
        for drive in (AVERAGED, three_mass("speed"))
    )
    for name, sd in zip(FREE, found.sd[:3], strict=True):
        assert abs(found.values[name] - REFERENCE_VALUES[name]) < 8 * sd, name
    assert read_as_speed.values["Jm"] > 1.05 * REFERENCE_VALUES["Jm"]
    assert found.lam0 < 0.3 * read_as_speed.lam0
