"""Discretization of the drives of many hypotheses over the intervals that the kernel knows in advance."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.tables import TORQUE


class LaneIntervals(NamedTuple):
    """Discretizations of D drives over G intervals.

    Up to the delay the previous torque acts; with a negative delay the next torque acts at the end.
    """

    move: Floats
    """Transition of the state (D, G, n, n)"""
    taps: Floats
    """Effect of the held, the previous and the next torque (D, G, 3, n)"""
    acts: Floats
    """Effect of each input (D, G, n, m)"""


def discretize(models: Sequence[AxisModel], delays_s: Sequence[float], intervals_s: Floats) -> LaneIntervals:
    """Exact zero-order hold of models (D) of one drive, with their delays (D) of the torque, over intervals (G,)."""
    n, d = len(models[0].drive.states), np.stack([model.balance() for model in models])
    matrices = [model.matrices()[:2] for model in models]
    A = np.stack([A for A, _ in matrices]) / d[:, :, np.newaxis] * d[:, np.newaxis]
    B = np.stack([B for _, B in matrices]) / d[:, :, np.newaxis]
    F = np.zeros((len(d), n + B.shape[2], n + B.shape[2]))
    F[:, :n, :n], F[:, :n, n:] = A, B
    delay = np.array(delays_s)[:, np.newaxis]
    before, now = np.clip(delay, 0, intervals_s), np.clip(-delay, 0, intervals_s)
    (A1, B1), (A2, B2), (A3, B3) = (_held(F, n, part) for part in (before, intervals_s - before - now, now))
    parts = np.stack([A3 @ B2, A3 @ A2 @ B1, B3], axis=2)  # (D, G, 3, n, m): held, previous, next
    d = d[:, np.newaxis]
    torque = np.array(models[0].drive.inputs) == TORQUE
    return LaneIntervals(
        A3 @ A2 @ A1 * d[..., np.newaxis] / d[:, :, np.newaxis],
        parts[..., torque].sum(axis=4) * d[:, :, np.newaxis],
        parts.sum(axis=2) * d[..., np.newaxis],
    )


def _held(F: Floats, n: int, h: Floats) -> tuple[Floats, Floats]:
    """Ad (D, G, n, n) and Bd (D, G, n, m) of F = [A B; 0 0] (D, n + m, n + m), held over h (D, G) in s."""
    exp = np.tile(np.eye(F.shape[1]), (*h.shape, 1, 1))
    if (acts := h > 0).any():
        exp[acts] = sla.expm((F[:, np.newaxis] * h[..., np.newaxis, np.newaxis])[acts])
    return exp[..., :n, :n], exp[..., :n, n:]
