"""The simulated robot: all axes of a configuration, sample by sample, with faults."""

import heapq
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from service.config import Config, given_values
from service.simulation.axis import ControlledAxis, Reading


class Fault(NamedTuple):
    """Parameters of an axis change by these factors at a time."""

    axis_id: str
    factors: Mapping[str, float]
    after_s: float


class Moment(NamedTuple):
    """The samples of axes with the same interval: time since the start, number of the sample."""

    time_s: float
    interval_s: float
    number: int
    readings: Mapping[str, Reading]


class FaultError(Exception):
    """A fault that cannot be simulated; the text says why."""


class SimulatedRobot:
    """All axes of a configuration.

    Args:
        config: the configuration.
        seed: of noise and test signals.
        faults: the faults and their times.

    Raises:
        FaultError: a fault of an axis or a parameter that does not exist, or with an impossible value.
    """

    def __init__(self, config: Config, seed: int | None = None, faults: Sequence[Fault] = ()) -> None:
        rng = np.random.default_rng(seed)
        self._axes = {axis.id: ControlledAxis(axis, rng) for axis in config.axes}
        self._sent: dict[str, dict[str, float]] = {robot.name: {} for robot in config.robot}
        self._faults = sorted(faults, key=lambda fault: fault.after_s)
        for fault in faults:
            _try_out(fault, config)

    def moments(self, happened: Callable[[Fault], None] = lambda _: None) -> Iterator[Moment]:
        """Endless samples in the order of time; ``happened`` is called for each fault."""
        waiting = list(self._faults)
        groups = [(0.0, interval_s, 0) for interval_s in sorted({a.interval_s for a in self._axes.values()})]
        while True:
            time_s, interval_s, k = heapq.heappop(groups)
            while waiting and waiting[0].after_s <= time_s:
                fault = waiting.pop(0)
                self._axes[fault.axis_id].break_down(fault.factors)
                happened(fault)
            axes = [(i, axis) for i, axis in self._axes.items() if axis.interval_s == interval_s]
            yield Moment(time_s, interval_s, k, {i: self._sample(axis, k) for i, axis in axes})
            heapq.heappush(groups, ((k + 1) * interval_s, interval_s, k + 1))

    def _sample(self, axis: ControlledAxis, k: int) -> Reading:
        """The sample; its motion is available to the other axes, as it is on the bus."""
        named = axis.axis
        sent, motion = self._sent[named.robot], named.config.motion
        reading = axis.sample(k, sent)
        if motion.factor:
            sent[named.config.name] = (reading.motion - motion.offset) / motion.factor
        return reading


def _try_out(fault: Fault, config: Config) -> None:
    axis = next((axis for axis in config.axes if axis.id == fault.axis_id), None)
    if axis is None:
        known = ", ".join(axis.id for axis in config.axes)
        raise FaultError(f"fault: there is no axis {fault.axis_id}; there is {known}")
    try:
        ControlledAxis(axis, np.random.default_rng(0)).break_down(fault.factors)
    except KeyError as error:
        known = ", ".join(given_values(axis.config))
        raise FaultError(f"fault: no parameter {error} in axis {axis.id}; there is {known}") from None
    except (ValueError, ZeroDivisionError) as error:
        raise FaultError(f"fault: {error}") from None
