"""Prediction errors eps and their gradient psi = d yhat / d xi of records, for the vector xi of a fit."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.parameter_names import slope_name, value_of, with_values
from monitor_core.drive.structure import DISTURBANCE_TIME, Drive
from monitor_core.identification.predictor.held_drive import (
    HalfIntervalSpeed,
    LinearDrive,
    Structure,
    hold,
    hold_late,
    hold_mean,
    middle_speed,
)
from monitor_core.identification.predictor.noise import Gain, Levels, gain
from monitor_core.identification.predictor.parameter_vector import Layout, PhysicalValues, whole_intervals
from monitor_core.identification.predictor.prepared_record import PreparedRecord, series
from monitor_core.identification.problem import Disturbance, Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.kernel.fixed_predictor import (
    FROM_OUTPUT,
    FROM_RECORD,
    FROM_STATE,
    FixedDrive,
    MotionInputs,
    RecordSamples,
    predict_record,
)
from monitor_core.kernel.tables import COULOMB, TORQUE, WEIGHT

_FAR = 1e4
"""Limit of an initial state, as a multiple of the largest output."""


class Errors(NamedTuple):
    """Errors of one record: eps (N,) and psi (N, shared + n), zero where they do not count.

    ``good``: all values are finite.
    """

    eps: Floats
    psi: Floats
    good: bool


class RecordPredictor:
    """The predictor of a problem on its records.

    The vector xi is that of ``layout``, followed by the free part of the initial state of each record.

    Raises:
        ValueError: no record, another output than the drive's, a record in which nothing was measured.
    """

    def __init__(self, problem: Problem, records: Sequence[Record], disturbance: Disturbance | None) -> None:
        _check(problem, records)
        torques, inner = problem.followed_torques, problem.with_torque_inputs()
        self.problem, self.disturbance = problem, disturbance
        slow = disturbance is not None and disturbance.slow > 0
        self.drive: Drive = problem.drive.with_disturbance() if slow else problem.drive
        acting = inner.drive.with_disturbance() if slow else inner.drive
        self.torque_slopes = tuple(slope_name(*torque) for torque in torques)
        """Names of the slopes of constant torques that follow signals: factors of further inputs"""
        median_s = float(np.median(np.concatenate([r.intervals for r in records])))
        self.interval_s = problem.interval_s or round(median_s, 6)
        self.layout = Layout(inner, acting, disturbance, self.interval_s)
        names = [signal for _, signal in self.layout.varying]
        late = whole_intervals(problem.delay_s, self.interval_s)
        self._whole_s = late * self.interval_s
        self.series = [
            series(record, names, late, [signal for _, signal in torques], problem.min_speed) for record in records
        ]
        start = self.layout.point(self.layout.start())
        self.d = AxisModel(acting, start.values, ()).balance()
        self._structure = Structure(acting, self.layout.free, self.d)
        self._kinds = np.array(acting.inputs)
        self._torque = self._kinds == TORQUE
        self._source = np.array([self._source_of(kind) for kind in acting.inputs])
        self._last: tuple[Floats, list[Errors]] = (np.empty(0), [])
        self._last_gain: tuple[Floats, Gain] | None = None
        self._signal_mean = np.average(
            [s.signals[s.level].mean(axis=0) for s in self.series], axis=0, weights=[len(r) for r in records]
        )

    def _source_of(self, kind: int) -> int:
        """Source of an input of the motion; friction with an angle or a mean speed uses the predictor's speed."""
        if kind == COULOMB and self.drive.output != "speed":
            return FROM_STATE
        return FROM_RECORD if self.problem.motion == "measured" else FROM_OUTPUT

    @property
    def n(self) -> int:
        """Number of states."""
        return len(self.drive.states)

    @property
    def own(self) -> int:
        """Number of entries of the vector for each record: its initial state, or none."""
        return self.n if self.problem.initial == "free" else 0

    def columns(self, i: int) -> np.ndarray:
        """Indices in the vector of the columns of psi of record i."""
        shared = self.layout.shared
        own = shared + i * self.own + np.arange(self.own)
        return np.concatenate([np.arange(shared), own])

    def start(self) -> Floats:
        """Start of the vector: nominal values, all at rest."""
        xi = self.layout.start()
        rest = self._rest(self._linear(self.layout.point(xi), self._signal_mean))
        return np.concatenate([xi, *(rest[: self.own] * s.first for s in self.series)])

    def bounds(self) -> tuple[Floats, Floats]:
        """Bounds of the vector."""
        lower, upper = self.layout.bounds()
        endless = np.full(self.own * len(self.series), math.inf)
        return np.concatenate([lower, -endless]), np.concatenate([upper, endless])

    def farthest_starts(self) -> Floats:
        """Limits (len(xi) - shared,) that no initial state exceeds."""
        return np.repeat([_FAR * float(np.abs(s.y).max(initial=0.0)) or 1.0 for s in self.series], self.own)

    def gain(self, xi: Floats) -> Gain:
        """K and its derivatives (n, shared), in units of d.

        Raises:
            ValueError: there is no stable filter.
        """
        point, shared = self.layout.point(xi), self.layout.shared
        if self.problem.K is not None:
            return Gain(np.array(self.problem.K) / self.d, np.zeros((self.n, shared)), math.nan)
        if self.disturbance is None:
            return Gain(np.zeros(self.n), np.zeros((self.n, shared)), 1.0)
        slow = self.disturbance.slow > 0
        T = point.values[DISTURBANCE_TIME] if slow else math.inf
        free = self.layout.free
        which = free.index(DISTURBANCE_TIME) if DISTURBANCE_TIME in free else None
        found = gain(
            self._linear(point, self._signal_mean),
            self._torque,
            Levels(point.torque, point.slow, T, self.interval_s, self.d[-1]),
            self.layout.levels,
            which,
            self.drive.mean_state,
        )
        # The delay does not affect K; its column lies between the parameters and the levels.
        at = len(free) + len(self.layout.varying)
        dK = np.insert(found.dK, [at] * self.layout.free_delay, 0.0, axis=1)
        kept = np.arange(self.n) != self.drive.mean_state  # this state is reset after the correction
        return found._replace(K=found.K * kept, dK=dK * kept[:, None])

    def errors(self, xi: Floats) -> list[Errors]:
        """Prediction errors and gradients of all records; not good where theta makes no sense.

        The result for the last vector is cached, as it is needed again at the end of a search.
        """
        if not np.array_equal(self._last[0], xi):
            self._last = (xi.copy(), self._errors(xi))
        return self._last[1]

    def errors_by_starts(self, xi: Floats) -> list[Errors]:
        """As ``errors``, with psi (N, own) by the free initial states alone: the others are most of the work."""
        return self._errors(xi, starts=True)

    def _errors(self, xi: Floats, *, starts: bool = False) -> list[Errors]:
        with np.errstate(all="ignore"):
            try:
                K = self._kept_gain(xi)
            except ValueError:
                return [self._nothing(s, starts) for s in self.series]
            return [self._record_errors(xi, i, K, starts) for i in range(len(self.series))]

    def _kept_gain(self, xi: Floats) -> Gain:
        """The gain, cached if only initial states have changed since the last vector."""
        shared = xi[: self.layout.shared]
        if self._last_gain is None or not np.array_equal(self._last_gain[0], shared):
            self._last_gain = (shared.copy(), self.gain(xi))
        return self._last_gain[1]

    def _nothing(self, s: PreparedRecord, starts: bool) -> Errors:
        columns = self.own if starts else self.columns(0).size
        return Errors(np.full(s.u.size, math.inf), np.zeros((s.u.size, columns)), good=False)

    def _linear(self, point: PhysicalValues, signals: Floats) -> LinearDrive:
        """The drive at these values of the signals; the slopes of scheduled parameters are further derivatives."""
        values, varying = point.values, self.layout.varying
        if not varying:
            return self._structure.at(values)
        theta = np.array([value_of(values, name) for name in self.layout.free])
        for (i, _), slope, signal in zip(varying, point.slopes, signals, strict=True):
            theta[i] += slope * signal
        system = self._structure.at(with_values(values, self.layout.free, theta))
        which = [i for i, _ in varying]
        more = [np.concatenate([slopes, slopes[..., which] * signals], axis=-1) for slopes in system[5:]]
        return LinearDrive(*system[:5], *more)

    def _record_errors(self, xi: Floats, i: int, K: Gain, starts: bool) -> Errors:
        s, point = self.series[i], self.layout.point(xi)
        levels = [self._linear(point, signals) for signals in s.signals]
        acts = self._acts(levels)
        levels = [system.with_inputs(acts) for system in levels]
        x0, Z0 = self._start(xi, i, levels[s.level[0]])
        if starts:
            levels = [LinearDrive(*system[:5], *(slopes[..., :0] for slopes in system[5:])) for system in levels]
            Z0 = np.eye(self.n)[:, : self.own]
        P = Z0.shape[1]
        dK = np.zeros((self.n, P))
        if not starts:
            dK[:, : K.dK.shape[1]] = K.dK
        X, dX = self._held(point, s, levels, self._torque[acts])
        if starts:
            dX = dX[:, :, :0]  # a late torque has brought the derivative by its delay
        motion = self._motion_inputs(point, s, levels, acts, dX.shape[2] // self.n)
        C = np.array([system.C for system in levels])
        dC = _widened(np.array([system.dC for system in levels]), dX.shape[2] // self.n)
        eps, psi = np.zeros(s.u.size), np.zeros((s.u.size, P))
        samples = RecordSamples(s.step, s.level, s.u, s.y, s.measured, s.counts, s.weights)
        good = predict_record(samples, FixedDrive(X, dX, C, dC, K.K, dK), motion, x0, Z0, eps, psi)
        return Errors(eps, psi, bool(good and np.isfinite(psi[-1]).all()))

    def _acts(self, levels: Sequence[LinearDrive]) -> NDArray[np.bool_]:
        """Which inputs (m,) act at all: friction and gravity may be held at zero."""
        acts = [system.B.any(axis=0) | system.dB.any(axis=(0, 2)) for system in levels]
        return np.asarray(np.logical_or.reduce([self._torque, self._kinds == WEIGHT, *acts]))

    def _start(self, xi: Floats, i: int, system: LinearDrive) -> tuple[Floats, Floats]:
        columns, shared = self.columns(i), self.layout.shared
        Z0 = np.zeros((self.n, columns.size))
        if self.own:
            Z0[:, shared:] = np.eye(self.n)
            return xi[columns[shared:]], Z0
        first = self.series[i].first
        Z0[:, : system.drest.shape[1]] = system.drest * first
        return self._rest(system) * first, Z0

    def _rest(self, system: LinearDrive) -> Floats:
        """The state of rigid motion with output 1; that of a mean speed is here the mean itself."""
        rest = system.rest.copy()
        if self.drive.mean_state >= 0:
            rest[self.drive.mean_state] = 1 / self.d[self.drive.mean_state]
        return rest

    def _held(
        self, point: PhysicalValues, s: PreparedRecord, levels: Sequence[LinearDrive], torque: NDArray[np.bool_]
    ) -> tuple[Floats, Floats]:
        """X (G, n, n + m) and dX (G, n + m, n q) for the pairs of the series."""
        parts = [self._held_level(point, s.intervals_s(j), system, torque) for j, system in enumerate(levels)]
        X, dX = (s.in_order([part[k] for part in parts]) for k in range(2))
        return X, np.ascontiguousarray(dX.transpose(0, 3, 2, 1)).reshape(len(X), X.shape[2], -1)

    def _held_level(
        self, point: PhysicalValues, intervals_s: Floats, system: LinearDrive, torque: NDArray[np.bool_]
    ) -> tuple[Floats, Floats]:
        late = self._late_s(point)
        if self.drive.mean_state >= 0:
            X, dX = hold_mean(system, torque, intervals_s, late, self.drive.mean_state, self.interval_s)
        else:
            X, dX = hold(system, intervals_s) if late is None else hold_late(system, torque, intervals_s, late)
        return X, dX if late is None or self.layout.free_delay else dX[:, :-1]

    def _late_s(self, point: PhysicalValues) -> float | None:
        """Delay of the torque beyond whole intervals; None: there is none and will be none."""
        late_s = max(point.delay_s - self._whole_s, 0.0)
        return late_s if self.layout.free_delay or late_s else None

    def _motion_inputs(
        self, point: PhysicalValues, s: PreparedRecord, levels: Sequence[LinearDrive], acts: NDArray[np.bool_], q: int
    ) -> MotionInputs:
        kinds, source = self._kinds[acts], self._source[acts]
        state = self.drive.speed_state if self.drive.output != "speed" else None
        late = self._late_s(point)
        parts = [middle_speed(system, kinds, state, s.intervals_s(j), late) for j, system in enumerate(levels)]
        middle = HalfIntervalSpeed(*(s.in_order(list(part)) for part in zip(*parts, strict=True)))
        if self.drive.speed_state < 0:  # no acceleration is known: friction is that of the measured speed
            middle = HalfIntervalSpeed(*(0 * part for part in middle))
        scale, dscale = self._scales(levels, kinds, q)
        # Contiguous, as the kernel would be compiled again for slices.
        dhalf, dbraked = (np.ascontiguousarray(part[..., :q]) for part in (middle.dhalf, middle.dbraked))
        return MotionInputs(
            kinds, source, self.drive.speed_state, scale, dscale, middle.half, dhalf, middle.braked, dbraked
        )

    def _scales(self, levels: Sequence[LinearDrive], kinds: Ints, q: int) -> tuple[Floats, Floats]:
        """Factors of angle or speed in the argument of an input (L, m), and derivatives (L, m, q)."""
        scale = np.array([system.ratio for system in levels])
        dscale = np.array([system.dratio for system in levels])
        friction = kinds == COULOMB
        scale[:, friction] /= self.problem.speed_scale
        dscale[:, friction] /= self.problem.speed_scale
        if self.drive.output != "speed" and friction.any():
            k = self.drive.speed_state
            for j, system in enumerate(levels):
                # The speed at the sensor is (C A x), which depends on x[speed_state] only.
                sensor = system.C @ system.A[:, k]
                dsensor = system.dC.T @ system.A[:, k] + system.C @ system.dA[:, k]
                dscale[j, friction] = dscale[j, friction] * sensor + scale[j, friction, None] * dsensor
                scale[j, friction] *= sensor
        return scale, _widened(dscale, q)


def _widened(slopes: Floats, q: int) -> Floats:
    """Derivatives with zeros for the delay."""
    out = np.zeros((*slopes.shape[:-1], q))
    out[..., : slopes.shape[-1]] = slopes
    return out


def _check(problem: Problem, records: Sequence[Record]) -> None:
    if not records:
        raise ValueError("no record to fit")
    for record in records:
        if record.quantity != problem.drive.output.removeprefix("mean "):
            what = f"{record.name or 'record'} holds the {record.quantity}"
            raise ValueError(f"{what}, the drive's output is the {problem.drive.output}")
