"""Alarms of a bank are fewer than those of its hypotheses: what several of them take for theirs is one alarm.

After it all begin anew.  The higher the thresholds, the seldomer that is: -log of the share of alarms that are left
falls as a power of how often they are, which two counts tell.
"""

import math

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.heights import TOP, Heights

_OFTEN, _FEW = TOP, TOP // 20
"""Excursions of each: far enough apart, and enough of them, that the two shares are hardly ever the wrong way round."""
_STEEPEST = 1.0
_UNSURE = 0.2
"""Standard deviation of the exponent's logarithm of the share, over itself."""


def log_share(found: Heights, hypotheses: int, log_rate: float, draws: Floats) -> Floats:
    """Logarithm (B,) of alarms of the bank over those of its hypotheses, which are exp(log_rate) per sample together.

    ``draws`` (B,) are of a standard normal.
    """
    often, seldom = (_fused(found, hypotheses, many) for many in (_OFTEN, _FEW))
    if not seldom[0] < 0 or not often[0] < seldom[0]:
        return np.zeros_like(draws)
    power = math.log(often[0] / seldom[0]) / (often[1] - seldom[1])
    farther = min(log_rate - seldom[1], 0.0)
    return np.asarray(seldom[0] * math.exp(min(power, _STEEPEST) * farther) * np.exp(_UNSURE * draws))


def _fused(found: Heights, hypotheses: int, many: int) -> tuple[float, float]:
    """Logarithms of the share, and of the rate of excursions, where each hypothesis has so many."""
    events = np.concatenate([found.events(i, many) for i in range(hypotheses)], axis=1)
    together, alarms, last = max(events.shape[1], 1), 0, -1.0
    for start, reached in events[:, np.argsort(events[1])].T.tolist():
        if start > last:
            alarms, last = alarms + 1, reached
    return math.log(max(alarms, 1) / together), math.log(together / max(found.samples, 1))
