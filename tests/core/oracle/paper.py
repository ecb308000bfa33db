"""The paper, transcribed: one axis, a sample at a time, numpy and the exponential of the whole system.

Slow and plain on purpose, and without a line in common with the kernel.  Equation numbers are the paper's.
Innovations form, friction, offset, torque delay and the rules for gaps as in the documentation of Settings.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.friction_roles import rigid_speeds
from monitor_core.drive.kalman import stable_limits
from monitor_core.drive.structure import DELAY
from monitor_core.kernel.tables import GAINS, TORQUE
from monitor_core.settings import Settings
from tests.core.oracle.system import (
    LOST,
    STEP,
    Array,
    Interval,
    Matrices,
    derivatives,
    held_over,
    inputs,
    with_friction,
)


@dataclass
class Log:
    """What happened at each sample; NaN where there was no update, of yhat where there was no prediction."""

    eps: list[float] = field(default_factory=list)
    yhat: list[float] = field(default_factory=list)
    psi: list[Array] = field(default_factory=list)
    theta: list[Array] = field(default_factory=list)
    P: list[Array] = field(default_factory=list)
    g: list[Array] = field(default_factory=list)
    alarms: list[tuple[int, int, int, int]] = field(default_factory=list)  # way, parameter, time, onset


class Paper:
    """Recursive identification and CUSUM of one axis."""

    def __init__(self, model: AxisModel, s: Settings, P_start: Array | None = None) -> None:
        self.model, self.s = model, s
        self.matrices = Matrices(model)
        n, p, m = len(model.drive.states), len(model.theta0), len(model.drive.inputs)
        self.theta, self.limits = model.theta0.copy(), stable_limits(model, s.gain(n), s.interval_s)
        self.P = np.diag(s.P0) if P_start is None else P_start.copy()
        self.x, self.z = np.zeros(n), np.zeros((p, n))
        self.u, self.du = np.zeros(m), np.zeros((p, m))
        self.torque = self.torque_before = self.y = 0.0
        self.g = np.zeros((2, p))
        self.onset = np.zeros((2, p), dtype=np.int64)
        self.t: int | None = None
        self.settled = 0
        self.diagonals: list[Array] = []  # of the run that finds P(0)
        self.P_nom = np.array(s.P0) if s.P0 else np.zeros(p)
        self.plenty, self.since = 1.0, 0
        self.unseen = np.zeros(p, dtype=bool)
        self.looks = self.starved_samples = 0
        self.starved = False
        self.running, self.credit, self.in_a_row, self.jolt = s.lam0, 3.0, 0, 0
        self.outliers = self.starts = 0
        self.yhat = math.nan
        self.log = Log()

    def run(self, t_us: NDArray[np.int64], u: Array, y: Array) -> Log:
        for sample in zip(t_us, u, y, strict=True):
            self._sample(int(sample[0]), *(float(v) for v in sample[1:]))
        return self.log

    def _sample(self, t: int, u: float, y: float) -> None:
        eps, psi = math.nan, np.full(len(self.theta), math.nan)
        self.yhat = math.nan
        gap = round(self.s.max_gap_s * 1e6)
        unusable = not (math.isfinite(u) and math.isfinite(y))
        repeated = self.t is not None and self.t - gap <= t <= self.t
        if not unusable and not repeated:
            if self.t is None or t < self.t or t - self.t > gap:
                self._restart(t, u, y)
            else:
                eps, psi = self._move(t, u, y)
        self.log.eps.append(eps)
        self.log.yhat.append(self.yhat)
        self.log.psi.append(psi)
        self.log.theta.append(self.theta.copy())
        self.log.P.append(self.P.copy())
        self.log.g.append(self.g.copy())

    def _restart(self, t: int, u: float, y: float) -> None:
        self.x = self.model.drive.matrix("rest", self.model.nominal)[:, 0] * y
        self.z[:] = 0.0
        self.starts += 1
        self.t, self.settled = t, t + round(self.s.settle_s * 1e6)
        self._hold(u, y)
        self.torque_before = u

    def _hold(self, u: float, y: float) -> None:
        """Inputs from this sample on; friction follows from how long they are held."""
        self.torque_before, self.torque, self.y = self.torque, u, y
        self.u = inputs(self.model, u, y)

    def _rub(self, h: float, delay: float) -> None:
        """Friction of the interval, and its derivatives by the complex step: of theta, and of x with it."""

        if not self.matrices.rubs.any():
            return

        def inputs_at(theta: NDArray[Any], x: NDArray[Any], delay: Any) -> NDArray[Any]:
            during = Interval(h, delay, self.torque_before)
            return with_friction(self.matrices, self.s, theta, self.u, self.y, x, during)

        late = self.model.monitored.index(DELAY) if DELAY in self.model.monitored else -1
        for i, z in enumerate(self.z):
            step = 1j * STEP * max(1.0, abs(self.theta[i]))
            theta = self.theta + step * np.eye(len(self.theta))[i]
            moved = inputs_at(theta, self.x + step * z, delay + (step if i == late else 0))
            self.du[i] = np.imag(moved) / abs(step)
        self.u = inputs_at(self.theta, self.x, delay)

    def _move(self, t: int, u: float, y: float) -> tuple[float, Array]:
        assert self.t is not None
        h = (t - self.t) * 1e-6
        lost = h / self.s.interval_s - 2
        if lost > 0.5:
            self.settled = max(self.settled, t + int(lost * round(self.s.lost_s * 1e6)))
        monitored = self.model.monitored
        delay = self.theta[monitored.index(DELAY)] if DELAY in monitored else self.s.delay_s
        late, mean = min(max(delay, 0.0), h), self.model.drive.mean_state
        self.lam = self.s.lam ** (h / self.s.interval_s)
        self.A, self.B, C = self.matrices.at(self.theta)
        self.dA, self.dB, dC = derivatives(self.matrices, self.theta)
        self._rub(h, delay)
        self._propagate(late, self.torque_before)
        if DELAY in monitored:
            self._step_of_torque(min(delay, 0.0), monitored.index(DELAY))
        rest, over = h - late, 1.0
        if mean >= 0:
            rest, over = self._to_its_own_interval(h, rest)
        self._propagate(rest, self.torque)
        row, slopes = C[0] / over, [d[0] / over for d in dC]
        self.yhat = float(row @ self.x)
        eps = y - self.yhat  # (11)
        psi = np.array([row @ z + slope @ self.x for z, slope in zip(self.z, slopes, strict=True)])  # (16)
        self.t = t
        since = 0 if self.jolt else self.in_a_row  # passed over, so that x went on
        K = self._gain(h + since * self.s.interval_s, self.s.K, self.s.K_after)
        used = t >= self.settled and not self._starves(psi)
        if t >= self.settled and not used:
            self.unseen[:], self.starved = True, True
        known = self._expected(psi)
        out, pass_over, believed = self._sift(eps, known)
        if self._began_wrong(t, out):
            settled = self.settled
            self._restart(t, u, y)
            self.settled = settled
            self.yhat = math.nan
            return math.nan, psi
        used = used and not pass_over
        corrects = not out or self.jolt > 0
        if self._tells_the_speed(t, h):
            speeds = rigid_speeds(self.model.drive, self.model.nominal)
            K = self.model.drive.matrix("rest", self.model.nominal)[:, 0] + speeds / h
            corrects, self.in_a_row, self.jolt = True, 0, 0
        before = self.theta.copy()
        if used:
            self._update(believed, psi)
            self._follow_variance(eps, known)
            self._judge()
        moved = self.theta - before
        if corrects:
            self.x = self.x + K * eps
            self.z = self.z - np.outer(psi, K)
        if used and self.s.joint_state:
            self.x = self.x + moved @ self.z
        if mean >= 0:
            self.x[mean], self.z[:, mean] = 0.0, 0.0
        self._hold(u, y)
        return (eps, psi) if used else (math.nan, psi)

    def _gain(self, h: float, K: tuple[float, ...], after: tuple[tuple[float, ...], ...]) -> Array:
        """K after an interval, between those after 0, 1, 2 .. intervals."""
        known = [after[0], K, *after[1:]] if after else [K or (0.0,) * len(self.x)] * GAINS
        at = h / self.s.interval_s
        return np.array([np.interp(at, np.arange(GAINS), gain) for gain in np.array(known).T])

    def _to_its_own_interval(self, h: float, rest: float) -> tuple[float, float]:
        """What the drive averages a speed over begins so long before its end, after lost samples; else with h."""
        if h <= LOST * self.s.interval_s:
            return rest, h
        own, mean = min(rest, self.s.interval_s), self.model.drive.mean_state
        self._propagate(rest - own, self.torque)
        self.x[mean], self.z[:, mean] = 0.0, 0.0
        return own, own

    def _propagate(self, h: float, torque: float) -> None:
        """The extended system (18-19), all of it: w = (z_1 .. z_p, x)."""
        if h == 0:  # the exponential is the unit matrix
            return
        n, p = len(self.x), len(self.theta)
        u = np.where(np.array(self.model.drive.inputs) == TORQUE, torque, self.u)
        F, f = np.kron(np.eye(p + 1), self.A), np.zeros((p + 1, n))
        for i in range(p):
            F[i * n : (i + 1) * n, p * n :] = self.dA[i]
            f[i] = self.dB[i] @ u + self.B @ self.du[i]
        f[p] = self.B @ u
        w = held_over(F, f.ravel(), np.append(self.z.ravel(), self.x), h)
        self.z, self.x = w[: p * n].reshape(p, n), w[p * n :]

    def _step_of_torque(self, ahead: float, late: int) -> None:
        """What the torque's step does to x where it came ahead of its sample, and d/d(delay) of it anyway."""
        step = (self.torque_before - self.torque) * np.array([k == TORQUE for k in self.model.drive.inputs])
        self.x = self.x + ahead * self.B @ step
        self.z = self.z + ahead * np.array([d @ step for d in self.dB])
        self.z[late] += self.B @ step

    def _update(self, eps: float, psi: Array) -> None:
        S = self.lam + psi @ self.P @ psi
        L = self.P @ psi / S  # (12)
        self.P = (self.P - np.outer(self.P @ psi, psi @ self.P) / S) / self.lam  # (13)
        if not self.seeding:
            step = np.where(self.unseen, 0.0, L * eps)
            self.theta = np.clip(self.theta + step, *self.limits)

    @property
    def seeding(self) -> bool:
        """P(0) is still being found."""
        return len(self.diagonals) < self.s.seed_updates

    def _judge(self) -> None:
        """Once a sample, after the update."""
        if self.seeding:
            self._seed()
            return
        if self.s.information_floor or self.s.min_excitation:
            self._look()
        self._cusum()

    def _starves(self, psi: Array) -> bool:
        """Running mean, over a tenth of the memory, of psi' P psi beside its steady mean p (1 - lambda)."""
        share = min(float(psi @ self.P @ psi) / (len(psi) * (1 - self.s.lam)), 1.0)
        if self.s.min_excitation:
            self.plenty += min(10 * (1 - self.s.lam), 1.0) * (share - self.plenty)
        self.starved_samples += self.plenty < self.s.min_excitation
        return bool(self.plenty < self.s.min_excitation)

    def _expected(self, psi: Array) -> float:
        """Var eps over lambda_0: 1 + psi' P psi / (1 + lambda)."""
        return float(1 + psi @ self.P @ psi / (1 + self.lam))

    def _sift(self, eps: float, known: float) -> tuple[bool, bool, float]:
        """Whether it is an outlier, whether it is passed over, what is believed.

        Passed over: a lone one, or a jolt, from the third in a row to a tenth of a second after the last one, and no
        more than one in fifty and those of one second.
        """
        if self.s.outlier_limit == 0:
            return False, False, eps
        least = 1.5 * self.s.largest_error or self.s.outlier_limit * math.sqrt(self.s.lam0)
        limit = max(self.s.outlier_limit * math.sqrt(self.running), least) * math.sqrt(known)
        out, most = abs(eps) > limit, max(3.0, 1 / self.s.interval_s)
        self.in_a_row = self.in_a_row + 1 if out else 0
        if out and (self.jolt or self.in_a_row >= 3):
            self.jolt = 1 + int(0.1 * most)
        else:
            self.jolt = max(self.jolt - 1, 0)
        self.credit = min(self.credit + 0.02, most)
        settled = self.t is not None and self.t >= self.settled
        pass_over = settled and (out or self.jolt > 0) and self.credit >= 1
        self.credit -= pass_over
        self.outliers += pass_over
        return out, pass_over, float(np.clip(eps, -limit, limit))

    def _tells_the_speed(self, t: int, h: float) -> bool:
        """One of the three samples after a start, of an angle."""
        start = self.settled - self.s.settle_s * 1e6
        return self.model.drive.output == "angle" and t < self.settled and t - start <= 3.5e6 * h

    def _began_wrong(self, t: int, out: bool) -> bool:
        """The three samples after a start are all outliers: the first one was."""
        start = self.settled - self.s.settle_s * 1e6
        early = t < self.settled and t - start <= 3.5e6 * self.s.interval_s
        return out and self.in_a_row >= 3 and early

    def _follow_variance(self, eps: float, known: float) -> None:
        """lambda_0, over ten memories; a square counts as nine times the mean at most (Huber's proposal 2)."""
        weight = (1 - self.s.lam) / 10
        consistent = 0.99501  # the mean of min(z^2, 9)
        self.running += weight * (min(eps**2 / known, 9 * self.running) / consistent - self.running)

    def _look(self) -> None:
        """Once in a span, floor / P(0)_ii more information, by two inversions; then what is observed."""
        self.since += 1
        if self.since >= (self.s.span // 4 if self.starved else self.s.span):
            more = (self.s.lam**-self.since - 1) * self.s.information_floor
            self.since, self.looks = 0, self.looks + 1
            self.P = np.linalg.inv(np.linalg.inv(self.P) + np.diag(more / self.P_nom))
            size = np.sqrt(self.P_nom)
            values, vectors = np.linalg.eigh(self.P / np.outer(size, size))
            lost = vectors[:, values > 10]
            self.starved = lost.size > 0
            ratio = np.diag(self.P) / self.P_nom
            self.unseen = (ratio > 10) | (self.unseen & (ratio > 6))
            moves = abs(lost) * (size / self.model.scale)[:, np.newaxis]
            self.unseen |= (moves > 0.3 * moves.max(axis=0, initial=0.0)).any(axis=1)

    def _seed(self) -> None:
        """P(0): theta stays nominal while P settles; the average of the steady half of its diagonal."""
        self.diagonals.append(np.diag(self.P))
        if len(self.diagonals) == self.s.seed_updates:
            self.P_nom = np.mean(self.diagonals[self.s.seed_updates // 2 :], axis=0)
            vague = (1 + self.s.lam) * self.model.scale**2 / self.s.lam0
            if self.s.min_excitation and (self.P_nom > vague).any():
                self.diagonals, self.P_nom = [], vague
            self.P = np.diag(self.P_nom)

    def _cusum(self) -> None:
        """(21-23), both directions; after an alarm from zero again."""
        assert self.t is not None
        d = self.theta - self.model.theta0
        alpha1, alpha2, allowance = self.s.tests(len(d))
        nu = alpha1 * np.sqrt(self.s.lam0 * np.diag(self.P)) + allowance * self.model.scale
        for way, sign in enumerate((1, -1)):
            for i in np.flatnonzero(~self.unseen).tolist():
                self.g[way, i] = max(0.0, self.g[way, i] + sign * d[i] - nu[i])
                if self.g[way, i] == 0:
                    self.onset[way, i] = self.t
                if self.g[way, i] > alpha2[i] * self.model.scale[i]:
                    self.log.alarms.append((way, i, self.t, int(self.onset[way, i])))
                    self.P[i, i] = max(self.P[i, i], self.s.covariance_reset * self.P_nom[i])
                    if not self.s.run_on:
                        self.g[way, i], self.onset[way, i] = 0.0, self.t
