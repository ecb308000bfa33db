"""Settings of the monitoring of an axis: predictor, forgetting, tests, gaps."""

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.kernel.outliers import CREDIT, JOLT_S, PEAK
from monitor_core.kernel.tables import GAINS

NAMING_MEMORIES = 3
"""Memory lengths after a change until its effect on all estimates is known."""

TOGETHER, DOUBTFUL = 0.95, 0.2
"""Limits for nominal values.  Two whose correlation is above the first cannot be distinguished.  One whose relative
standard deviation is above the second is doubtful: the change that the paper looks for is within one standard
deviation.  ``identify`` holds one parameter of such a pair; with both of them free the daemon would test nothing."""


MODEL_ERRORS = 2.0
"""Standard deviations of the model error of a nominal value that the tests allow for.  The model error is an upper
bound from its worst times: with three of them, 30 % more Coulomb friction of a warm axis was not always found."""

ALLOWED = 3.0
"""Standard deviations that the tests allow for, of the differences between healthy estimates beyond their scatter."""


class Threshold(NamedTuple):
    """The tests of one parameter: nu = alpha1 sqrt(lambda_0 P_ii) + allowance s_i,  h = alpha2 s_i, s_i its size.

    ``size_error``: standard deviation of the error of a healthy axis's estimate beyond what P tells, in s_i.
    """

    alpha1: float
    alpha2: float
    allowance: float = 0.0
    size_error: float = 0.0


@dataclass(frozen=True)
class Settings:
    """Settings of one axis.

    The defaults are recommended values, except for K, lam0, settle_s and lost_s.  These depend on the axis:
    ``recommended_settings`` computes them from the model and the noise.  ``Settings.paper`` has the paper's settings.

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
    """Standard deviation of the error of each nominal value that follows a model (as in a warm-up without a
    thermometer), in sizes s_i; empty: no error.  The allowance of its tests is at least ``MODEL_ERRORS`` times that."""
    K: tuple[float, ...] = ()
    """Filter gain of the innovations form, one number per state; empty is K = 0, the paper's output error."""
    K_after: tuple[tuple[float, ...], ...] = ()
    """Filter gains after 0, 2, 3 .. 11 intervals without a sample (drive/kalman.py); empty: always K."""
    delay_s: float = 0.0
    """Delay from the torque sample until the torque acts, at most one interval."""
    max_gap_s: float = 0.05
    """A longer interval between samples re-initialises the predictor."""
    settle_s: float = 1.0
    """No update of theta for this time [s] after a start of the predictor."""
    lost_s: float = 0.0
    """No update of theta for this time [s] after each lost sample except the first in a row, as the torque during the
    loss is unknown."""
    speed_scale: float = 1.0
    """Scale [rad/s] of the Coulomb friction tanh(speed / speed_scale), at the flange that the friction acts on."""
    P0: tuple[float, ...] = field(default=())
    """Diagonal of P(0); empty: found from the first samples by the paper's recipe."""
    information_floor: float = 0.05
    """Information never falls below this share of the commissioned one, 1/P(0)_ii: P_ii stays below P(0)_ii / share.
    0: P may grow for ever, as in the paper."""
    min_excitation: float = 0.05
    """While psi' P psi is below this share of its steady mean p (1 - lambda), theta, P and g are not updated.  0:
    always update, as in the paper."""
    outlier_limit: float = 6.0
    """An innovation beyond this number of its standard deviations is an outlier; a few in a row are rejected.  0: no
    limit, as in the paper."""
    largest_error: float = 0.0
    """Largest innovation of the healthy records, without their outliers, in the unit of the output.  0: not known."""
    joint_state: bool = False
    """The state is corrected together with theta, as in the extended Kalman filter for both.  This allows memories far
    below the slowest time constant of the predictor.  False: as in the paper."""
    covariance_reset: float = 0.0
    """After an alarm P_ii is at least this many times P(0)_ii, so that the changed parameter converges faster (the
    paper's remark on P(0) in change detection).  0: P stays."""
    unidentifiable: tuple[tuple[str, str], ...] = ()
    """Pairs of parameters that the record of the nominal values does not distinguish.  If there is one, no parameter is
    tested: the tests would alarm as soon as the axis moves differently."""
    run_on: bool = False
    """g continues after an alarm, as in the paper's Figure 6, instead of restarting from zero."""

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
            "thresholds": (self.thresholds, all(map(_is_in_range, self.thresholds))),
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
        """Divisor of lambda_0 P that gives the covariance of the estimates."""
        return 1 + self.lam

    @property
    def seed_updates(self) -> int:
        """Number of updates that find P(0): ten memory lengths.  P is averaged over the second half of them."""
        return 0 if self.P0 else 2 * round(5 * self.memory)

    @property
    def span(self) -> int:
        """Number of updates between two applications of the information floor: a quarter of the memory."""
        return max(1, round(self.memory / 4))

    @property
    def naming_samples(self) -> int:
        """Updates between the first crossing and the name of a change, and between two readings of the estimates."""
        return round(NAMING_MEMORIES * self.memory)

    @property
    def least_outlier(self) -> float:
        """Smallest innovation that counts as an outlier, in the unit of the output."""
        return PEAK * self.largest_error or self.outlier_limit * math.sqrt(self.lam0)

    @property
    def outlier_credit(self) -> float:
        """Number of outliers in a row that are rejected: those of a jolt."""
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
        """Allowance of the tests (p,) for the model errors of the nominal values, in sizes s_i.

        Raises:
            ValueError: the model errors are for another number of parameters.
        """
        if not self.model_error:
            return np.zeros(p)
        if len(self.model_error) != p:
            raise ValueError(f"there are {len(self.model_error)} model errors, {p} parameters are monitored")
        return np.array([MODEL_ERRORS * error for error in self.model_error])

    def size_errors(self, p: int) -> Floats:
        """Standard deviation of the errors of healthy estimates beyond their scatter, in sizes s_i (p,)."""
        own = self.thresholds or (Threshold(self.alpha1, self.alpha2),) * p
        errors = self.model_errors(p) / MODEL_ERRORS
        # All three are seen in the same healthy records: the largest counts, not their sum.
        return np.array(
            [max(t.allowance / ALLOWED, error, t.size_error) for t, error in zip(own, errors.tolist(), strict=True)]
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
        """Filter gains after 0, 1, 2 .. intervals without a sample (GAINS, n).

        Raises:
            ValueError: the number of states, or of gains, does not fit.
        """
        K, later = self.gain(n), np.array(self.K_after)
        if not self.K_after:
            return np.tile(K, (GAINS, 1))
        if later.shape != (GAINS - 1, n):
            raise ValueError(f"K_after has the shape {later.shape}: need {(GAINS - 1, n)}")
        return np.insert(later, 1, K, axis=0)  # K is for one interval


def _is_in_range(threshold: Threshold) -> bool:
    may_be_zero = (threshold.alpha1, threshold.allowance, threshold.size_error)
    return 0 < threshold.alpha2 < math.inf and all(0 <= value < math.inf for value in may_be_zero)
