"""What the kernel needs to know of an axis that does not change: settings and nominal values as its constants."""

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.stability import stable_limits
from monitor_core.settings import Settings

SLOW_MEMORIES = 10


def vague(model: AxisModel, s: Settings) -> Floats:
    """Diagonal of P (p,) of who knows no more of the parameters than their sizes."""
    return np.asarray((1 + s.lam) * model.scale**2 / s.lam0)


def constants_of(assembly: Assembly, model: AxisModel, s: Settings) -> dict[str, Floats]:
    """By the names of kernel/tables.Constants: numbers, or as many rows as each needs.

    Raises:
        ValueError: settings that do not fit the drive.
    """
    numbers = {
        "interval": s.interval_s,
        "lam": s.lam,
        "lam0": s.lam0,
        "lam_slow": 1 - (1 - s.lam) / SLOW_MEMORIES,
        "delay": s.delay_s,
        "gap_us": round(s.max_gap_s * 1e6),
        "settle_us": round(s.settle_s * 1e6),
        "seed": s.seed_updates,
        "calm": s.naming_samples,
        "floor": s.floor,
        "starved": s.starved,
        "lost_us": round(s.lost_s * 1e6),
        "outlier": s.outlier,
        "joint": s.joint,
        "drift": s.drift,
        "tested": not s.untold,
        "widen": s.widen,
        "span": s.span,
    }
    n = len(model.drive.states)
    vectors = {"K": s.gains(n).ravel(), "vague": vague(model, s), "scale": model.scale}
    alpha1, alpha2, allowance = s.tests(len(model.scale))
    vectors |= {"h": alpha2 * model.scale, "alpha1": alpha1, "allowance": allowance * model.scale}
    vectors |= assembly.model_constants(model, s.speed_scale)
    vectors["lower"], vectors["upper"] = stable_limits(model, s.gain(n), s.interval_s)
    return vectors | {k: np.array(float(v)) for k, v in numbers.items()}
