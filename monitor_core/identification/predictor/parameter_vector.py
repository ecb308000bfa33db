"""The vector of a fit: meaning and bounds of each entry.

free parameters (positive ones as logarithms), slopes b of scheduled ones, delay, noise levels (logarithms), initial
state of each record
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.parameter_names import slope_name, value_of, with_values
from monitor_core.drive.structure import DELAY, DISTURBANCE_TIME, Drive
from monitor_core.identification.problem import Disturbance, Problem

_FARTHEST = 1e3
"""A positive parameter stays within this factor of its start, unless it has bounds."""
_LEVELS = 1e4
"""A noise level stays above its start divided by this factor."""
_LOUDEST = 100.0
"""Upper bound of torque noise: it moves the output within one interval by this number of standard deviations of the
output noise.  Beyond it K hardly depends on the level, and the Riccati equation becomes inexact."""


LEVEL = "noise "
"""Before the names of noise levels."""


class VectorEntry(NamedTuple):
    """One number: name, start, bounds; ``log``: the vector holds its logarithm."""

    name: str
    start: float
    lower: float
    upper: float
    log: bool


class PhysicalValues(NamedTuple):
    """Physical meaning of a vector."""

    values: dict[str, float]  # all parameters of the drive, where the signals of varying ones are zero
    slopes: Floats  # (b,) of varying parameters
    delay_s: float
    torque: float  # noise levels over that of the output
    slow: float


class Layout:
    """Order of the vector: ``names`` first (p, those reported), then noise levels, then initial states.

    Args:
        problem: the problem, with its free parameters.
        drive: with the state of the disturbance, if there is one.
        disturbance: None: K does not follow from noise.
        interval_s: the delay stays in the interval that it starts in.
    """

    def __init__(self, problem: Problem, drive: Drive, disturbance: Disturbance | None, interval_s: float) -> None:
        self._noise, self._nominal, self._delay_s = disturbance, dict(problem.nominal), problem.delay_s
        self._interval_s = interval_s
        self.free = problem.free
        if disturbance and disturbance.slow:
            self._nominal[DISTURBANCE_TIME] = disturbance.time_constant_s
            if "time_constant" in disturbance.free:
                self.free = (*self.free, DISTURBANCE_TIME)
        self.varying = tuple(
            (self.free.index(name), signal) for name, signals in problem.varying.items() for signal in signals
        )
        entries = [self._parameter(problem, drive, name) for name in self.free]
        entries += [self._slope(problem, slope_name(self.free[i], signal)) for i, signal in self.varying]
        if problem.free_delay:
            entries.append(_delay(problem, interval_s))
        self.names = tuple(entry.name for entry in entries)
        self.entries = (*entries, *self._levels(drive))
        self.free_delay = problem.free_delay

    def _parameter(self, problem: Problem, drive: Drive, name: str) -> VectorEntry:
        value = value_of(self._nominal, name)
        parameter = drive.parameter(name)
        positive = parameter.positive
        usual = (value / _FARTHEST, value * _FARTHEST) if positive else (parameter.least, math.inf)
        if name == DISTURBANCE_TIME:
            # A faster disturbance than the samples would be white noise.
            usual = (min(value, self._interval_s), value * _FARTHEST)
        lower, upper = problem.bounds.get(name, usual)
        if name not in problem.bounds:
            value = max(value, lower)  # the start may come from a fit without bounds
        if not lower <= value <= upper:
            raise ValueError(f"{name} starts at {value}, outside its bounds {lower}, {upper}")
        if positive and lower <= 0:
            lower = value / _FARTHEST
        return VectorEntry(name, value, lower, upper, positive)

    @staticmethod
    def _slope(problem: Problem, name: str) -> VectorEntry:
        bounds = problem.bounds.get(name, (-math.inf, math.inf))
        return VectorEntry(name, problem.slopes.get(name, 0.0), *bounds, False)

    def _levels(self, drive: Drive) -> list[VectorEntry]:
        noise = self._noise
        if noise is None:
            return []
        loudest = self._loudest(drive)
        return [
            VectorEntry(LEVEL + name, min(level, loudest), min(level, loudest) / _LEVELS, loudest, True)
            for name, level in self._ratios().items()
            if level and name in noise.free
        ]

    def _loudest(self, drive: Drive) -> float:
        A, B, C = drive.matrices(self._nominal)
        with np.errstate(all="ignore"):
            _, Bd = zero_order_hold(A, B, self._interval_s)
        moved = float(np.abs(C[0] @ Bd[:, drive.of_torque]).max())
        return _LOUDEST / moved if 0 < moved < math.inf else math.inf

    @property
    def levels(self) -> tuple[str, ...]:
        """Which noise levels are estimated, in order: of "torque" and "slow"."""
        return tuple(e.name.removeprefix(LEVEL) for e in self.entries if e.name.startswith(LEVEL))

    @property
    def shared(self) -> int:
        """Length of the vector without initial states."""
        return len(self.entries)

    @property
    def log(self) -> NDArray[np.bool_]:
        """Which entries are logarithms (shared,)."""
        return np.array([entry.log for entry in self.entries], dtype=bool)

    def start(self) -> Floats:
        """The vector to start from (shared,)."""
        return self._inward(np.array([entry.start for entry in self.entries]))

    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the vector, (shared,) each."""
        lower, upper = ([entry[k] for entry in self.entries] for k in (2, 3))
        return self._inward(np.array(lower)), self._inward(np.array(upper))

    def numbers(self, xi: Floats) -> Floats:
        """The physical numbers (shared,) of a vector."""
        shared = xi[: self.shared]
        return np.where(self.log, np.exp(np.where(self.log, shared, 0.0)), shared)

    def rates(self, xi: Floats) -> Floats:
        """d number / d xi (len(xi),)."""
        out = np.ones(xi.size)
        out[: self.shared] = np.where(self.log, self.numbers(xi), 1.0)
        return out

    def _inward(self, numbers: Floats) -> Floats:
        return np.where(self.log, np.log(np.where(self.log, numbers, 1.0)), numbers)

    def point(self, xi: Floats) -> PhysicalValues:
        """Physical meaning of a vector."""
        numbers, p, b = self.numbers(xi), len(self.free), len(self.varying)
        found = dict(zip([entry.name for entry in self.entries], numbers.tolist(), strict=True))
        return PhysicalValues(
            with_values(self._nominal, self.free, numbers[:p]),
            numbers[p : p + b],
            found.get(DELAY, self._delay_s),
            *(found.get(LEVEL + name, level) for name, level in self._ratios().items()),
        )

    def _ratios(self) -> dict[str, float]:
        """Noise levels over that of the output, as given."""
        noise = self._noise
        if noise is None:
            return {"torque": 0.0, "slow": 0.0}
        return {"torque": (noise.torque or 0.0) / noise.output, "slow": noise.slow / noise.output}


def whole_intervals(delay_s: float, interval_s: float) -> int:
    """Number of samples by which to shift the torque so that the remaining delay is from 0 to one interval."""
    return 0 if 0 <= delay_s <= interval_s else math.floor(delay_s / interval_s)


def _delay(problem: Problem, interval_s: float) -> VectorEntry:
    j = whole_intervals(problem.delay_s, interval_s)
    low, high = problem.bounds.get(DELAY, (-math.inf, math.inf))
    lower, upper = max(low, j * interval_s), min(high, (j + 1) * interval_s)
    if not lower <= problem.delay_s <= upper:
        raise ValueError(f"{DELAY} starts at {problem.delay_s}, outside its bounds {low}, {high}")
    return VectorEntry(DELAY, problem.delay_s, lower, upper, False)
