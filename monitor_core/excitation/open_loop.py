"""A torque that moves a drive without a position controller, and brings it back.

Such a drive drifts: with friction it integrates the torque once, without it twice.  So an offset balances the mean, and
pulses in the fades move the drive to where its motion has room on both sides, and back to rest at the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.excitation.multisine_signals import Multisine
from monitor_core.excitation.planned_drive import Motion, Plant
from monitor_core.excitation.record_phases import Schedule

_STEPS = 7
_CLOSE = 1e-3
"""Of the largest angle, and of the largest speed: so far the drive may end from rest."""
_RESTS = 0.05
"""Of the largest speed: more is no rest at the end."""
_DRIFT = 10.0
"""So much worse than a motion off the middle is one that leaves it further with every period."""
_STEP = 0.02
"""For the slopes, in rms values of the signal."""


class ExcitationError(ValueError):
    """An experiment that cannot be planned; the text says what would be right."""


@dataclass(frozen=True)
class OpenLoop:
    """Motions of a plant under a torque signal of any amplitude.

    Raises:
        ExcitationError: in use, if the drive does not stay where it is put.
    """

    plant: Plant
    schedule: Schedule
    signal: Multisine

    @cached_property
    def planned_angle(self) -> Floats:
        """Angle in the steady state of the linear drive (samples,), with the same room on both sides."""
        angle = self.schedule.repeated(self.signal.through(self.plant.response(self.signal.frequency_hz)[0]))
        return np.asarray(angle - (angle.max() + angle.min()) / 2)

    @cached_property
    def _corrections(self) -> Floats:
        """Shapes of torque (samples, 5), each 1 N m high."""
        return np.vstack([np.ones(self.schedule.samples), self.schedule.pulses()]).T

    def move(self, size: float) -> Motion:
        """The motion (samples, 1) with the signal scaled by a factor."""
        from scipy.optimize import lsq_linear  # 16 MB, which the daemon does not need

        wanted = size * self.schedule.window() * self.schedule.repeated(self.signal)
        step_size = size * self.signal.rms
        c, largest = self._start(), np.array([np.inf, *[self._highest * step_size] * 4])
        best: tuple[float, Motion] | None = None
        for _ in range(_STEPS):
            tried = c + _STEP * step_size * np.vstack([np.zeros(5), np.eye(5)])
            with np.errstate(all="ignore"):
                motion = self.plant.moved(wanted[:, None] + self._corrections @ tried.T)
            misses = np.vstack([self._misses(motion, size), self._reluctance * tried.T[1:] / step_size])
            if not np.isfinite(misses).all():
                break
            worst = float(np.linalg.norm(misses[:, 0]))
            if best is None or worst < best[0]:
                best = worst, motion
            if worst < _CLOSE:
                break
            slopes = (misses[:, 1:] - misses[:, :1]) / _STEP
            room = (
                np.minimum(largest - c, self._reach * step_size),
                np.maximum(-largest - c, -self._reach * step_size),
            )
            c = (
                c
                + step_size * lsq_linear(slopes, -misses[:, 0], (room[1] / step_size, room[0] / step_size)).x
            )
        return self._checked(best)

    def _start(self) -> Floats:
        """Initial corrections: no pulses, and the offset that the drive needs at rest (5,)."""
        at_rest = np.zeros(1)
        return np.array([self.plant.countered(at_rest, at_rest)[0], 0.0, 0.0, 0.0, 0.0])

    @property
    def _reach(self) -> float:
        """Range in which the linearised drive is used, in rms values of the signal."""
        return np.inf if self.plant.is_linear else 0.2

    @property
    def _highest(self) -> float:
        """Largest pulse, in rms values of the signal."""
        return np.inf if self.plant.is_linear else 0.5

    @property
    def _reluctance(self) -> float:
        """Weight against pulses: friction damps them, and keeps the drive from running away."""
        return 0.0 if self.plant.is_linear else 0.03

    def _misses(self, motion: Motion, size: float) -> Floats:
        """Errors of the mean angle, of its drift, and of the end from rest at zero.

        (periods + 3, W), over the largest planned angle and speed.
        """
        s, planned = self.schedule, size * self.planned_angle
        ranges = [slice(s.fade, s.N)] if s.fade < s.N else []
        ranges += [slice(s.N * k, s.N * (k + 1)) for k in range(1, s.periods + 1)]
        off = np.array([motion.angle[r].mean(axis=0) - planned[r].mean() for r in ranges])
        off = np.vstack([off.mean(axis=0, keepdims=True), _DRIFT * np.diff(off, axis=0)])
        top, fast = np.abs(planned).max(), np.abs(np.diff(planned)).max() / self.plant.interval_s
        return np.vstack([off / top, motion.angle[-1] / top, motion.speed[-1] / fast])

    def _checked(self, best: tuple[float, Motion] | None) -> Motion:
        """Friction may keep the drive from returning completely; but it must be at rest."""
        if best is None or (speed := np.abs(best[1].speed[:, 0]))[-1] > _RESTS * speed.max():
            raise ExcitationError(_NOT_HELD if self.plant.bears_weight else _NO_REST)
        torque, angle, speed, inputs = best[1]
        return Motion(torque[:, :1], angle[:, :1], speed[:, :1], inputs)


_ELSE = "plan a motion for its controller, with speed or angle as the reference"
_NOT_HELD = f"a torque alone does not keep this drive in its place (its weight moves it away): {_ELSE}"
_NO_REST = f"a torque alone does not bring this drive back to rest: raise the limits, or {_ELSE}"
