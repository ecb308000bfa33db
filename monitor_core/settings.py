"""Settings of the monitoring of an axis: predictor, forgetting, tests, gaps."""

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.kernel.outliers import CREDIT, JOLT_S, PEAK
from monitor_core.kernel.tables import GAINS

NAMING_MEMORIES = 3
"""Memory lengths after which what a change did to all estimates is known."""

TOGETHER, DOUBTFUL = 0.95, 0.2
"""Of nominal values: the correlation above which two are not distinguished; the standard deviation, beside the value,
from which one of them is doubtful, as the change that the paper looks for is then within one.  ``identify`` holds one
of such a pair; with both of them free the daemon would test nothing."""


MODEL_ERRORS = 2.0
"""So many standard deviations of what a model of the nominal values lacks are allowed for.  They are those of its worst
times, and an upper bound: with three of them 30 % more Coulomb friction of a warm axis was not always found."""

ALLOWED = 3.0
"""So many standard deviations of what healthy estimates differ by, beside their scatter, the tests allow for."""


class Threshold(NamedTuple):
    """The tests of one parameter: nu = alpha1 sqrt(lambda_0 P_ii) + allowance s_i,  h = alpha2 s_i, s_i its size.

    ``size_error``: standard deviation of what the estimate of the healthy axis is off by for good, in s_i.
    """

    alpha1: float
    alpha2: float
    allowance: float = 0.0
    size_error: float = 0.0


@dataclass(frozen=True)
class Settings:
    """Settings of one axis.

    The defaults are recommended ones.  What depends on the axis has none of use: ``recommended_settings`` computes K,
    lam0, settle_s and lost_s from the model and the noise.  ``Settings.paper`` has the settings of the paper.

    Raises:
        ValueError: a value outside its range.
    """

    interval_s: float
    """Nominal sample interval."""
    lam: float = 0.995
    """Forgetting factor lambda, per interval: over another one, h, it is lambda^(h / interval)."""
    lam0: float = 1.0
    """Innovation variance lambda_0, in the output's unit squared, used by nu and by standard deviations."""
    alpha1: float = 3.0
    alpha2: float = 20.0
    thresholds: tuple[Threshold, ...] = ()
    """One for each parameter; empty: alpha1 and alpha2 for all, without an allowance."""
    model_error: tuple[float, ...] = ()
    """For each parameter: standard deviation of what its nominal value is off by, as it follows a model (a warm-up
    without a thermometer), in sizes; empty: nothing.  The allowance of its tests is at least ``MODEL_ERRORS`` times
    that."""
    K: tuple[float, ...] = ()
    """Filter gain of the innovations form, one number per state; empty is K = 0, the paper's output error."""
    K_after: tuple[tuple[float, ...], ...] = ()
    """The gain after 0, 2, 3 .. 11 intervals (drive/kalman.py); empty: K after each."""
    delay_s: float = 0.0
    """Time by which the torque acts later than its sample, at most one interval."""
    max_gap_s: float = 0.05
    """A longer interval between samples re-initialises the predictor."""
    settle_s: float = 1.0
    """No update of theta for this time [s] after a start of the predictor."""
    lost_s: float = 0.0
    """No update of theta for this time [s] after each lost sample but the first in a row, as the torque in between is
    unknown."""
    speed_scale: float = 1.0
    """Speed of tanh(speed / speed_scale), rad/s, at the flange that the friction acts on."""
    P0: tuple[float, ...] = field(default=())
    """Diagonal of P(0); empty: found from the first samples by the paper's recipe."""
    information_floor: float = 0.05
    """Information never falls below this share of the commissioned one, 1/P(0)_ii: P_ii stays below P(0)_ii / share.
    0: P may grow for ever, as in the paper."""
    min_excitation: float = 0.05
    """Where psi' P psi stays below this share of its steady mean p (1 - lambda), nothing can be learned: theta, P and g
    wait.  0: never, as in the paper."""
    outlier_limit: float = 6.0
    """An innovation beyond this number of its standard deviations is an outlier; a few outliers are rejected.  0: no
    limit, as in the paper."""
    largest_error: float = 0.0
    """Largest innovation of the healthy records, but for the outliers among them, in the unit of the output.  0: not
    known."""
    joint_state: bool = False
    """The state moves with theta, as in the extended Kalman filter of both.  This allows memories far below the slowest
    time constant of the predictor.  False: as in the paper."""
    random_walk: bool = False
    """Parameters are independent random walks, P <- P + (1 - lambda) diag(P(0)), as in a Kalman filter.  Forgetting,
    P <- P / lambda, assumes instead that changes are most likely in the direction that is known least.  A single
    parameter is followed as fast; correlated ones scatter less.  P(0) is found with lambda."""
    covariance_reset: float = 0.0
    """After an alarm P_ii is at least this many times P(0)_ii, so that the changed parameter converges faster (the
    paper's remark on P(0) in change detection).  0: P stays."""
    unidentifiable: tuple[tuple[str, str], ...] = ()
    """Pairs of parameters that the record of the nominal values does not distinguish.  Then nothing is tested: the
    tests would alarm as soon as the axis moves differently."""
    run_on: bool = False
    """g runs on after an alarm, as in the paper's Figure 6, instead of restarting from zero."""

    @classmethod
    def paper(cls, interval_s: float, **changes: Any) -> "Settings":
        """Settings of the paper's simulated example: output error, no supervision of P, no outlier rejection.

        Raises:
            ValueError: a value outside its range.
        """
        own = {"information_floor": 0.0, "min_excitation": 0.0, "outlier_limit": 0.0}
        return cls(interval_s, **(own | changes))

    def __post_init__(self) -> None:
        ranges = {
            "interval_s": (self.interval_s, 0 < self.interval_s < math.inf),
            "lam": (self.lam, 0.5 <= self.lam < 1),
            "lam0": (self.lam0, 0 < self.lam0 < math.inf),
            "alpha1": (self.alpha1, 0 <= self.alpha1 < math.inf),
            "alpha2": (self.alpha2, 0 < self.alpha2 < math.inf),
            "thresholds": (self.thresholds, all(map(_usable, self.thresholds))),
            "delay_s": (self.delay_s, 0 <= self.delay_s <= self.interval_s),
            "max_gap_s": (self.max_gap_s, self.interval_s <= self.max_gap_s < math.inf),
            "settle_s": (self.settle_s, 0 <= self.settle_s < math.inf),
            "lost_s": (self.lost_s, 0 <= self.lost_s < math.inf),
            "speed_scale": (self.speed_scale, 0 < self.speed_scale < math.inf),
            "K": (self.K, all(math.isfinite(k) for k in self.K)),
            "K_after": (self.K_after, np.isfinite(np.array(self.K_after or 0.0)).all()),
            "information_floor": (self.information_floor, 0 <= self.information_floor <= 0.5),
            "min_excitation": (self.min_excitation, 0 <= self.min_excitation <= 0.5),
            "outlier_limit": (
                self.outlier_limit,
                self.outlier_limit == 0 or 3 <= self.outlier_limit < math.inf,
            ),
            "largest_error": (self.largest_error, 0 <= self.largest_error < math.inf),
            "covariance_reset": (self.covariance_reset, 0 <= self.covariance_reset <= 1e6),
            "model_error": (self.model_error, all(0 <= v < math.inf for v in self.model_error)),
            "P0": (self.P0, all(0 < v < math.inf for v in self.P0)),
        }
        for name, (value, good) in ranges.items():
            if not good:
                raise ValueError(f"{name} = {value} is out of range")

    @property
    def memory(self) -> float:
        """Memory length 1 / (1 - lambda), in samples."""
        return 1 / (1 - self.lam)

    @property
    def divisor(self) -> float:
        """Divisor of lambda_0 P that gives the covariance of the estimates: 1 + lambda; 2 for a random walk."""
        return 2.0 if self.random_walk else 1 + self.lam

    @property
    def seed_updates(self) -> int:
        """Length of the run that finds P(0): ten memory lengths, of which the second half is averaged."""
        return 0 if self.P0 else 2 * round(5 * self.memory)

    @property
    def span(self) -> int:
        """Number of updates between two applications of the information floor: a quarter of the memory."""
        return max(1, round(self.memory / 4))

    @property
    def naming_samples(self) -> int:
        """Samples to learn from the first crossing to the name, and from one evidence or reading to the next."""
        return round(NAMING_MEMORIES * self.memory)

    @property
    def least_outlier(self) -> float:
        """No smaller innovation is an outlier, in the unit of the output."""
        return PEAK * self.largest_error or self.outlier_limit * math.sqrt(self.lam0)

    @property
    def outlier_credit(self) -> float:
        """So many outliers in a row are passed over: those of a jolt."""
        return max(CREDIT, JOLT_S / self.interval_s)

    def tests(self, p: int) -> Floats:
        """alpha1, alpha2 and the allowance of each parameter (3, p).

        Raises:
            ValueError: the thresholds, or the model errors, are for another number of parameters.
        """
        own = self.thresholds or (Threshold(self.alpha1, self.alpha2),) * p
        if len(own) != p:
            raise ValueError(f"there are {len(own)} thresholds, {p} parameters are monitored")
        tests = np.array([threshold[:3] for threshold in own], float).reshape(p, 3).T
        # Healthy records show some of the model error, too: the larger one, not the sum.
        tests[2] = np.maximum(tests[2], self.model_errors(p))
        return tests

    def model_errors(self, p: int) -> Floats:
        """What the tests of each parameter (p,) allow for, as its nominal value follows a model, in sizes.

        Raises:
            ValueError: the model errors are for another number of parameters.
        """
        if not self.model_error:
            return np.zeros(p)
        if len(self.model_error) != p:
            raise ValueError(f"there are {len(self.model_error)} model errors, {p} parameters are monitored")
        return np.array([MODEL_ERRORS * error for error in self.model_error])

    def size_errors(self, p: int) -> Floats:
        """Standard deviation of what healthy estimates are off by beside their scatter, in sizes (p,)."""
        own = self.thresholds or (Threshold(self.alpha1, self.alpha2),) * p
        errors = self.model_errors(p) / MODEL_ERRORS
        return np.array(
            [
                math.hypot(max(t.allowance / ALLOWED, error), t.size_error)
                for t, error in zip(own, errors.tolist(), strict=True)
            ]
        )

    def gain(self, n: int) -> Floats:
        """K as a vector (n,).

        Raises:
            ValueError: K has another number of states.
        """
        if not self.K:
            return np.zeros(n)
        if len(self.K) != n:
            raise ValueError(f"K has {len(self.K)} entries, the drive {n} states")
        return np.array(self.K)

    def gains(self, n: int) -> Floats:
        """The gains after 0, 1, 2 .. intervals (GAINS, n).

        Raises:
            ValueError: another number of states, or of gains.
        """
        return _after(self.gain(n), self.K_after)


def _after(K: Floats, later: tuple[tuple[float, ...], ...]) -> Floats:
    """K (n,) and, after 0, 2, 3 .. intervals, ``later``: (GAINS, n)."""
    if not later:
        return np.tile(K, (GAINS, 1))
    after = np.array(later)
    if after.shape != (GAINS - 1, len(K)):
        raise ValueError(f"K_after has the shape {after.shape}: need {(GAINS - 1, len(K))}")
    return np.insert(after, 1, K, axis=0)


def _usable(threshold: Threshold) -> bool:
    return (
        0 <= threshold.alpha1 < math.inf
        and 0 < threshold.alpha2 < math.inf
        and 0 <= threshold.allowance < math.inf
        and 0 <= threshold.size_error < math.inf
    )
