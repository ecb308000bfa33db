"""What simulated plants share: minimum-jerk motions one after another, and values drawn anew."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.kernel.compile import kernel

T = TypeVar("T")


def shortest_s(distance: float, speed: float, acceleration: float) -> float:
    """Duration of a motion over a distance with this largest speed and acceleration."""
    return max(1.875 * distance / speed, float(np.sqrt(5.774 * distance / acceleration)))


class Moves:
    """``draw``: from an angle, where the next motion leads, its duration, and the rest after it [s]."""

    def __init__(self, draw: Callable[[float], tuple[float, float, float]], start: float = 0.0) -> None:
        self._draw = draw
        self._table = np.zeros((0, 4))
        self._end_s, self._at = 0.0, start

    def between(self, now_s: float, until_s: float) -> Floats:
        """Rows of begin [s], duration [s], angle at the begin and distance; those that are over are forgotten."""
        new = []
        while self._end_s <= until_s:
            to, duration_s, rest_s = self._draw(self._at)
            new.append((self._end_s, duration_s, self._at, to - self._at))
            self._end_s, self._at = self._end_s + duration_s + rest_s, to
        kept = np.concatenate([self._table, np.array(new).reshape(-1, 4)])
        self._table = kept[max(int(np.searchsorted(kept[:, 0], now_s, "right")) - 1, 0) :]
        return self._table

    def wait(self, seconds: float) -> None:
        """All that is to come is so much later."""
        self._table[:, 0] += seconds
        self._end_s += seconds

    def pause(self, now_s: float, seconds: float) -> None:
        """What has not begun yet is so much later."""
        self._table[self._table[:, 0] > now_s, 0] += seconds
        self._end_s += seconds


@kernel
def motion(moves: Floats, row: int, now: float) -> tuple[float, float, float]:
    """Angle, speed and acceleration of a motion at a time."""
    T, way = moves[row, 1], moves[row, 3]
    s = min(max((now - moves[row, 0]) / T, 0.0), 1.0)
    angle = moves[row, 2] + way * s**3 * (10 - 15 * s + 6 * s * s)
    return angle, way / T * 30 * s * s * (1 - s) ** 2, way / (T * T) * 60 * s * (1 - s) * (1 - 2 * s)


def redrawn_fields(rng: np.random.Generator, usual: T, by: float) -> T:
    """A dataclass of numbers, or tuples of them, each by up to so much more or less."""
    drawn = dict[str, Any]()
    for name in usual.__annotations__:
        value = getattr(usual, name)
        factors = rng.uniform(1 - by, 1 + by, np.shape(value))
        drawn[name] = tuple((value * factors).tolist()) if isinstance(value, tuple) else value * factors
    return replace(usual, **drawn)  # type: ignore[type-var]
