"""The search for a warm-up in records: sums over short windows, and least squares for each time constant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, minimize
from scipy.special import chdtrc  # not scipy.stats: to import that takes seconds

from monitor_core.arrays import Floats
from monitor_core.drive.measured_speed import MeasuredSpeed
from monitor_core.drive.thermal_state import ThermalModel, ThermalStart
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.greybox.criterion import fit_starts
from monitor_core.identification.predictor.prediction_errors import Predictor
from monitor_core.identification.records.measured_record import Record

WINDOW_S = 10.0
LEAST_FALL = 0.04
"""Of its value: friction that changes by less from the least to the largest heat follows nothing."""
_CHANCE = 1e-4
"""Probability of slopes like those found, if nothing followed the heat."""
_SHOWN = 1.0
"""Standard deviations: of two slopes, one that is smaller is left out."""
_TAUS = 18
_SHORTEST_S, _LONGEST = 60.0, 2.0
"""Time constants that are tried; the longest in lengths of the records."""
GROUP = 6
"""Windows in a row whose errors may be correlated."""
_RIDGE = 1e-9


class Windows(NamedTuple):
    """Sums over the windows (W) of one record."""

    middle_s: Floats  # (W,) since its first sample
    power: Floats  # (W,) mean friction power, W
    information: Floats  # (W, p, p) sums of psi psi'
    score: Floats  # (W, p) sums of psi eps


def speeds_of(record: Record) -> tuple[Floats, Floats]:
    """Speeds (N,) and the intervals [s] that they are of."""
    t_us = np.rint(record.t * 1e6).astype(np.int64)
    steps = MeasuredSpeed(record.quantity).take(t_us, record.y)
    speed: Floats = np.where(np.isfinite(steps.speed), steps.speed, 0.0)
    return speed, np.asarray(steps.interval_us * 1e-6, np.float64)


def windows_of(
    found: Estimate, records: Sequence[Record], unit: ThermalModel
) -> tuple[list[str], list[Windows]]:
    """Names of what psi is of, and the windows of each record; power by the friction of ``unit``.

    Raises:
        ValueError: the errors of a record are zero or not finite, or a parameter is.
    """
    problem = found.problem
    predictor = Predictor(problem, records, problem.disturbance)
    xi = fit_starts(predictor)
    p = len(predictor.layout.names)
    rates = predictor.layout.rates(xi)[:p]
    out = list[Windows]()
    for record, errors in zip(records, predictor.errors(xi), strict=True):
        since = record.t - record.t[0]
        which = (since // WINDOW_S).astype(np.int64)
        count = int(which[-1]) + 1
        edges = np.searchsorted(which, np.arange(count + 1))
        # Records that the drive explains less well count less.
        level = math.sqrt(float(np.mean(errors.eps**2)))
        if not (0 < level < math.inf and np.isfinite(rates).all() and rates.all()):
            raise ValueError(f"{record.name or 'record'}: no errors to compare")
        psi, eps = errors.psi[:, :p] / (rates * level), errors.eps / level
        speed, h = speeds_of(record)
        energy = np.bincount(which, unit.power(speed) * h, count)
        parts = [slice(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)]
        out.append(
            Windows(
                np.asarray((np.arange(count) + 0.5) * WINDOW_S, np.float64),
                energy / WINDOW_S,
                np.array([psi[part].T @ psi[part] for part in parts]),
                np.array([psi[part].T @ eps[part] for part in parts]),
            )
        )
    return list(predictor.layout.names), out


# --- The search -------------------------------------------------------------------------------------------------------


def heat_course(power: Floats, start: float, tau_s: float) -> tuple[Floats, float]:
    """Heat [W] in the middle of each window (W,), and after the last one, from that at the start."""
    a, half = math.exp(-WINDOW_S / tau_s), math.exp(-WINDOW_S / 2 / tau_s)
    now, course = start, np.empty(power.size)
    for j, p in enumerate(power.tolist()):
        course[j] = half * now + (1 - half) * p
        now = a * now + (1 - a) * p
    return course, now


class WarmUpFit(NamedTuple):
    """The best for these followers."""

    tau_s: float
    starts: Floats  # (R,)
    heats: list[Floats]  # of each record (W,)
    which: list[int]
    constants: Floats
    """(p,) of all parameters, at the mean of the heats"""
    slopes: Floats
    sd: Floats
    covariance: Floats
    cost: float

    @property
    def chance(self) -> float:
        """Probability of such slopes if nothing followed; a time constant was chosen for them, too."""
        wald = float(self.slopes @ np.linalg.solve(self.covariance, self.slopes))
        return float(chdtrc(len(self.which) + 1, wald))


class Search:
    """Least squares over c and s for each time constant and each free heat at a start."""

    def __init__(
        self,
        windows: Sequence[Windows],
        index: list[int],
        carried: Sequence[float | None],
        start: ThermalStart,
    ) -> None:
        self.windows, self.index, self._carried = windows, index, carried
        self.free = [k for k, pause in enumerate(carried) if pause is None and (k > 0 or start == "unknown")]
        self._information = np.concatenate([w.information for w in windows])
        self._score = np.concatenate([w.score for w in windows])
        p = self._score.shape[1]
        total = np.sqrt(np.maximum(np.einsum("wii->i", self._information), 1e-300))
        self._size = 1 / total
        self._information = self._information * self._size[:, np.newaxis] * self._size
        self._score = self._score * self._size
        self._p = p
        means = [float(w.power.mean()) for w in windows]
        self.highest = 1.5 * max(means)
        self.seconds = WINDOW_S * sum(w.power.size for w in windows)

    def heats(self, tau_s: float, free: Floats) -> tuple[list[Floats], Floats]:
        """Heat in the windows of each record, and at its first sample."""
        out, starts, now = list[Floats](), np.zeros(len(self.windows)), 0.0
        given = dict(zip(self.free, free.tolist(), strict=True))
        for k, w in enumerate(self.windows):
            pause = self._carried[k]
            now = given.get(k, 0.0) if pause is None else now * math.exp(-pause / tau_s)
            starts[k] = now
            course, now = heat_course(w.power, now, tau_s)
            out.append(course)
        return out, starts

    def solve(self, heats: list[Floats], index: list[int]) -> tuple[Floats, Floats, float]:
        """c and s (p + f,), in scaled units, the inverse of their information, and the cost above the fit's."""
        heat = np.concatenate(heats)
        heat = heat - heat.mean()
        I, b, p = self._information, self._score, self._p
        f = len(index)
        N, r = np.zeros((p + f, p + f)), np.zeros(p + f)
        N[:p, :p], r[:p] = I.sum(axis=0), b.sum(axis=0)
        once, twice = np.tensordot(heat, I, 1), np.tensordot(heat**2, I, 1)
        N[:p, p:] = once[:, index]
        N[p:, :p] = N[:p, p:].T
        N[p:, p:] = twice[np.ix_(index, index)]
        r[p:] = (heat @ b)[index]
        inverse = np.asarray(np.linalg.inv(N + _RIDGE * np.diag(np.diag(N))), np.float64)
        beta: Floats = np.asarray(inverse @ r, np.float64)
        return beta, inverse, -float(r @ beta)

    def best(self, index: list[int]) -> WarmUpFit:
        """The best time constant and starts for these followers."""
        free = np.full(len(self.free), 0.5 * self.highest)

        def cost(tau_s: float, starts: Floats) -> float:
            return self.solve(self.heats(tau_s, starts)[0], index)[2]

        def at(tau_s: float, starts: Floats) -> tuple[float, Floats]:
            if not self.free:
                return cost(tau_s, starts), starts
            scale = max(abs(cost(tau_s, starts)), 1e-300)

            def relative(x: Floats) -> float:
                return cost(tau_s, x * self.highest) / scale

            bounds = Bounds(np.zeros(starts.size), np.ones(starts.size))
            run = minimize(relative, starts / self.highest, method="L-BFGS-B", bounds=bounds)
            return float(run.fun) * scale, np.asarray(run.x * self.highest)

        taus = np.geomspace(_SHORTEST_S, max(_LONGEST * self.seconds, 2 * _SHORTEST_S), _TAUS)
        tried = []
        for tau in taus.tolist():
            value, free = at(tau, free)
            tried.append((value, tau, free))
        _, tau, free = min(tried, key=lambda candidate: candidate[0])
        step = math.log(taus[1] / taus[0])
        while step > 0.01:
            step /= 2
            near = [(*at(tau * math.exp(s), free), tau * math.exp(s)) for s in (-step, 0.0, step)]
            _, free, tau = min(near, key=lambda candidate: candidate[0])
        return self._fit(tau, free, index)

    def _fit(self, tau_s: float, free: Floats, index: list[int]) -> WarmUpFit:
        heats, starts = self.heats(tau_s, free)
        beta, inverse, cost = self.solve(heats, index)
        p, heat = self._p, np.concatenate(heats)
        heat = heat - heat.mean()
        left = _left(self._information, self._score, heat, beta[:p], index, beta[p:])
        g = np.concatenate([left, heat[:, np.newaxis] * left[:, index]], axis=1)
        groups = np.add.reduceat(g, np.arange(0, len(g), GROUP), axis=0)
        covariance = (inverse @ (groups.T @ groups) @ inverse)[p:, p:]
        size = self._size[index]
        covariance = covariance * size[:, np.newaxis] * size
        covariance += 1e-12 * np.diag(np.diag(covariance))
        sd = np.sqrt(np.diag(covariance))
        constants = beta[:p] * self._size
        return WarmUpFit(tau_s, starts, heats, index, constants, beta[p:] * size, sd, covariance, cost)


def _left(
    information: Floats, score: Floats, heat: Floats, constants: Floats, index: list[int], slopes: Floats
) -> Floats:
    """Scores of windows (W, p) less what constants (p,) and slopes over the heat (W,) explain."""
    delta = np.repeat(constants[np.newaxis], heat.size, axis=0)
    delta[:, index] += heat[:, np.newaxis] * slopes
    return np.asarray(score - np.einsum("wij,wj->wi", information, delta))


def left_of(windows: Sequence[Windows], fit: WarmUpFit) -> list[Floats]:
    """Scores of the windows (W, p) of each record less what a fit explains."""
    mean = float(np.concatenate(fit.heats).mean())
    return [
        _left(w.information, w.score, heat - mean, fit.constants, fit.which, fit.slopes)
        for w, heat in zip(windows, fit.heats, strict=True)
    ]


def chosen(search: Search, values: Sequence[float]) -> WarmUpFit | None:
    """The fit with the followers that the records show; None: none."""
    value = dict(zip(search.index, values, strict=True))
    fit = search.best(search.index)
    shown = [i for i, s, sd in zip(fit.which, fit.slopes, fit.sd, strict=True) if abs(s) > _SHOWN * sd]
    if not shown:
        # Two that go together: each one alone stands for both.
        shown = [min(fit.which, key=lambda i: search.best([i]).cost)]
    if shown != fit.which:
        fit = search.best(shown)
    heat = np.concatenate(fit.heats)
    reach = float(np.ptp(heat))
    falls = [abs(s) * reach / max(abs(value[i]), 1e-300) for i, s in zip(fit.which, fit.slopes, strict=True)]
    if fit.chance > _CHANCE or max(falls) < LEAST_FALL:
        return None
    return fit
