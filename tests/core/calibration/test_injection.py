"""Faults put into a healthy record by another torque are what the faulty plant would have measured with it."""

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration.injection import changed_values, equivalent_load, faulty_torque
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.structure import DELAY, Output
from monitor_core.excitation import multisine
from monitor_core.modeling.simulated_axis import SimulatedAxis
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings


def exact_names(model: AxisModel) -> tuple[str, ...]:
    """The monitored parameters whose faults can be put into a record exactly."""
    return tuple(name for name in model.monitored if split_name(name)[0] != DELAY and _is_exact(model, name))


def _is_exact(model: AxisModel, name: str) -> bool:
    try:
        return equivalent_load(model, changed_values(model, name, 0.01)) is not None
    except ValueError:
        return False


H = 0.005
VALUES = {**REFERENCE_VALUES, "fc": 0.1, "tau0": 0.05}
MONITORED = ("kT", "1/Ja", "fm", "fc", "tau0", "Jm")
SAMPLES = 1000


def moved(values: dict[str, float], u: Floats) -> tuple[Floats, Floats]:
    """Angle and speed (N,) of the plant at the beginning of each interval."""
    axis = SimulatedAxis(values, substeps=20)
    motion = [(axis.angle, axis.speed)]
    motion += [axis.step(float(v), H) for v in u[:-1]]
    angle, speed = np.array(motion).T
    return angle, speed


def model(output: Output) -> AxisModel:
    return AxisModel(three_mass(output), VALUES, MONITORED)


def test_what_can_be_put_in_exactly() -> None:
    for output in ("angle", "speed"):
        assert exact_names(model(output)) == ("kT", "fm", "fc", "tau0")
    inverse = AxisModel(three_mass("angle"), VALUES, ("1/kT", "ka"))
    assert exact_names(inverse) == ("1/kT",)
    late = AxisModel(three_mass("angle").with_delay(), {**VALUES, DELAY: 0.001}, (DELAY, "fm"))
    assert exact_names(late) == ("fm",)


CHANGES = (("kT", 0.2), ("kT", -0.3), ("fm", 0.5), ("fm", -0.5), ("fc", 1.0), ("tau0", -2.0))
OUTPUTS: tuple[Output, ...] = ("angle", "speed")


@pytest.mark.parametrize(("output", "name", "change"), [(OUTPUTS[k % 2], *change) for k, change in enumerate(CHANGES)])
def test_the_faulty_plant_moves_as_the_record_says(output: Output, name: str, change: float, seed: int) -> None:
    """With the torque that is computed, to a fortieth of what the fault does to the speed with the torque of before."""
    rng = np.random.default_rng(seed)
    u = multisine(rng, SAMPLES, H, (0.2, 10.0), 1.23)
    axis_model = model(output)
    angle, speed = moved(VALUES, u)
    faulty = changed_values(axis_model, name, change)
    load = equivalent_load(axis_model, faulty)
    assert load is not None
    record = SampleBlock(np.arange(SAMPLES) * 5000, u, angle if output == "angle" else speed, name="r")
    needed = faulty_torque(MonitoredAxis(axis_model, Settings.paper(H)), record, load)
    _, with_it = moved(faulty, needed)
    _, without = moved(faulty, u)
    away = np.std(with_it[:-2] - speed[:-2]) / np.std(without - speed)
    print(f"{name} {change:+}: {away:.4f} of what it does")
    assert away < 0.025


def test_a_torque_that_acts_late(seed: int) -> None:
    """Half an interval late, the load is that of half an interval later."""
    axis_model = model("speed")
    load = equivalent_load(axis_model, changed_values(axis_model, "fm", 1.0))
    assert load is not None
    y = np.random.default_rng(seed).standard_normal(50).cumsum()
    record = SampleBlock(np.arange(50) * 5000, np.zeros(50), y, name="r")
    at_once, late = (
        faulty_torque(MonitoredAxis(axis_model, Settings.paper(H, delay_s=delay)), record, load)
        for delay in (0.0, H / 2)
    )
    assert late[:-1] == pytest.approx((at_once[:-1] + at_once[1:]) / 2)


def test_a_fault_beyond_the_bounds() -> None:
    with pytest.raises(ValueError, match="kT would leave its bounds"):
        changed_values(model("angle"), "kT", -0.95)
