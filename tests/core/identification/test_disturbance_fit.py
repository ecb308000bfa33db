"""A slow torque disturbance: its level and time constant are found, and with them the drive."""

import numpy as np
import pytest
from scipy.signal import lfilter

from monitor_core.drive.kalman import filter_gain
from monitor_core.identification.greybox import Disturbance, fit
from monitor_core.identification.records import Record
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from tests.core.identification.problems import EIGHT, TRUE, reference_problem, reference_record


def test_levels_time_constant_and_drive_are_found(seed: int) -> None:
    """d of 0.4 N m and 0.3 s, white torque noise of 0.1 N m, output noise of 0.5 rad/s."""
    N, h, T, slow, white, output = 6000, 0.005, 0.3, 0.4, 0.1, 0.5
    rng, clean = np.random.default_rng(seed), reference_record(seed, N, noise=0.0)
    a = np.exp(-h / T)
    d = lfilter([1], [1, -a], slow * np.sqrt(1 - a**2) * rng.standard_normal(N))
    torque = clean.u + d + white * rng.standard_normal(N)
    y, _ = simulate_linear(three_mass("speed"), REFERENCE_VALUES, torque[:, None], h)
    rec = Record(clean.t, clean.u, y[:, 0] + output * rng.standard_normal(N), "speed")
    noise = Disturbance(slow=1.0, time_constant_s=1.0, free=("torque", "slow", "time_constant"))
    found = fit(reference_problem(predictor="innovations", disturbance=noise), [rec])
    assert found.converged
    assert found.names == (*EIGHT, "Td")
    assert np.abs((found.theta[:8] - TRUE) / found.sd[:8]).max() < 4.5
    assert found.values["Td"] == pytest.approx(T, abs=4.5 * found.sd[8])
    assert found.noise["slow"] == pytest.approx(slow, rel=0.4)
    assert found.noise["output"] == pytest.approx(output, rel=0.06)
    assert found.whiteness.p_value > 1e-4
    simulated = fit(reference_problem(), [rec])
    assert (found.sd[:8] < simulated.sd).all()


def test_the_monitor_gets_this_very_gain(seed: int) -> None:
    """From the estimate's drive, values and noise: K in physical states, lambda_0."""
    rec = reference_record(seed, 3000)
    noise = Disturbance(torque=0.3, slow=0.5, free=())
    found = fit(reference_problem(predictor="innovations", disturbance=noise), [rec])
    levels = (found.noise["torque"], found.noise["output"], found.noise["slow"])
    K, lam0 = filter_gain(found.model(), found.interval_s, *levels)
    np.testing.assert_allclose(found.K, K, rtol=1e-6, atol=1e-9 * abs(K).max())
    assert found.lam0 == pytest.approx(lam0, rel=1e-9)
    assert len(found.K) == len(found.drive.states) == 6
