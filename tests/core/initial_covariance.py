"""P(0) by the paper's recipe, from a record."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.monitoring import AxisBatch
from monitor_core.settings import Settings


def steady_state_p(
    model: AxisModel, settings: Settings, t_us: NDArray[np.int64], u: Floats, y: Floats
) -> tuple[float, ...]:
    """Diagonal of P(0): the P recursion runs along the nominal theta, its steady half is averaged.

    Raises:
        ValueError: the record (N,) holds too few samples for that.
    """
    seeding = replace(settings, P0=())
    bank = AxisBatch([model], [seeding])
    bank.run(t_us[:, np.newaxis], u[:, np.newaxis], y[:, np.newaxis])
    left = int(bank.state.seed_left[0])
    if left:
        need = seeding.seed_updates
        raise ValueError(
            f"the record gives {need - left} updates after settling, P(0) needs {need}: ten memory lengths"
        )
    return tuple(float(v) for v in bank.state.P_nom[:, 0])
