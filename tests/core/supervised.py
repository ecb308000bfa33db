"""The reference drive, supervised as the daemon does by default."""

from monitor_core.drive.kalman import filter_gain, gains_after
from monitor_core.excitation.reference_experiment import NOISE
from monitor_core.modeling.standard_drives import reference_model
from monitor_core.settings import Settings

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
