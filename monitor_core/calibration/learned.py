"""All that healthy records say before a budget is asked for: from deviations to the tails of the tests' sums."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.budget import nu_over_sigma
from monitor_core.calibration.healthy import Deviations, Samples
from monitor_core.calibration.informed import informed
from monitor_core.calibration.scatter import Scatter, scatter
from monitor_core.calibration.spread import allowance
from monitor_core.calibration.surrogate import SAMPLES, simulated
from monitor_core.calibration.tail import Tail, tails
from monitor_core.drive.axis_model import AxisModel
from monitor_core.settings import Settings


@dataclass(frozen=True)
class Learned:
    """Of p parameters: how their estimates scatter, what their tests are to allow for, and how far the sums go."""

    scatter: Scatter
    alone: Scatter
    """As uncertain as the records alone leave it, whatever copies of them know"""
    allowance: Floats  # (p,), in sizes
    tails: tuple[Tail, ...]


def learned(
    model: AxisModel,
    settings: Settings,
    records: Sequence[Samples],
    found: Sequence[Deviations],
    budget: float,
    within: float,
    rng: np.random.Generator,
    copies: int = SAMPLES,
    progress: Callable[[float], None] = lambda _: None,
) -> Learned:
    """What thresholds are made from.

    ``found`` is what the recursion made of the records.  nu is best for a ``budget`` of so many samples between two
    false alarms of the axis, and faults that are to be found ``within`` so many memories.  ``copies``: samples of
    healthy records that are simulated.

    Raises:
        ValueError: nothing was tested, or learned, in any record.
    """
    memory = settings.memory
    k = nu_over_sigma(len(model.scale), memory, budget, within)
    excursions = simulated(model, settings, records, k, rng, copies, progress)
    seen = scatter(found, memory, rng)
    told = informed(seen, excursions, rng)
    alone = replace(told, off=seen.off, power=seen.power)
    return Learned(told, alone, allowance(found, told), tails(told, excursions))
