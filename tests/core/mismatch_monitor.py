"""Nominal values, gain and thresholds that identify and calibrate found in records of the plant of mismatch.py."""

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain, gains_after
from monitor_core.drive.operating_conditions import Conditions, NominalSchedule
from monitor_core.drive.signal_terms import Term
from monitor_core.modeling.standard_drives import three_mass
from monitor_core.settings import Settings, Threshold
from tests.core.mismatch import FAULTS, INTERVAL_S, R, Watch

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
FRICTION = NominalSchedule("fm", Term.read("temperature"), -0.0009824076915, 31.3, 21.0, 39.4)
THRESHOLDS = (
    Threshold(0.9238620667, 151.4268736, 0.0148059364, 0.02),
    Threshold(0.7501558646, 624.4104795, 0.0, 0.02),
    Threshold(0.7810745616, 538.7278361, 0.0001900147234, 0.02),
)
MEMORY_S, SETTLE_S = 5.0, 9.0


def watch(*follows: NominalSchedule) -> Watch:
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
