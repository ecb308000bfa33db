"""Operating conditions of a simulated axis: its auxiliary signals, and their effect on the drive."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from monitor_core.drive import Conditions, Follow, Gate, Operating, split_name
from service.config import NamedAxis, conditions_of, needed
from service.config.axis_settings import axis_model

PERIOD_S = 60.0
"""In which a signal that is followed swings through its range once."""
_SWING = 0.45
"""Of the width of its range, to both sides of the middle."""
_BACK = {"cos": math.acos, "sin": math.asin, "square": math.sqrt}


class SimulatedConditions:
    """Signals that keep the gates of an axis open, and parameters that follow them.

    A signal of another axis is the motion that this axis sends.  A signal of a schedule swings through its range,
    others are constant.
    """

    def __init__(self, axis: NamedAxis) -> None:
        conditions = conditions_of(axis)
        self._sources = needed(axis)
        self._swings = [_swing(source.name, conditions) for source in self._sources]
        self._model = axis_model(axis.config)
        self._operating = Operating(self._model, replace(conditions, gates=(), min_speed=0.0))

    def signals(self, time_s: float, others: Mapping[str, float]) -> tuple[float, ...]:
        """The signals at that time; ``others`` are the motions of the other axes of the robot as sent, by name."""
        phase = math.sin(2 * math.pi * time_s / PERIOD_S)
        return tuple(
            middle + swing * phase
            if source.axis is None
            else source.factor * others.get(source.axis, math.nan) + source.offset
            for source, (middle, swing) in zip(self._sources, self._swings, strict=True)
        )

    def followed(
        self, signals: tuple[float, ...], values: Mapping[str, float]
    ) -> Iterator[tuple[str, float]]:
        """The parameters that follow the signals, with these values at the references."""
        shift, _ = self._operating.take(np.zeros(1, np.int64), np.zeros(1), np.array([signals]))
        for name, moved, unit in zip(self._model.monitored, shift[0], self._model.unit, strict=True):
            base, inverse = split_name(name)
            if math.isfinite(moved) and moved != 0 and base in values:
                value = (1 / values[base] if inverse else values[base]) + float(moved * unit)
                yield base, 1 / value if inverse else value


def _swing(name: str, conditions: Conditions) -> tuple[float, float]:
    """Middle and amplitude of a signal."""
    gates = [gate for gate in conditions.gates if gate.signal == name]
    follows = [follow for follow in conditions.follows if follow.term.signal == name]
    if gates:
        candidates = list(_candidates(gates))
        fitting = (v for v in candidates if all(gate.open(np.array([v])).all() for gate in gates))
        return next(fitting, candidates[0]), 0.0
    first = follows[0]
    if not first.term.function and math.isfinite(first.high - first.low):
        return (first.low + first.high) / 2, _SWING * (first.high - first.low)
    return _at_reference(first), 0.0


def _candidates(gates: list[Gate]) -> Iterator[float]:
    for gate in gates:
        yield from gate.equals
    above, below = max(g.above for g in gates), min(g.below for g in gates)
    if math.isfinite(above) or math.isfinite(below):
        span = 2.0 if math.isinf(above) or math.isinf(below) else below - above
        yield above + span / 2 if math.isfinite(above) else below - span / 2
    yield 0.0


def _at_reference(follow: Follow) -> float:
    back = _BACK.get(follow.term.function)
    try:
        return back(follow.reference) if back else follow.reference
    except ValueError:  # a mean of a square, or what is no cosine at all
        return 0.0
