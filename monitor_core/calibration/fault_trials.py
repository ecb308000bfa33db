"""Faults injected at many onsets of a healthy record: when a detector detects them, and under which name."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.healthy_records import first_tested
from monitor_core.calibration.injection import EquivalentLoad, changed_values, equivalent_load, faulty_torque
from monitor_core.calibration.simulated_copies import Innovations, Plants, innovations
from monitor_core.detection import Crossing
from monitor_core.detection.alarm import direction_of
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.multimodel_detector import Limit, Limits, bank_of
from monitor_core.detection.multimodel.naming import CauseIdentified, ChangeDetected
from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.hypotheses import Memory
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

PARTS = 20
"""Of the time that is watched: where the cause is named, the rest is left out."""
PROBES = 20
"""Onsets at which the multi-model detector is tried first."""


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
    Where a change is found at no onset, smaller ones of the same parameter and direction are not tried: they count as
    not found.

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
    detector: _Tests | _Bank = (
        _Tests(model, settings, record, at) if limits is None else _Bank(model, settings, limits, record, at)
    )
    results, not_found = dict[Fault, TrialResult](), set[tuple[str, bool]]()
    by_size = sorted(faults, key=lambda fault: -abs(fault.size))
    for number, (fault, load, u, y) in enumerate(inject(model, settings, record, by_size, at, N)):
        kind = fault.parameter, fault.size > 0
        alarms = [FirstAlarm()] * len(at)
        if kind not in not_found:
            windows = [record._replace(u=u).select(slice(k, k + N)) for k in at.tolist()]
            if y is not None:
                windows = [window._replace(y=y[:, k]) for k, window in enumerate(windows)]
            alarms = detector.first_alarms(windows)
        delays, names, directions = zip(*alarms, strict=True)
        if not any(map(math.isfinite, delays)):
            not_found.add(kind)
        peak = math.nan if load is None else float(np.abs(u).max())
        results[fault] = TrialResult(fault, load is not None, np.array(delays), names, directions, peak)
        progress((number + 1) / len(faults))
    return [results[fault] for fault in faults], len(at)


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
    weight = None if record.weight is None else record.weight[rows]
    without, _ = plants.run(healthy, x, u_before, u, e, weight)
    with_fault, _ = plants.run(healthy + 1, x, u_before, u, e, weight)
    return np.asarray(record.y[rows] + with_fault - without)


class _Tests:
    """The CUSUM tests from each onset on, side by side."""

    def __init__(self, model: AxisModel, settings: Settings, record: SampleBlock, at: Ints) -> None:
        self._interval_s = settings.interval_s
        healthy = AxisBatch([model], [settings])
        self._columns = []
        for ends in pairwise([0, *at.tolist()]):
            _crossings(healthy, [record.select(slice(*ends))])
            self._columns.append(healthy.column(0))
        self._batch = AxisBatch([model] * len(at), [settings] * len(at))

    def first_alarms(self, windows: Sequence[SampleBlock]) -> list[FirstAlarm]:
        """The first alarm in the samples after each onset."""
        for a, column in enumerate(self._columns):
            self._batch.restore(a, *column)
        first = dict[int, FirstAlarm]()
        for rows in np.array_split(np.arange(windows[0].size), PARTS):
            for a, crossing in _crossings(self._batch, [window.select(rows) for window in windows]):
                delay_s = _delay_s(windows[a], crossing.time_us, self._interval_s)
                first.setdefault(a, FirstAlarm(delay_s, crossing.parameter, crossing.direction))
            if len(first) == len(windows):
                break
        return [first.get(a, FirstAlarm()) for a in range(len(windows))]


def _crossings(batch: AxisBatch, blocks: Sequence[SampleBlock]) -> list[tuple[int, Crossing]]:
    """What the tests of each axis of a batch find in its block; all blocks have the same arrays."""
    together = {
        name: np.stack([getattr(block, name) for block in blocks], axis=-1)
        for name in ("t_us", "u", "y", "shift", "gate", "weight")
        if getattr(blocks[0], name) is not None
    }
    return batch.crossings(**together)


class _Bank:
    """The multi-model detector from each onset on, one after the other."""

    def __init__(
        self, model: AxisModel, settings: Settings, limits: Sequence[Limit], record: SampleBlock, at: Ints
    ) -> None:
        self._interval_s = settings.interval_s
        self._bank = bank_of(model, settings, Limits(1.0, tuple(limits)))
        healthy = HypothesisBank(model, settings, self._bank.hypotheses, allowance=self._bank.allowance)
        self._states = list[tuple[Memory, tuple[int, ...]]]()
        for ends in pairwise([0, *at.tolist()]):
            healthy.run(record.select(slice(*ends)))
            self._states.append((healthy.memory, healthy.moved))

    def first_alarms(self, windows: Sequence[SampleBlock]) -> list[FirstAlarm]:
        """The first alarm in the samples after each onset, with its final name if that comes within them.

        Where none of ``PROBES`` onsets over the record has one, the others are taken to have none: to watch in vain
        takes longest.
        """
        onsets = range(len(windows))
        first = {k: self._first_alarm(k, windows[k]) for k in onsets[:: max(1, len(windows) // PROBES)]}
        if any(math.isfinite(alarm.delay_s) for alarm in first.values()):
            first |= {k: self._first_alarm(k, windows[k]) for k in onsets if k not in first}
        return [first.get(k, FirstAlarm()) for k in onsets]

    def _first_alarm(self, onset: int, samples: SampleBlock) -> FirstAlarm:
        bank = self._bank
        memory, moved = self._states[onset]
        bank.reset()
        bank.follow(moved)
        bank.memory = memory
        first = FirstAlarm()
        for rows in np.array_split(np.arange(samples.size), PARTS):
            for event in bank.run(samples.select(rows)):
                if not isinstance(event, ChangeDetected | CauseIdentified):
                    continue
                share, delay_s = event.shares[0], first.delay_s
                direction = direction_of(share.size) if share.cause else ""
                if not first.name:
                    delay_s = _delay_s(samples, event.time_us, self._interval_s)
                    first = FirstAlarm(delay_s, share.cause, direction)
                if isinstance(event, CauseIdentified):
                    return FirstAlarm(delay_s, share.cause, direction)
        return first


def _delay_s(samples: SampleBlock, time_us: int, interval_s: float) -> float:
    """Time from the onset, which is an interval before the first of these samples, to an alarm."""
    return float(time_us - samples.t_us[0]) * 1e-6 + interval_s
