"""K from the noise levels, its derivatives, and the disturbance as a state of the drive."""

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain
from monitor_core.drive.structure import DISTURBANCE_TIME, Output
from monitor_core.excitation.reference_experiment import NOISE
from monitor_core.identification.predictor.held_drive import Structure
from monitor_core.identification.predictor.noise import Levels, gain
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass

H = 0.005
FREE = ("Jm", "1/Ja", "kg", "r", DISTURBANCE_TIME)
VALUES = {**REFERENCE_VALUES, DISTURBANCE_TIME: 0.3}


def gain_at(
    output: Output, theta: Floats, torque: float, slow: float
) -> tuple[Floats, Floats, float, Floats]:
    """K and dK in the drive's states."""
    drive = three_mass(output).with_disturbance()
    values = dict(VALUES)
    for name, value in zip(FREE, theta, strict=True):
        base = name.removeprefix("1/")
        values[base] = value if base == name else 1 / value
    d = AxisModel(drive, VALUES, ()).balance()
    of = Structure(drive, FREE, d).at(values)
    found = gain(
        of,
        np.array([kind == TORQUE for kind in drive.inputs]),
        Levels(torque, slow, values[DISTURBANCE_TIME], H, float(d[-1])),
        ("torque", "slow"),
        FREE.index(DISTURBANCE_TIME),
    )
    return found.K * d, found.dK * d[:, None], found.S, d


THETA = np.array([VALUES[n] if n in VALUES else 1 / VALUES[n.removeprefix("1/")] for n in FREE])


@pytest.mark.parametrize("output", ["speed", "angle"])
@pytest.mark.parametrize("torque", [0.01, 0.3])
@pytest.mark.parametrize("slow", [0.02, 1.0])
def test_gain_is_the_monitors(output: Output, torque: float, slow: float) -> None:
    model = AxisModel(three_mass(output).with_disturbance(), VALUES, ())
    sd = NOISE[output]
    K, lam0 = filter_gain(model, H, torque, sd, slow)
    found, _, S, _ = gain_at(output, THETA, torque / sd, slow / sd)
    np.testing.assert_allclose(found, K, rtol=1e-6, atol=1e-9 * abs(K).max())
    assert S * sd**2 == pytest.approx(lam0, rel=1e-9)


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_derivatives_of_the_gain(output: Output) -> None:
    sd = NOISE[output]
    at = np.concatenate([THETA, [0.1 / sd, 0.5 / sd]])

    def K(numbers: Floats) -> Floats:
        return gain_at(output, numbers[:-2], numbers[-2], numbers[-1])[0]

    _, dK, _, _ = gain_at(output, THETA, at[-2], at[-1])
    for i, value in enumerate(at):
        h = 1e-4 * value * np.eye(len(at))[i]
        slope = (8 * (K(at + h) - K(at - h)) - K(at + 2 * h) + K(at - 2 * h)) / (12 * h[i])
        size = abs(slope).max(initial=1e-300)
        np.testing.assert_allclose(dK[:, i] / size, slope / size, atol=3e-6, rtol=1e-3)
        assert size * value > 1e-6 * abs(K(at)).max()


def test_a_drive_that_has_the_disturbance_already() -> None:
    with pytest.raises(ValueError, match="already has a parameter Td"):
        three_mass("speed").with_disturbance().with_disturbance()


def test_disturbance_noise_needs_its_state() -> None:
    with pytest.raises(ValueError, match="has no torque disturbance"):
        filter_gain(AxisModel(three_mass("speed"), REFERENCE_VALUES, ()), H, 0.1, 1.0, 0.1)
