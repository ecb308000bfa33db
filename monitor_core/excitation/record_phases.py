"""Phases of a record: fade in, warm up, whole periods to be evaluated, fade out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.excitation.multisine_signals import Multisine


@dataclass(frozen=True)
class Schedule:
    """In samples: a warm-up of one period ``N``, whose first ``fade`` samples fade in; ``periods``; ``fade`` out.

    Raises:
        ValueError: no period; a fade longer than a period, or shorter than four samples.
    """

    N: int
    periods: int
    fade: int

    def __post_init__(self) -> None:
        if self.periods < 1:
            raise ValueError(f"{self.periods} periods: at least one is needed")
        if not 4 <= self.fade <= self.N:
            raise ValueError(f"a fade of {self.fade} samples: need 4 to {self.N}, a period")

    @property
    def samples(self) -> int:
        """Of the whole record."""
        return self.N * (1 + self.periods) + self.fade

    @property
    def evaluated(self) -> slice:
        """The samples of the whole periods."""
        return slice(self.N, self.N * (1 + self.periods))

    def window(self) -> Floats:
        """Rises from 0 to 1 and falls again (samples,), with continuous speed and acceleration."""
        t = np.arange(self.fade) / self.fade
        ramp = t**3 * (10 - 15 * t + 6 * t**2)
        middle = np.ones(self.samples - 2 * self.fade)
        return np.concatenate([ramp, middle, 1 - ramp])

    def repeated(self, signal: Multisine) -> Floats:
        """The signal throughout the record (samples,); the first evaluated period starts with its phase zero."""
        return np.resize(signal.samples(), self.samples)

    def pulses(self) -> Floats:
        """Two pulses in each fade (4, samples), one of one sign and one of both, which move the drive to a position."""
        phase = np.pi * np.arange(self.fade) / self.fade
        shapes = np.array([np.sin(phase) ** 2, np.sin(phase) * np.sin(2 * phase)])
        out = np.zeros((4, self.samples))
        out[:2, : self.fade] = shapes
        out[2:, -self.fade :] = shapes
        return out
