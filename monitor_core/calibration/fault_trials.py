"""Faults injected at many onsets of a healthy record: when a detector detects them, and under which name."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.healthy_records import first_tested
from monitor_core.calibration.injection import EquivalentLoad, changed_values, equivalent_load, faulty_torque
from monitor_core.calibration.simulated_copies import Innovations, Plants, innovations
from monitor_core.detection import Crossing
from monitor_core.detection.alarm import direction_of
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.multimodel_detector import Limit, Limits, bank_of
from monitor_core.detection.multimodel.naming import CauseIdentified, ChangeDetected, Share
from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.hypotheses import Memory
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

LANES = 64
PARTS, BANK_PARTS = 40, 20
"""Of the time that is watched, by the CUSUM tests and by a bank: where all have alarmed, or the cause is named, the
rest is left out."""

T = TypeVar("T")


@dataclass(frozen=True)
class Fault:
    """A change of a monitored parameter, as a share of its size."""

    parameter: str
    size: float


@dataclass(frozen=True)
class TrialResult:
    """Detection of one fault, at each onset.

    ``exact``: injected by the torque that the same motion would have needed; otherwise simulated with the identified
    model.  ``torque_peak``: the largest torque needed, where it is exact.
    """

    fault: Fault
    exact: bool
    delay_s: Floats  # (onsets,) until the first alarm, inf: none
    first: tuple[str, ...]  # (onsets,) whose alarm came first, "" for none
    direction: tuple[str, ...]  # (onsets,) "up", "down" or ""
    torque_peak: float

    def found_within(self, seconds: float) -> float:
        """Share of the onsets with an alarm within this time."""
        return float(np.mean(self.delay_s <= seconds))

    def delay(self, share: float) -> float:
        """Time within which this share of the onsets has an alarm; inf: not within the watched time."""
        ordered = np.sort(self.delay_s)
        return float(ordered[min(len(ordered) - 1, max(0, int(np.ceil(share * len(ordered))) - 1))])


class FirstAlarm(NamedTuple):
    """The first alarm after an onset: its delay [s], its name, and "up", "down" or ""."""

    delay_s: float = math.inf
    name: str = ""
    direction: str = ""


def run_trials(
    model: AxisModel,
    settings: Settings,
    record: SampleBlock,
    faults: Sequence[Fault],
    onsets: int,
    seconds: float,
    limits: Sequence[Limit] | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[list[TrialResult], int]:
    """Start each fault at ``onsets`` samples of the record and watch for so many seconds.

    The detector is the CUSUM tests, or the multi-model one with these ``limits``: then ``first`` is its final name.

    Returns the results, and the number of onsets that were possible.

    Raises:
        ValueError: the record is too short for that.
    """
    N = round(seconds / settings.interval_s)
    first = first_tested(AxisMonitor(model, settings), record) + round(3 * settings.memory)
    last = len(record.t_us) - N - 1
    if last <= min(first, len(record.t_us)):
        raise ValueError("the record is too short")
    at = np.unique(np.linspace(first, last, onsets).astype(np.int64))
    watch = (
        _Tests(model, settings, record, at) if limits is None else _Bank(model, settings, limits, record, at)
    )
    found = []
    for number, (fault, load, u, y) in enumerate(inject(model, settings, record, faults, at, N)):
        delays, names, directions = zip(*watch.first_alarms(u, y, N), strict=True)
        peak = math.nan if load is None else float(np.abs(u).max())
        found.append(TrialResult(fault, load is not None, np.array(delays), names, directions, peak))
        progress((number + 1) / len(faults))
    return found, len(at)


def inject(
    model: AxisModel, settings: Settings, record: SampleBlock, faults: Sequence[Fault], at: Ints, N: int
) -> Iterator[tuple[Fault, EquivalentLoad | None, Floats, Floats | None]]:
    """Each fault, injected into the record.

    Yields the equivalent load of the fault where that is known exactly, with the torque of the whole record under it;
    otherwise the outputs (N, onsets) from each onset on.
    """
    before = innovations(model, settings, record, at.tolist())
    u_scale = Assembly(model.drive, model.monitored).model_constants(model, settings.speed_scale)["u_scale"]
    for fault in faults:
        values = changed_values(model, fault.parameter, fault.size)
        load = equivalent_load(model, values)
        if load is not None:
            yield fault, load, faulty_torque(model, settings, record, load, u_scale), None
        else:
            plants = Plants(model, settings, [model.nominal, values])
            yield fault, None, record.u, _faulty_outputs(plants, record, at, N, before)


def _faulty_outputs(plants: Plants, record: SampleBlock, at: Ints, N: int, before: Innovations) -> Floats:
    """Outputs (N, onsets) of the record, changed by the difference that the model predicts for the fault.

    The first of the plants is healthy, the second faulty.
    """
    rows = np.arange(N)[:, np.newaxis] + at
    u, e = record.u[rows], np.nan_to_num(before.eps[rows])
    healthy, u_before = np.zeros(len(at), np.int64), record.u[at - 1]
    # Until the onset the previous torque acts, on the healthy drive.
    older, nothing = record.u[np.maximum(at - 2, 0)], np.zeros((1, len(at)))
    _, x = plants.run(healthy, before.x, older, u_before[np.newaxis], nothing)
    without, _ = plants.run(healthy, x, u_before, u, e)
    with_fault, _ = plants.run(healthy + 1, x, u_before, u, e)
    return np.asarray(record.y[rows] + with_fault - without)


def _states(record: SampleBlock, at: Ints, after: Callable[[SampleBlock], T]) -> list[T]:
    """States of a detector just before each of these samples, ``after`` it has run a part of the record."""
    return [after(record.select(slice(*ends))) for ends in pairwise([0, *at.tolist()])]


class _Tests:
    """The CUSUM tests, started from the states of the healthy monitor at the onsets ``at``."""

    def __init__(self, model: AxisModel, settings: Settings, record: SampleBlock, at: Ints) -> None:
        self._record, self._at, self._interval_s = record, at, settings.interval_s
        self._batch = AxisBatch([model] * LANES, [settings] * LANES)
        self._healthy = AxisMonitor(model, settings)
        self._before = _states(record, at, self._state_after)

    def _state_after(self, part: SampleBlock) -> tuple[Floats, Ints]:
        self._healthy.update(part)
        return self._healthy.batch.column(0)

    def first_alarms(self, u: Floats, y: Floats | None, N: int) -> list[FirstAlarm]:
        """The first alarm within N samples after each onset; u of the whole record, y (N, onsets) or the recorded."""
        return [
            alarm
            for begin in range(0, len(self._at), LANES)
            for alarm in self._in_lanes(begin, u, None if y is None else y[:, begin : begin + LANES], N)
        ]

    def _in_lanes(self, begin: int, u: Floats, y: Floats | None, N: int) -> list[FirstAlarm]:
        record, onsets = self._record, self._at[begin : begin + LANES]
        lanes = np.minimum(np.arange(LANES), len(onsets) - 1)  # unused lanes repeat the last one
        for a in range(LANES):
            self._batch.restore(a, *self._before[begin + lanes[a]])
        found: dict[int, FirstAlarm] = {}
        for rows in np.array_split(np.arange(N), PARTS):
            part = record._replace(u=u).select(rows[:, np.newaxis] + onsets[lanes])
            outputs = part.y if y is None else y[np.ix_(rows, lanes)]
            shift = None if part.shift is None else np.moveaxis(part.shift, 1, 2)
            for a, event in self._batch.run(part.t_us, part.u, outputs, None, shift, part.gate):
                if a < len(onsets) and a not in found and isinstance(event, Crossing):
                    delay = (event.time_us - int(record.t_us[onsets[a]])) * 1e-6 + self._interval_s
                    found[a] = FirstAlarm(delay, event.parameter, event.direction)
            if len(found) == len(onsets):
                break
        return [found.get(a, FirstAlarm()) for a in range(len(onsets))]


class _Bank:
    """The multi-model detector, started from the states of a bank that does not alarm at the onsets ``at``."""

    def __init__(
        self, model: AxisModel, settings: Settings, limits: Sequence[Limit], record: SampleBlock, at: Ints
    ) -> None:
        self._record, self._at = record, at
        self._bank = bank_of(model, settings, Limits(1.0, tuple(limits)))
        self._quiet = HypothesisBank(model, settings, self._bank.hypotheses, allowance=self._bank.allowance)
        self._before = _states(record, at, self._state_after)

    def _state_after(self, part: SampleBlock) -> tuple[Memory, tuple[int, ...]]:
        """State, and the steps by which the nominal values had moved."""
        self._quiet.run(*part[:5])
        return self._quiet.memory, self._quiet.moved

    def first_alarms(self, u: Floats, y: Floats | None, N: int) -> list[FirstAlarm]:
        """As ``_Tests.first_alarms``."""
        return [self._first_alarm(k, u, None if y is None else y[:, k], N) for k in range(len(self._at))]

    def _first_alarm(self, k: int, u: Floats, y: Floats | None, N: int) -> FirstAlarm:
        record, bank, at = self._record, self._bank, int(self._at[k])
        memory, moved = self._before[k]
        bank.reset()
        bank.follow(moved)
        bank.memory = memory
        first = FirstAlarm()
        for rows in np.array_split(np.arange(at, at + N), BANK_PARTS):
            part = record._replace(u=u).select(rows)
            part = part if y is None else part._replace(y=y[rows - at])
            for event in bank.run(*part[:5]):
                if isinstance(event, ChangeDetected) and not first.name:
                    delay = float(event.time_us - record.t_us[at]) * 1e-6 + bank.settings.interval_s
                    first = FirstAlarm(delay, *_name(event.shares[0]))
                elif isinstance(event, CauseIdentified):
                    return FirstAlarm(first.delay_s, *_name(event.shares[0]))
        return first


def _name(share: Share) -> tuple[str, str]:
    return share.cause, direction_of(share.size) if share.cause else ""
