"""A learning window: new nominal values of a repaired axis, from its own estimates over hours of normal work.

The window is divided into equal parts of operating time.  Within a part, the readings in which a parameter was observed
are averaged with the weights 1 / variance (from P); the parts are averaged in the same way.  If the means of the parts
scatter more than P says, the standard deviation of the result is increased (Birge's ratio).

This changes theta_0 only.  The structure of the drive, the values that are not monitored, the filter gain and the
relative thresholds stay.  So a window is refused if these cannot be right any more: then the axis has to be identified
and calibrated again.
"""

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive import DELAY, LOAD, AxisModel
from monitor_core.trend.entries import EstimateReading, inflation

PARTS = 12
SKIPPED = 2
"""Readings left out at the beginning: they still depend on the axis before (a reading spans three memories)."""
FEWEST_PARTS = 4
"""Least number of parts in which a parameter must be observed."""
HARMLESS = 0.03
"""Deviation of the mean of a part, as a share of the size, that is accepted beyond chance and the allowance."""
DEVIATIONS = 4.0
MOST_UNCERTAIN = 0.05
"""Largest standard deviation of a new nominal value, in sizes; a test tolerates about three of them."""
MOST_MOVED = 0.5
"""Largest change of a nominal value, in sizes."""


class WindowDoubt(StrEnum):
    """Reason why a window gives no nominal values."""

    NOT_OBSERVED = "no parameter was observed for long enough"
    MODEL = "the model did not explain the measurements in most of the window"
    UNSTEADY = "the estimates did not stay the same over the window"
    MOVED = "a parameter has moved too far from its former nominal value"


class KeptReason(StrEnum):
    """Reason why a parameter keeps its former nominal value."""

    NOT_OBSERVED = "not observed for long enough in the window"
    UNCERTAIN = "too uncertain in the window"
    BY_DEFINITION = "its nominal value is no property of the gearbox or motor"


class WindowError(ValueError):
    """The window gives no nominal values; ``doubt`` is the reason, ``parameters`` are the affected ones."""

    def __init__(self, doubt: WindowDoubt, parameters: tuple[str, ...] = ()) -> None:
        super().__init__(f"{doubt}{': ' if parameters else ''}{', '.join(parameters)}")
        self.doubt, self.parameters = doubt, parameters


class Learned(NamedTuple):
    """New nominal values."""

    theta: Floats
    """(p,) nominal values; the former value for a parameter that keeps it"""
    standard_deviation: Floats
    """(p,) NaN for a parameter that keeps its former value"""
    kept: Mapping[str, KeptReason]
    """Reasons of the parameters that keep their former values, by name"""


class LearningWindow:
    """Collects the readings of an axis, in bounded memory.

    Args:
        model: model of the axis, with its former nominal values.
        length_s: length of the window, as operating time [s].
    """

    def __init__(self, model: AxisModel, length_s: float) -> None:
        self._model, self.length_s = model, length_s
        p = len(model.monitored)
        self._sums: Floats = np.zeros((3, PARTS, p))
        """Number of readings, sum of 1/variance, and sum of (value - theta_0)/variance, of each part and parameter"""
        self._rho: Floats = np.zeros(p)
        self._counts: Floats = np.zeros(4)
        """Operating time [s]; numbers of readings: left out, taken, and taken without a valid model"""

    @property
    def done_s(self) -> float:
        """Operating time so far [s]."""
        return float(self._counts[0])

    @property
    def complete(self) -> bool:
        """Whether the window has reached its length."""
        return self.done_s >= self.length_s * (1 - 1e-9)

    def take(self, reading: EstimateReading) -> None:
        """Add a reading; readings after the end of the window are ignored."""
        if self.complete:
            return
        if self._counts[1] < SKIPPED:
            self._counts[1] += 1
            return
        part = min(int(PARTS * self.done_s / self.length_s), PARTS - 1)
        self._counts += [reading.span_s, 0, 1, not reading.holds]
        known = np.array(reading.known)
        w = np.where(known, 1 / np.array(reading.variance), 0.0)
        d = np.where(known, np.array(reading.value) - self._model.theta0, 0.0)
        self._sums[:, part] += [known, w, w * d]
        self._rho[known] = reading.correlation

    def learned(self, allowance: Floats | float = 0.0) -> Learned:
        """The new nominal values.

        Args:
            allowance: (p,) allowance of the thresholds beyond chance, in theta's units.

        Raises:
            WindowError: the window gives no nominal values, with the reason.
        """
        m, names = self._model, self._model.monitored
        _, _, taken, bad = self._counts
        if taken and bad > taken / 2:
            raise WindowError(WindowDoubt.MODEL)
        found = [self._mean(i) for i in range(len(names))]
        kept = {name: why for name, (_, _, why) in zip(names, found, strict=True) if why is not None}
        new = np.array([name not in kept for name in names])
        if not new.any():
            raise WindowError(WindowDoubt.NOT_OBSERVED, names)
        limit = HARMLESS * m.scale + allowance
        unsteady = [n for i, n in enumerate(names) if new[i] and not self._steady(i, found[i][0], limit[i])]
        if unsteady:
            raise WindowError(WindowDoubt.UNSTEADY, tuple(unsteady))
        d = np.array([d for d, _, _ in found])
        moved = [n for i, n in enumerate(names) if new[i] and abs(d[i]) > MOST_MOVED * m.scale[i]]
        if moved:
            raise WindowError(WindowDoubt.MOVED, tuple(moved))
        sd = np.array([sd for _, sd, _ in found])
        return Learned(m.theta0 + np.where(new, d, 0.0), np.where(new, sd, math.nan), kept)

    def _parts(self, i: int) -> tuple[Floats, Floats]:
        """Mean deviation, and its variance from P, in each part in which parameter i was observed."""
        n, w, wd = self._sums[:, self._sums[0, :, i] > 0, i]
        variance = [inflation(int(k), float(self._rho[i])) / total for k, total in zip(n, w, strict=True)]
        return wd / w, np.array(variance)

    def _mean(self, i: int) -> tuple[float, float, KeptReason | None]:
        """Deviation from theta_0, its standard deviation, and the reason why the former value is kept, or None."""
        if self._model.monitored[i] in (DELAY, LOAD):
            return 0.0, math.nan, KeptReason.BY_DEFINITION
        means, variances = self._parts(i)
        if len(means) < FEWEST_PARTS:
            return 0.0, math.nan, KeptReason.NOT_OBSERVED
        W = 1 / variances
        d = float(W @ means / W.sum())
        birge = float(W @ np.square(means - d)) / (len(means) - 1)
        sd = math.sqrt(max(birge, 1.0) / W.sum())
        return d, sd, KeptReason.UNCERTAIN if sd > MOST_UNCERTAIN * self._model.scale[i] else None

    def _steady(self, i: int, d: float, limit: float) -> bool:
        means, variances = self._parts(i)
        return bool((np.abs(means - d) <= limit + DEVIATIONS * np.sqrt(variances)).all())

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        """The whole state, to be saved."""
        return {"sums": self._sums.copy(), "rho": self._rho.copy(), "counts": self._counts.copy()}

    def from_arrays(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Restore a saved state.

        Raises:
            KeyError: an array is missing.
            ValueError: an array does not belong to such a window, or is damaged.
        """
        own = {"sums": self._sums, "rho": self._rho, "counts": self._counts}
        found = {name: np.asarray(arrays[name], float) for name in own}
        for name, values in found.items():
            if values.shape != own[name].shape or not np.isfinite(values).all():
                raise ValueError(f"no learning window: {name}")
        for name, values in found.items():
            own[name][:] = values
