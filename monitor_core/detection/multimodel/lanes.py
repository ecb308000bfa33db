"""Arrays of the kernel for hypotheses: constants, with a lane for each hypothesis, and the initial state."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.detection.multimodel.hypothesis import Hypothesis
from monitor_core.detection.multimodel.lane_intervals import discretize
from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import DELAY as DELAY_PARAMETER
from monitor_core.kernel import hypotheses as kernel
from monitor_core.kernel import likelihood, predictors
from monitor_core.kernel.hypotheses import Memory
from monitor_core.kernel.llvm_vectors import EIGHT
from monitor_core.kernel.outliers import CREDIT
from monitor_core.kernel.predictors import Predictors
from monitor_core.kernel.state import COUNTERS, NEVER
from monitor_core.kernel.tables import GAINS, OF_MOTION, ONE, WEIGHT, Tables
from monitor_core.settings import Settings


class Tests(NamedTuple):
    """Constants of the tests of hypotheses, (H,) each."""

    h: Floats
    """Thresholds"""
    allowance: Floats
    """Subtracted from the log-likelihood ratio at each sample"""
    tolerated: Floats
    """The part of the allowance that still counts as evidence when the cause is identified"""
    unexplained: Floats
    """Share of the evidence for the active faults that is subtracted from that for a hypothesis"""


def lanes_of(
    model: AxisModel, settings: Settings, hypotheses: Sequence[Hypothesis], tests: Tests
) -> tuple[Tables, Predictors]:
    """The kernel's arrays; lanes up to a multiple of eight are filled with the first hypothesis, without a threshold.

    The last hypothesis must be the return to the healthy axis.

    Raises:
        ValueError: a hypothesis whose values the drive cannot have.
    """
    drives = _Drives(replace(model, monitored=(), bounds={}), settings, hypotheses)
    back, fill = len(hypotheses) - 1, -len(hypotheses) % EIGHT
    lanes = [drives.lane(hypothesis) for hypothesis in [*hypotheses, *[hypotheses[0]] * fill]]
    table = {name: np.stack([lane[name] for lane in lanes], axis=1) for name in lanes[0]}
    own = table["own"]
    own[predictors.LIMIT] = np.inf
    own[predictors.LEVEL] -= own[predictors.LEVEL, 0]  # the ratios are those to the first hypothesis
    own[predictors.LEVEL, : back + 1] -= tests.allowance
    for row, values in (
        (predictors.LIMIT, tests.h),
        (predictors.ALLOWANCE, tests.allowance),
        (predictors.TOLERATED, tests.tolerated),
        (predictors.UNEXPLAINED, tests.unexplained),
    ):
        own[row, : back + 1] = values
    s = settings
    axis = [
        s.interval_s, s.lam, s.lam0, round(s.max_gap_s * 1e6), round(s.settle_s * 1e6), round(s.lost_s * 1e6),
        s.outlier_limit, s.least_outlier, s.outlier_credit, _usual_us(s.interval_s)[0], back,
    ]  # fmt: skip
    moving, n, m = _moving(model, table["acts"]), len(model.drive.states), len(model.drive.inputs)
    acts = table.pop("acts").reshape(-1, n, m, len(lanes))[:, :, moving]
    factors = [table.pop(name).reshape(len(acts), n, -1, len(lanes)) for name in ("constant", "taps", "move")]
    return drives.assembly.tables, Predictors(
        **{name: np.ascontiguousarray(values) for name, values in table.items()},
        terms=_by_eight(np.concatenate([*factors, acts], axis=2)),
        moving=moving,
        axis=np.array(axis, float)[:, np.newaxis],
    )


def _by_eight(factors: Floats) -> Floats:
    """Factors (USUAL, n, terms, H) in the layout of ``Predictors.terms``."""
    wide = factors.reshape(*factors.shape[:3], -1, EIGHT)
    return np.ascontiguousarray(wide.transpose(0, 3, 1, 2, 4)).ravel()


def memory_of(tables: Tables, lanes: int) -> Memory:
    """The initial state of a bank."""
    n, m = tables.n, tables.m
    u = np.zeros((m, lanes))
    u[tables.kind == ONE] = 1.0
    numbers = np.zeros((4, 1))
    numbers[kernel.CREDIT] = CREDIT
    integers = np.zeros((kernel.COUNTS + len(COUNTERS), 1), np.int64)
    integers[kernel.LAST], integers[kernel.WAIT], integers[kernel.SINCE] = NEVER, 1, NEVER
    when = np.full((likelihood.FIRST_MARK + likelihood.MARKS, lanes), NEVER)
    return Memory(np.zeros((n, lanes)), u, np.zeros((likelihood.SUMS, lanes)), when, numbers, integers)


class _Drives:
    """The drive under each hypothesis, cached by its parameter values: half of the hypotheses do not change them."""

    def __init__(self, model: AxisModel, s: Settings, hypotheses: Sequence[Hypothesis]) -> None:
        self.model, self.s, self.assembly = model, s, Assembly(model.drive, ())
        self.changed, self.constants = cache(self._changed), cache(self._constants)
        self._keys = list(dict.fromkeys(map(self._key, hypotheses)))
        models, delays = [self.changed(values) for values, _ in self._keys], [delay for _, delay in self._keys]
        self._intervals = discretize(models, delays, np.array(_usual_us(s.interval_s)) / 1e6)

    def _key(self, hypothesis: Hypothesis) -> tuple[tuple[float, ...], float]:
        """Parameter values and delay, which determine the discretization."""
        model = self.model
        delay = self.s.delay_s + model.nominal.get(DELAY_PARAMETER, 0.0) + hypothesis.delay_s
        return tuple(values_of(model, hypothesis).values()), delay

    def _changed(self, values: tuple[float, ...]) -> AxisModel:
        return replace(self.model, nominal=dict(zip(self.model.nominal, values, strict=True)))

    def _constants(self, values: tuple[float, ...]) -> dict[str, Floats]:
        return self.assembly.model_constants(self.changed(values), self.s.speed_scale)

    def lane(self, hypothesis: Hypothesis) -> dict[str, Floats]:
        """The numbers of one hypothesis, by the names of ``Predictors`` and those that ``lanes_of`` combines."""
        s, model = self.s, self.model
        key = values, delay = self._key(hypothesis)
        numbers, at = self.constants(values), self._keys.index(key)
        gains = np.tile(hypothesis.K, (GAINS, 1)) if hypothesis.K is not None else s.gains(len(model.drive.states))
        gains = np.zeros_like(gains) if hypothesis.frozen else gains / hypothesis.output.scale
        torque, output = hypothesis.torque, hypothesis.output
        own = [
            delay, torque.scale, torque.offset, output.scale, output.offset, hypothesis.frozen, hypothesis.still,
            1 / (hypothesis.variance * s.lam0), -0.5 * np.log(hypothesis.variance), 0.0, 0.0, 0.0, 0.0,
        ]  # fmt: skip
        move, taps, acts = (part[at] for part in self._intervals)
        always = np.array(model.drive.inputs) == ONE
        return {name: numbers[name] for name in ("weight", "rest", "rigid", "u_scale")} | {
            "V0": np.append(numbers["V0"], 0.0),
            "K": gains.ravel(),
            "own": np.array(own, float),
            "usual_K": np.concatenate([_gain_after(gains, us / 1e6 / s.interval_s) for us in _usual_us(s.interval_s)]),
            "move": move.ravel(),
            "taps": (taps * torque.scale).transpose(0, 2, 1).ravel(),
            "constant": (taps.sum(axis=1) * torque.offset + acts[..., always].sum(axis=2)).ravel(),
            "acts": acts.ravel(),
        }


def _usual_us(interval_s: float) -> range:
    """Intervals [us] that are discretised in advance: the nominal one and those that differ by rounding to 1 us."""
    middle = round(interval_s * 1e6)
    return range(middle - 1, middle - 1 + predictors.USUAL)


def _gain_after(gains: Floats, intervals: float) -> Floats:
    """Filter gain (n,) after a time in nominal intervals, as in ``kernel.sample_interval.interval_gain``."""
    k = min(int(intervals), GAINS - 2)
    before, after = gains[k : k + 2]
    return np.asarray(before + min(intervals - k, 1.0) * (after - before))


def values_of(model: AxisModel, hypothesis: Hypothesis) -> dict[str, float]:
    """All parameter values under a hypothesis."""
    values = dict(model.nominal)
    for name, factor in hypothesis.factors.items():
        values[name] *= factor
    for name, shift in hypothesis.shifts.items():
        values[name] += shift
    return values


def _moving(model: AxisModel, acts: Floats) -> Ints:
    """Indices of the inputs that depend on motion or pose and have an effect under any hypothesis."""
    kinds = model.drive.inputs
    of_input = np.abs(acts.reshape(-1, len(kinds), acts.shape[1])).max(axis=(0, 2))
    return np.array([c for c, kind in enumerate(kinds) if kind in (*OF_MOTION, WEIGHT) and of_input[c]], dtype=np.int64)
