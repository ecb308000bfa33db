"""The search for a warm-up in records, by least squares over short windows for each time constant.

No model is exact, so its friction seems to vary a little with the speed.  The heat of the last minutes is correlated
with the present speed, so part of that variation would look like a warm-up.  Therefore each friction may also follow
the present power, window by window, and the heat must explain more than that.

A gearbox has more than one time constant.  A record that begins cold shows only roughly how they differ.  So a second
one is tried in a few proportions to the first, and is used if it explains more than chance would.

The hall may be colder or warmer in another record: each record after the first may have an ambient heat, if that
explains more than chance would.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, minimize
from scipy.special import fdtrc  # not scipy.stats: to import that takes seconds

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.thermal_state import Fast, ThermalModel, ThermalStart
from monitor_core.identification.thermal.warm_up_windows import WINDOW_S, Windows


class HeatProportions(NamedTuple):
    """Proportions of two time constants."""

    ratio: float = 1.0
    """Slower time constant over the faster one; 1: there is only one"""
    share: float = 0.0
    """Share of the faster part in the heat"""

    def fast(self, tau_s: float) -> Fast | None:
        """The faster part beside a slower time constant [s]."""
        return Fast(tau_s / self.ratio, self.share) if self.ratio > 1 else None


ONE = HeatProportions()
LEAST_FALL = 0.04
"""Friction follows the heat only if it changes by at least this share from the smallest to the largest heat."""
_CHANCE = 1e-4
"""Probability of a slope like that found, if nothing followed the heat."""
_CHANCE_BESIDE = 1e-3
"""The same for a further friction parameter, as it is then known that the axis warms up."""
_TAUS = 18
_SHORTEST_S, _LONGEST = 60.0, 2.0
"""Time constants that are tried; the longest in lengths of the records."""
GROUP = 6
"""Number of windows in a row whose errors may be correlated."""
_FEWEST_GROUPS, _SMALLEST_GROUP = 10, 2
"""Groups are smaller where they would be fewer."""
_SHAPES = tuple(HeatProportions(ratio, share) for ratio in (3.0, 6.0, 12.0) for share in (0.25, 0.5, 0.75))
"""Proportions of two time constants that are tried"""
_SHOWS_TWO = 20.0
"""Two time constants must reduce the squared errors by so many variances; they take 3 more parameters."""
_SHOWS_HALL = 20.0
"""The ambient heat of each record must reduce them by as much on average."""
_SHORTEST_FAST_S = 30.0
_TERMS = 3
"""Terms fitted to the groups for each parameter: a constant, one proportional to the power, one following the heat"""
_RIDGE = 1e-9


def kept_by(model: ThermalModel, seconds: Floats) -> Floats:
    """Share of the heat that is left after times (N,) without motion."""
    return np.asarray(sum(share * np.exp(-seconds / tau_s) for tau_s, share in model.parts))


def heat_course(power: Floats, start: float, tau_s: float) -> tuple[Floats, float]:
    """Heat [W] of one part in the middle of each window (W,), and after the last one, from that at the start."""
    a, half = math.exp(-WINDOW_S / tau_s), math.exp(-WINDOW_S / 2 / tau_s)
    now, course = start, np.empty(power.size)
    for j, p in enumerate(power.tolist()):
        course[j] = half * now + (1 - half) * p
        now = a * now + (1 - a) * p
    return course, now


class WarmUpFit(NamedTuple):
    """The best for these followers."""

    model: ThermalModel
    """Time constants; the friction for the power is that of the windows"""
    shape: HeatProportions
    starts: list[tuple[float, ...]]
    """Heat of each part at the first sample of each record"""
    ambients: list[float]
    """Ambient heat of each record, relative to that of the first; all are 0 if the records do not show it"""
    heats: list[Floats]  # of each record (W,)
    which: list[int]
    constants: Floats
    """(p,) of all parameters, at the mean of the heats"""
    slopes: Floats
    sd: Floats
    groups: int
    """Number of groups of windows, whose scatter gives the standard deviations"""
    cost: float
    variance: float
    """Variance of the errors by the scatter of the groups, over that of uncorrelated errors"""

    @property
    def chance(self) -> float:
        """Probability of such a slope of the last follower if it did not follow.

        For the first one, a time constant was chosen, too.  A few groups may agree by chance: the F distribution.
        """
        freedom = self.groups - _TERMS
        if freedom < 1:
            return 1.0
        chosen_for_it = 2 if len(self.which) == 1 else 1
        wald = float(self.slopes[-1] / self.sd[-1]) ** 2 * freedom / self.groups
        return float(fdtrc(chosen_for_it, freedom, wald / chosen_for_it))


class Search:
    """Least squares over c and s for each time constant, each free heat at a start, and each free ambient heat.

    ``halls``: whether each record after the first has an ambient heat of its own.
    """

    def __init__(
        self,
        windows: Sequence[Windows],
        index: list[int],
        carried: Sequence[float | None],
        start: ThermalStart,
        halls: bool = False,
    ) -> None:
        self.windows, self.index, self.carried, self.start = windows, index, carried, start
        self.halls = halls and len(windows) > 1
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
        power = np.concatenate([w.power for w in windows])
        self._power: Floats = power - power.mean()
        self._once = np.tensordot(self._power, self._information, 1)[:, index]
        self._twice = np.tensordot(self._power**2, self._information, 1)[np.ix_(index, index)]
        self.highest = 1.5 * max(means)
        self.seconds = WINDOW_S * sum(w.power.size for w in windows)

    def seeing(self, seen: Sequence[Bools]) -> Search:
        """The search restricted to these windows (W,) of each record."""
        masked = [
            w._replace(information=w.information * by[:, np.newaxis, np.newaxis], score=w.score * by[:, np.newaxis])
            for w, by in zip(self.windows, seen, strict=True)
        ]
        return Search(masked, self.index, self.carried, self.start, self.halls)

    def with_halls(self) -> Search:
        """The search in which each record after the first has an ambient heat of its own."""
        return Search(self.windows, self.index, self.carried, self.start, True)

    def ambients(self, free: Floats) -> list[float]:
        """Ambient heat of each record."""
        found: list[float] = free[len(self.free) :].tolist()
        return [0.0, *found] if self.halls else [0.0] * len(self.windows)

    def heats(self, model: ThermalModel, free: Floats) -> tuple[list[Floats], list[tuple[float, ...]]]:
        """Heat in the windows of each record, and that of each part at its first sample.

        ``free``: the free heats at starts, then the free ambient heats.
        """
        out, starts, now = list[Floats](), list[tuple[float, ...]](), (0.0,) * len(model.parts)
        given = dict(zip(self.free, free.tolist(), strict=False))
        for k, (w, ambient) in enumerate(zip(self.windows, self.ambients(free), strict=True)):
            pause = self.carried[k]
            now = (given.get(k, 0.0),) * len(now) if pause is None else model.cooled(now, pause)
            starts.append(now)
            courses = [heat_course(w.power, start, tau_s) for start, (tau_s, _) in zip(now, model.parts, strict=True)]
            now = tuple(last for _, last in courses)
            parts = zip(courses, model.parts, strict=True)
            out.append(np.asarray(ambient + sum(share * course for (course, _), (_, share) in parts)))
        return out, starts

    def solve(self, heats: list[Floats], index: list[int]) -> tuple[Floats, Floats, float]:
        """c, s and the slopes over the power (p + f + all followers,), the inverse of their information, and the cost.

        In scaled units; the cost is that above the fit's.
        """
        heat = np.concatenate(heats)
        heat = heat - heat.mean()
        I, b, p = self._information, self._score, self._p
        f, every = p + len(index), self.index
        N, r = np.zeros((f + len(every), f + len(every))), np.zeros(f + len(every))
        once, twice, both = (np.tensordot(w, I, 1) for w in (heat, heat**2, heat * self._power))
        N[:p, :p], N[:p, p:f], N[:p, f:] = I.sum(axis=0), once[:, index], self._once
        N[p:f, p:f], N[p:f, f:], N[f:, f:] = (
            twice[np.ix_(index, index)],
            both[np.ix_(index, every)],
            self._twice,
        )
        N = np.triu(N) + np.triu(N, 1).T
        r[:p], r[p:f], r[f:] = b.sum(axis=0), (heat @ b)[index], (self._power @ b)[every]
        inverse = np.asarray(np.linalg.inv(N + _RIDGE * np.diag(np.maximum(np.diag(N), _RIDGE))), np.float64)
        beta: Floats = np.asarray(inverse @ r, np.float64)
        return beta, inverse, -float(r @ beta)

    def best(self, index: list[int], shape: HeatProportions = ONE) -> WarmUpFit:
        """The best time constant and starts for these followers."""
        halls = len(self.windows) - 1 if self.halls else 0
        free = np.concatenate([np.full(len(self.free), 0.5 * self.highest), np.zeros(halls)])
        least = np.concatenate([np.zeros(len(self.free)), -np.ones(halls)])

        def cost(tau_s: float, starts: Floats) -> float:
            return self.solve(self.heats(_model(tau_s, shape), starts)[0], index)[2]

        def at(tau_s: float, starts: Floats) -> tuple[float, Floats]:
            if not starts.size:
                return cost(tau_s, starts), starts
            scale = max(abs(cost(tau_s, starts)), 1e-300)

            def relative(x: Floats) -> float:
                return cost(tau_s, x * self.highest) / scale

            bounds = Bounds(least, np.ones(starts.size))
            run = minimize(relative, starts / self.highest, method="L-BFGS-B", bounds=bounds)
            return float(run.fun) * scale, np.asarray(run.x * self.highest)

        taus = self._taus(shape)
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
        return self._fit(tau, shape, free, index)

    def _taus(self, shape: HeatProportions) -> Floats:
        """Time constants that are tried; the slower one of two is not longer than the longest record."""
        if shape.ratio == 1:
            return np.geomspace(_SHORTEST_S, max(_LONGEST * self.seconds, 2 * _SHORTEST_S), _TAUS)
        longest_s = WINDOW_S * max(w.power.size for w in self.windows)
        shortest_s = max(_SHORTEST_S, _SHORTEST_FAST_S * shape.ratio)
        return np.geomspace(shortest_s, max(longest_s, 1.5 * shortest_s), _TAUS // 2)

    def _fit(self, tau_s: float, shape: HeatProportions, free: Floats, index: list[int]) -> WarmUpFit:
        model = _model(tau_s, shape)
        heats, starts = self.heats(model, free)
        beta, inverse, cost = self.solve(heats, index)
        p, f, heat = self._p, self._p + len(index), np.concatenate(heats)
        heat = heat - heat.mean()
        follow = np.zeros((2, p))
        follow[0, index], follow[1, self.index] = beta[p:f], beta[f:]
        left = _left(self._information, self._score, beta[:p], np.column_stack([heat, self._power]) @ follow)
        over = heat[:, np.newaxis] * left[:, index], self._power[:, np.newaxis] * left[:, self.index]
        size = min(GROUP, max(_SMALLEST_GROUP, len(left) // _FEWEST_GROUPS))
        groups = np.add.reduceat(np.hstack([left, *over]), np.arange(0, len(left), size), axis=0)
        sd = np.sqrt(((groups @ inverse) ** 2).sum(axis=0)[p:f])
        unit, constants = self._size[index], beta[:p] * self._size
        variance = float(np.mean(sd**2 / np.diag(inverse)[p:f]))
        return WarmUpFit(
            model,
            shape,
            starts,
            self.ambients(free),
            heats,
            index,
            constants,
            beta[p:f] * unit,
            sd * unit,
            len(groups),
            cost,
            variance,
        )


def _model(tau_s: float, shape: HeatProportions) -> ThermalModel:
    return ThermalModel(tau_s, 0.0, 1.0, 1.0, fast=shape.fast(tau_s))


def _left(information: Floats, score: Floats, constants: Floats, more: Floats) -> Floats:
    """Scores of windows (W, p) minus the part explained by constants (p,) plus deviations in each window (W, p)."""
    return np.asarray(score - np.einsum("wij,wj->wi", information, constants + more))


def left_of(windows: Sequence[Windows], fit: WarmUpFit) -> list[Floats]:
    """Scores of the windows (W, p) of each record less what a fit explains by the heat."""
    mean = float(np.concatenate(fit.heats).mean())
    slopes = np.zeros(fit.constants.size)
    slopes[fit.which] = fit.slopes
    return [
        _left(w.information, w.score, fit.constants, np.outer(heat - mean, slopes))
        for w, heat in zip(windows, fit.heats, strict=True)
    ]


def chosen(search: Search, values: Sequence[float]) -> WarmUpFit | None:
    """The fit with all followers and ambient heats that the records show; None: there are no followers.

    ``values``: of the parameters that might follow.
    """
    found = _chosen(search, values)
    if len(search.windows) == 1 or (other := _chosen(search.with_halls(), values)) is None:
        return found
    shown = _SHOWS_HALL * max(other.variance, 1.0) * (len(search.windows) - 1)
    return other if found is None or found.cost - other.cost > shown else found


def _chosen(search: Search, values: Sequence[float]) -> WarmUpFit | None:
    """The fit with all followers that the records show, and the time constants; None: there are no followers."""
    value = dict(zip(search.index, values, strict=True))
    found: WarmUpFit | None = None
    while rest := [i for i in search.index if found is None or i not in found.which]:
        which = [] if found is None else found.which
        fit = min((search.best([*which, i]) for i in rest), key=lambda fit: fit.cost)
        if not _shows(fit, value[fit.which[-1]], _CHANCE if found is None else _CHANCE_BESIDE):
            break
        found = fit
    if found is None:
        return None
    which, least = found.which, found.cost
    two = min((search.best(which, shape) for shape in _SHAPES), key=lambda fit: fit.cost)
    return two if least - two.cost > _SHOWS_TWO * max(two.variance, 1.0) else found


def _shows(fit: WarmUpFit, value: float, chance: float) -> bool:
    """Whether the records show that the last follower of a fit, a parameter with this value, follows the heat, too."""
    fall = abs(float(fit.slopes[-1])) * float(np.ptp(np.concatenate(fit.heats)))
    return fit.chance <= chance and fall >= LEAST_FALL * abs(value)
