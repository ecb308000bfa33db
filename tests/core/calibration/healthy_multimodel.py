"""How often banks of hypotheses with these limits alarm on healthy axes: counted, with all of them at once.

And excursions of a given course of g.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.multimodel_tails import ExcursionPeaks
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.isolability import default_hypotheses
from monitor_core.detection.multimodel.multimodel_detector import HypothesisThreshold
from monitor_core.kernel.compile import entry
from monitor_core.samples import SampleBlock
from tests.core.calibration.healthy_axes import Axes, Plant

Singles = NDArray[np.float32]
CHUNK = 20_000


def excursions_of(g: Floats, place: Ints, origin: Ints, pieces: int = 1) -> ExcursionPeaks:
    """Excursions of a course g (N, H), cut into pieces, with the blocks of its motion and of its innovations (N,)."""
    peaks = ExcursionPeaks(g.shape[1])
    course = peaks.course()
    for rows in np.array_split(np.arange(len(g)), pieces):
        peaks.take(g[rows], int(rows[0]), place[rows], origin[rows], course)
    peaks.samples = len(g)
    return peaks


def count(
    plant: Plant, limits: Sequence[tuple[HypothesisThreshold, ...]], seed: int, samples: int
) -> tuple[Floats, int]:
    """False alarms of each bank (len(limits),) in so many tested samples; after an alarm its g begin at zero."""
    bank = HypothesisBank(plant.model, plant.settings, default_hypotheses(plant.model, plant.settings))
    axes = Axes(plant, np.random.default_rng(seed), 1)
    allowance, h = (
        np.array([[getattr(limit, field) for limit in own] for own in limits], np.float32).T.copy()
        for field in ("allowance", "h")
    )
    g, alarms, seen = np.zeros_like(h), np.zeros(len(limits), np.int64), 0
    while seen < samples:
        chunk = axes.take(CHUNK)
        _, trace = bank.run_traced(SampleBlock(chunk.t_us[:, 0], chunk.u[:, 0], chunk.y[:, 0]))
        tested = np.isfinite(trace.llr).any(axis=1)
        llr = np.ascontiguousarray(np.maximum(trace.llr[tested], -1e9), np.float32)
        _watch(llr, allowance, h, g, alarms)
        seen += int(tested.sum())
    return alarms.astype(float), seen


@entry
def _watch(llr: Singles, allowance: Singles, h: Singles, g: Singles, alarms: Ints) -> None:
    """llr (N, H); allowance, h and g (H, banks)."""
    H, banks = g.shape
    crossed = np.zeros(banks, np.bool_)
    for k in range(len(llr)):
        crossed[:] = False
        for a in range(H):
            for c in range(banks):  # innermost: side by side
                g[a, c] = max(np.float32(0.0), g[a, c] + llr[k, a] - allowance[a, c])
                crossed[c] |= g[a, c] > h[a, c]
        for c in range(banks):
            if crossed[c]:
                alarms[c] += 1
                g[:, c] = 0.0
