"""A batch of axes with equal structure: owns their state and runs blocks of their samples through the kernel."""

import math
from collections.abc import Iterator, Sequence
from typing import TypedDict, Unpack

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.detection.alarm import DIRECTIONS
from monitor_core.detection.cusum.cusum_evidence import BatchEvent, Crossing, EvidenceBuilder
from monitor_core.drive.assembly import Assembly, fill, without_friction
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import stable_limits
from monitor_core.kernel.block import BatchSamples, Trace, compile_parts, run
from monitor_core.kernel.cusum import Events
from monitor_core.kernel.evidence import KEPT, EvidenceColumns, Kept, kept_numbers, noted_numbers
from monitor_core.kernel.llvm_vectors import EIGHT
from monitor_core.kernel.outliers import CREDIT
from monitor_core.kernel.state import NEVER, State, constant_views, state_rows, state_views
from monitor_core.kernel.tables import COULOMB, constant_rows
from monitor_core.settings import Settings

FEWEST_LANES = 8
"""Number of axes from which a batch runs in lanes.  Lanes are faster from four axes on, twice as fast at eight (``make
bench`` measures it).  But with lanes, the six axes of a robot would save a thousandth of a core and wait 3 s longer for
the compiler."""

MAX_LANES = 64
"""Lanes side by side: with so many, the work done once for all lanes hardly counts, and their arrays fit the L2
cache."""


class MoreColumns(TypedDict, total=False):
    """Optional data of the samples of a batch in addition to times, torque and motion; None: left out."""

    count: Ints | None
    """(W,) number of samples of each axis; default: all N"""
    shift: Floats | None
    """(N, p, W) theta_0(s) - theta_0 at each sample, in theta's units; default: the last value.  NaN: the conditions
    are not known"""
    gate: Bools | None
    """(N, W) the estimates are not updated where this is False, or where the conditions are not known"""
    weight: Floats | None
    """(N, W) torque of the nominal weight [N m], for a drive that has it as an input; default, and for NaN: the last
    value"""


class AxisBatch:
    """Monitors of several axes with the same drive structure and the same monitored parameters.

    Raises:
        ValueError: no axis, structures that differ, or settings that do not fit the drive.
    """

    def __init__(self, models: Sequence[AxisModel], settings: Sequence[Settings]) -> None:
        if not models or len(models) != len(settings):
            raise ValueError(f"{len(models)} models and {len(settings)} settings: need one each, at least one")
        first = models[0]
        for model in models:
            if (model.drive, model.monitored) != (first.drive, first.monitored):
                raise ValueError("the axes of a batch must share the drive and the monitored parameters")
        if len({s.run_on for s in settings}) > 1:
            raise ValueError("the axes of a batch must agree on run_on")
        self.models, self.settings = tuple(models), tuple(settings)
        assembly = Assembly(first.drive, first.monitored)
        rubs = any(model.drive.acts((COULOMB,), model.nominal, model.monitored) for model in models)
        self._tables = t = assembly.tables if rubs else without_friction(assembly.tables)
        W = len(models)
        rows = constant_rows(t)
        self._constants = np.zeros((rows, W))
        float_rows, int_rows = state_rows(t.n, t.p, t.m)
        self._floats = np.zeros((float_rows + KEPT * kept_numbers(t.p), W))
        self._ints = np.zeros((int_rows + KEPT, W), dtype=np.int64)
        self._parts = self._floats[:float_rows], self._ints[:int_rows]
        self._kept = Kept(self._ints[int_rows:], self._floats[float_rows:])
        self._kept.t[:] = NEVER
        self.state: State = state_views(*self._parts, t.n, t.p, t.m)
        """Named views into the state, axis last.  Writing to them changes the monitors."""
        named = constant_views(self._constants, t)
        self._tested = named.tested
        self.judged: Bools = np.ones(W, np.bool_)
        """Whether the estimates of each axis are tested; ``judge`` changes it"""
        pairs = list(enumerate(zip(models, settings, strict=True)))
        self.thresholds: Floats = named.h
        """h (p, W)"""
        self.allowance: Floats = named.allowance
        """Part of nu that allows for more than chance (p, W); ``allow`` changes it"""
        self.limits: tuple[Floats, Floats] = (named.lower, named.upper)
        """Lower and upper bounds of theta (p, W): those of the models, narrowed to where the predictors are stable."""
        self._untraced = self._trace(0)
        self._judges = tuple(EvidenceBuilder(m, s, *(rows[:, a] for rows in self.limits)) for a, (m, s) in pairs)
        for a, (model, setting) in pairs:
            fill(named, a, constants_of(assembly, model, setting))
            self._start(a, model, setting)

    def _start(self, a: int, model: AxisModel, s: Settings) -> None:
        st = self.state
        st.theta[:, a] = model.theta0
        st.t[a] = NEVER
        st.onset[:, :, a] = NEVER
        st.left[a] = s.naming_samples
        st.theta_seen[:, a] = model.theta0
        st.lam0_running[a] = s.lam0
        st.credit[a] = CREDIT
        st.excitation[a] = 1.0
        st.seed_left[a] = s.seed_updates
        certain = s.P0 or uninformed_P(model, s)
        if np.shape(certain) != model.scale.shape:
            raise ValueError(f"P0 has {len(s.P0)} entries, {len(model.scale)} parameters are monitored")
        np.fill_diagonal(st.P[:, :, a], certain)
        st.P_nom[:, a] = s.P0 or 0.0

    def run(self, t_us: Ints, u: Floats, y: Floats, **more: Unpack[MoreColumns]) -> list[tuple[int, BatchEvent]]:
        """Run a block: t_us, u, y (N, W), axis last, and optional columns.

        Returns the events, each with the index of its axis: axis by axis, in order of time.

        Raises:
            ValueError: shapes that do not fit.
        """
        return self._run(self._samples(t_us, u, y, **more), self._untraced)

    def run_traced(
        self, t_us: Ints, u: Floats, y: Floats, **more: Unpack[MoreColumns]
    ) -> tuple[list[tuple[int, BatchEvent]], Trace]:
        """As ``run``, with the recursion's values at every sample."""
        trace = self._trace(len(t_us))
        return self._run(self._samples(t_us, u, y, **more), trace), trace

    def trace(self, t_us: Ints, u: Floats, y: Floats, **more: Unpack[MoreColumns]) -> Trace:
        """As ``run_traced``, without the events: making them takes as long as running many axes."""
        trace = self._trace(len(t_us))
        self._advance(self._samples(t_us, u, y, **more), trace)
        return trace

    def crossings(self, t_us: Ints, u: Floats, y: Floats, **more: Unpack[MoreColumns]) -> list[tuple[int, Crossing]]:
        """As ``run``, but only the crossings of thresholds; those of each axis are in order of time."""
        events, _ = self._advance(self._samples(t_us, u, y, **more), self._untraced)
        return [self._event(events, k) for k in range(int(events.filled[0]))]

    def _samples(self, t_us: Ints, u: Floats, y: Floats, **more: Unpack[MoreColumns]) -> BatchSamples:
        count, shift, gate, weight = (more.get(name) for name in ("count", "shift", "gate", "weight"))
        p, W = self._tables.p, len(self.models)
        t = np.ascontiguousarray(t_us, dtype=np.int64)
        if t.ndim != 2 or t.shape[1] != W or np.shape(u) != t.shape or np.shape(y) != t.shape:
            raise ValueError(f"t, u, y of shapes {t.shape}, {np.shape(u)}, {np.shape(y)}: need (N, {W}) each")
        N = len(t)
        n = np.full(W, N) if count is None else np.asarray(count, dtype=np.int64)
        if n.shape != (W,) or (n < 0).any() or (n > N).any():
            raise ValueError(f"count = {n}: need {W} numbers from 0 to {N}")
        moved = np.empty((0, p, W)) if shift is None else np.ascontiguousarray(shift, dtype=float)
        opened = np.empty((0, W), np.bool_) if gate is None else np.ascontiguousarray(gate, dtype=np.bool_)
        if moved.shape not in {(N, p, W), (0, p, W)} or opened.shape not in {(N, W), (0, W)}:
            raise ValueError(f"shift, gate of shapes {moved.shape}, {opened.shape}: need {(N, p, W)} and {(N, W)}")
        held = np.empty((0, W)) if weight is None else np.ascontiguousarray(weight, dtype=float)
        if held.shape not in {(N, W), (0, W)}:
            raise ValueError(f"weight of shape {held.shape}: need {(N, W)}")
        u, y = np.ascontiguousarray(u, dtype=float), np.ascontiguousarray(y, dtype=float)
        return BatchSamples(t, u, y, n, moved, opened, held)

    def _run(self, samples: BatchSamples, trace: Trace) -> list[tuple[int, BatchEvent]]:
        return sorted(self._named(*self._advance(samples, trace)), key=lambda pair: pair[0])

    def _advance(self, samples: BatchSamples, trace: Trace) -> tuple[Events, EvidenceColumns]:
        events, noted = self._events(len(samples.t)), self._noted(len(samples.t))
        reset = not self.settings[0].run_on
        run(
            _lanes(len(self.models)), self._tables, self._constants, *self._parts, *self._kept,
            samples, reset, events, noted, trace,
        )  # fmt: skip
        return events, noted

    def compile_parts(self) -> None:
        """Compile only parts of the kernel.

        In a second process, this shortens the compilation of the whole kernel in the first one.
        """
        compile_parts(
            _lanes(len(self.models)), self._tables, self._constants, *self._parts, self._kept,
            not self.settings[0].run_on, self._events(0), self._noted(0),
        )  # fmt: skip

    def _trace(self, N: int) -> Trace:
        p, W = self._tables.p, len(self.models)
        own = {name: np.empty((N, p, W)) for name in ("psi", "theta", "P", "shift", "observed")}
        own |= {name: np.full((N, W), np.nan) for name in ("eps", "yhat")}
        return Trace(g=np.empty((N, 2, p, W)), mode=np.zeros((N, W)), **own)

    def _events(self, N: int) -> Events:
        """Arrays for two crossings of each parameter in each of N samples."""
        capacity = 2 * self._tables.p * N * len(self.models)
        return Events(np.zeros(1, np.int64), np.empty((5, capacity), np.int64))

    def _noted(self, N: int) -> EvidenceColumns:
        """Arrays for the evidence that N samples of each axis can yield."""
        p = self._tables.p
        capacity = sum(N // s.naming_samples + 1 for s in self.settings)
        what, value = np.empty((4, capacity), np.int64), np.empty((noted_numbers(p), capacity))
        before = np.empty((capacity, KEPT), np.int64), np.empty((capacity, KEPT, kept_numbers(p)))
        return EvidenceColumns(np.zeros(1, np.int64), what, value, *before)

    def _named(self, events: Events, noted: EvidenceColumns) -> Iterator[tuple[int, BatchEvent]]:
        """All events in order, including the evidence that the kernel noted between the crossings."""
        done = 0
        for c in range(int(noted.filled[0])):
            before = int(noted.what[3, c])
            yield from (self._event(events, k) for k in range(done, before))
            done = before
            a = int(noted.what[1, c])
            yield from ((a, event) for event in self._judges[a].events(noted, c, self.judged[a]))
        yield from (self._event(events, k) for k in range(done, int(events.filled[0])))

    def _event(self, events: Events, k: int) -> tuple[int, Crossing]:
        kind, a, i, t_us, onset_us = (int(v) for v in events.what[:, k])
        return a, Crossing(self.models[a].monitored[i], DIRECTIONS[kind], t_us, onset_us)

    def judge(self, a: int, on: bool) -> None:
        """Switch the tests of an axis, and the readings for its trend, on or off from now on."""
        self.judged[a] = on
        self._tested[a] = on and not self.settings[a].unidentifiable

    def allow(self, a: int, more: Floats) -> None:
        """Set an additional allowance (p,) for the tests of an axis, beyond its settings, until the next call."""
        p = len(self.models[a].scale)
        self.allowance[:, a] = self.settings[a].tests(p)[2] * self.models[a].scale + more

    def move_nominal(self, a: int, step: Floats) -> None:
        """Move theta_0(s) of an axis by a step (p,), but not its estimates; kept deviations are discarded."""
        self.state.shift[:, a] += step
        self._kept.t[:, a] = NEVER

    def column(self, a: int) -> tuple[Floats, Ints]:
        """A copy of the whole state of one axis: floats and integers."""
        return self._floats[:, a].copy(), self._ints[:, a].copy()

    def restore(self, a: int, floats: Floats, ints: Ints) -> None:
        """Restore a state from ``column``.

        Raises:
            ValueError: the arrays have another shape, or hold values that no state can have.
        """
        if floats.shape != self._floats[:, a].shape or ints.shape != self._ints[:, a].shape:
            raise ValueError(f"a state of {floats.size} + {ints.size} numbers does not fit this model")
        if not np.isfinite(floats).all():
            raise ValueError("a state with values that are not finite")
        self._floats[:, a] = floats
        self._ints[:, a] = ints


def standard_deviation(s: Settings, P_ii: float) -> float:
    """Standard deviation of an estimate: sqrt(lambda_0 P_ii / (1 + lambda))."""
    return math.sqrt(s.lam0 * P_ii / s.divisor)


def _lanes(axes: int) -> tuple[int] | Ints:
    """Lanes of the kernel: (0,), which runs few axes one after the other, or indices that share the axes evenly."""
    if axes < FEWEST_LANES:
        return (0,)
    turns = -(-axes // MAX_LANES)
    return np.arange(-(-axes // (turns * EIGHT)) * EIGHT)


# --- Constants of the kernel for an axis: its settings and nominal values ---------------------------------------------


SLOW_MEMORIES = 10


def uninformed_P(model: AxisModel, s: Settings) -> Floats:
    """Diagonal of P (p,) if only the sizes of the parameters are known."""
    return np.asarray((1 + s.lam) * model.scale**2 / s.lam0)


def constants_of(assembly: Assembly, model: AxisModel, s: Settings) -> dict[str, Floats]:
    """Values of kernel/tables.Constants by name: numbers and vectors.

    Raises:
        ValueError: settings that do not fit the drive.
    """
    numbers = {
        "interval": s.interval_s,
        "lam": s.lam,
        "lam0": s.lam0,
        "lam_slow": 1 - (1 - s.lam) / SLOW_MEMORIES,
        "delay": s.delay_s,
        "gap_us": round(s.max_gap_s * 1e6),
        "settle_us": round(s.settle_s * 1e6),
        "seed": s.seed_updates,
        "naming_samples": s.naming_samples,
        "floor": s.information_floor,
        "min_excitation": s.min_excitation,
        "lost_us": round(s.lost_s * 1e6),
        "outlier": s.outlier_limit,
        "outlier_least": s.least_outlier,
        "outlier_credit": s.outlier_credit,
        "joint": s.joint_state,
        "tested": not s.unidentifiable,
        "widen": s.covariance_reset,
        "span": s.span,
    }
    n = len(model.drive.states)
    vectors = {"K": s.gains(n).ravel(), "P_uninformed": uninformed_P(model, s), "scale": model.scale}
    alpha1, alpha2, allowance = s.tests(len(model.scale))
    vectors |= {"h": alpha2 * model.scale, "alpha1": alpha1, "allowance": allowance * model.scale}
    vectors |= assembly.model_constants(model, s.speed_scale)
    vectors["lower"], vectors["upper"] = stable_limits(model, s.gain(n), s.interval_s)
    return vectors | {k: np.array(float(v)) for k, v in numbers.items()}
