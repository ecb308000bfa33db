"""An axis whose weight turns with the pose, as an input of its drive: model, settings, and samples."""

from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import LOAD, AxisModel
from monitor_core.drive.kalman import filter_gain
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, three_mass
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.oracle.system import held_over, inputs

VALUES = {**REFERENCE_VALUES, "fc": 0.0, "tau0": -0.2, LOAD: 1.0}
MODEL = AxisModel(three_mass("speed").with_load("tau0"), VALUES, ("kT", "fm", LOAD))
K, LAM0 = filter_gain(MODEL, INTERVAL_S, 0.05, 0.1)
SETTINGS = Settings(INTERVAL_S, lam=1 - INTERVAL_S / 2.0, lam0=LAM0, K=tuple(K.tolist()), settle_s=0.5)
SAMPLES = 20_000


def moving(
    seed: int, load: float, samples: int = SAMPLES, torque_constant: float = 1.0, inertia: float = 1.0
) -> SampleBlock:
    """An axis whose weight turns with the pose; from the middle on with another load (and inertia of it) or motor."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) * INTERVAL_S
    weight = 1.5 * np.cos(np.sin(0.9 * t) + 0.7 * np.sin(0.23 * t))
    u = rng.standard_normal(samples) - weight
    changed = {**VALUES, LOAD: load, "kT": torque_constant, "Ja": inertia * VALUES["Ja"]}
    models = [MODEL, replace(MODEL, nominal=changed)]
    x, y = np.zeros(5), np.empty(samples)
    steps = [_step(model) for model in models]
    C = MODEL.matrices()[2][0]
    for k in range(samples):
        y[k] = C @ x + 0.1 * rng.standard_normal()
        Ad, Bd = steps[int(k >= samples // 2)]
        x = Ad @ x + Bd @ inputs(MODEL, u[k], 0.0, weight[k])
    return SampleBlock(np.arange(samples) * round(INTERVAL_S * 1e6), u, y, weight=weight)


def _step(model: AxisModel) -> tuple[Floats, Floats]:
    A, B, _ = model.matrices()
    unit = np.eye(len(A))
    Ad = np.column_stack([held_over(A, np.zeros(len(A)), e, INTERVAL_S) for e in unit])
    Bd = np.column_stack([held_over(A, b, np.zeros(len(A)), INTERVAL_S) for b in B.T])
    return Ad, Bd
