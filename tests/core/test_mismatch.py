"""A monitor of three masses on an axis of five with all that models lack: quiet, and its faults are named.

Nominal values, gain and thresholds are those that ``identify`` and ``calibrate`` found in records of the plant, as
tests/soak/test_mismatch.py has them found for twenty plants and ten hours each.
"""

import numpy as np

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain, gains_after
from monitor_core.drive.operating_conditions import Conditions, Follow
from monitor_core.drive.signal_terms import Term
from monitor_core.modeling.standard_drives import three_mass
from monitor_core.settings import Settings, Threshold
from tests.core.mismatch import FAULTS, INTERVAL_S, NOMINAL, MismatchPlant, R, Watch, after_fault, right

FOUND = {
    "Jm": 0.01551645314,
    "Jg": 125.7015065,
    "Ja": 140.4358972,
    "kg": 342341.0432,
    "ka": 168001.0909,
    "dg": 825.6970626,
    "da": 297.7105027,
    "fm": 0.04409790637,
    "fc": 0.7780608457,
    "tau0": -0.00136814947,
    "kT": 1.0,
    "r": R,
}
TORQUE_NOISE, OUTPUT_NOISE, INNOVATION_VARIANCE = 0.2417745098, 2.191615535e-05, 1.409491523e-06
FRICTION = Follow("fm", Term.read("temperature"), -0.0009824076915, 31.3, 21.0, 39.4)
THRESHOLDS = (
    Threshold(0.9238620667, 151.4268736, 0.0148059364, 0.02),
    Threshold(0.7501558646, 624.4104795, 0.0, 0.02),
    Threshold(0.7810745616, 538.7278361, 0.0001900147234, 0.02),
)
MEMORY_S, SETTLE_S = 5.0, 9.0
MINUTES, BLOCK_S = 30, 300.0


def watch(*follows: Follow) -> Watch:
    model = AxisModel(three_mass("angle"), FOUND, tuple(FAULTS))
    noises = model, INTERVAL_S, TORQUE_NOISE, OUTPUT_NOISE
    settings = Settings.paper(
        INTERVAL_S,
        lam=1 - INTERVAL_S / MEMORY_S,
        lam0=INNOVATION_VARIANCE,
        thresholds=THRESHOLDS,
        K=tuple(filter_gain(*noises)[0].tolist()),
        K_after=gains_after(*noises),
        settle_s=SETTLE_S,
        information_floor=0.05,
        min_excitation=0.05,
        outlier_limit=6.0,
    )
    return Watch(model, settings, Conditions(("temperature",), follows))


def test_half_an_hour_from_cold_is_quiet_and_faults_are_named(seed: int) -> None:
    plant, monitor = MismatchPlant(NOMINAL, np.random.default_rng(seed)), watch(FRICTION)
    for k in range(round(60 * MINUTES / BLOCK_S)):
        episodes, _ = monitor.take(plant.take(BLOCK_S))
        assert not episodes, (k, episodes)
    for name, (factor, seconds) in FAULTS.items():
        alarm = after_fault(plant, monitor, {name: factor}, seconds)
        print(f"{name} x {factor}: {alarm}")
        assert right(name, alarm), (name, alarm)


def test_friction_that_does_not_follow_the_temperature_alarms(seed: int) -> None:
    """A third of it is twice what a fault is."""
    plant, monitor = MismatchPlant(NOMINAL, np.random.default_rng(seed)), watch()
    blocks = (monitor.take(plant.take(BLOCK_S))[0] for _ in range(24))
    assert any((e.parameter, e.direction) == ("fm", "down") for raised in blocks for e in raised)


def test_a_friction_below_zero_is_none(seed: int) -> None:
    """What drives the axis, such as a load that nobody measures; less friction is a change of the friction."""
    for factor, doubt in ((-1.0, "model"), (0.3, "")):
        plant, monitor = MismatchPlant(NOMINAL, np.random.default_rng(seed)), watch(FRICTION)
        monitor.take(plant.take(120.0))
        versions, _ = monitor.take(plant.take(120.0, {"fc": factor}))
        named = {(e.parameter, e.direction, e.doubt) for e in versions if e.stage == "named"}
        assert named == {("fc", "down", doubt)}
