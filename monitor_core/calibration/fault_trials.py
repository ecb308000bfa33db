"""Trials of faults injected at many onsets of a healthy record: detection delay and name of the alarm."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.healthy_records import first_tested
from monitor_core.calibration.injection import InjectedFault, inject
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.detection import Crossing
from monitor_core.detection.alarm import direction_of
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.multimodel_detector import MultiModelThresholds, bank_of
from monitor_core.detection.multimodel.naming import CauseIdentified, ChangeDetected
from monitor_core.kernel.hypotheses import Memory
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock

PARTS = 20
"""The samples after an onset are run in this number of parts; after the name is known, the rest is skipped."""
PROBES = 20
"""Number of onsets at which the multi-model detector is tried first."""


@dataclass(frozen=True)
class TrialResult:
    """Detection of one fault, at each onset.

    ``exact``: the fault was injected by the torque that the same motion would have needed; otherwise it was simulated
    with the identified model.  ``torque_peak``: the largest torque needed, if ``exact``.
    """

    fault: InjectedFault
    exact: bool
    delay_s: Floats  # (onsets,) time until the first alarm; inf: no alarm
    first: tuple[str, ...]  # (onsets,) name of the first alarm; "": no alarm
    direction: tuple[str, ...]  # (onsets,) "up", "down" or ""
    torque_peak: float
    causes: tuple[Mapping[str, float], ...] = ()
    """(onsets,) probabilities of the causes, of the multi-model detector; empty where the alarm got no name"""

    def found_within(self, seconds: float) -> float:
        """Share of the onsets with an alarm within this time."""
        return float(np.mean(self.delay_s <= seconds))

    def delay(self, share: float) -> float:
        """Time within which this share of the onsets has an alarm; inf: not within the watched time."""
        ordered = np.sort(self.delay_s)
        return float(ordered[min(len(ordered) - 1, max(0, int(np.ceil(share * len(ordered))) - 1))])


class FirstAlarm(NamedTuple):
    """The first alarm after an onset: its delay [s], its name, "up", "down" or "", and probabilities of its causes."""

    delay_s: float = math.inf
    name: str = ""
    direction: str = ""
    causes: Mapping[str, float] = MappingProxyType({})


def run_trials(
    axis: MonitoredAxis,
    record: SampleBlock,
    faults: Sequence[InjectedFault],
    onsets: int,
    seconds: float,
    thresholds: MultiModelThresholds | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[list[TrialResult], int]:
    """Start each fault at ``onsets`` samples of the record, and run a detector for ``seconds`` after each onset.

    The detector is the CUSUM tests, or the multi-model detector with these ``thresholds``; then ``first`` is its final
    name.  If a change is found at no onset, smaller ones of the same parameter and direction are not tried and count as
    not found.

    Returns the results, and the number of onsets that were possible.

    Raises:
        ValueError: the record is too short.
    """
    N = round(seconds / axis.settings.interval_s)
    first = first_tested(AxisMonitor(*axis), record) + round(3 * axis.settings.memory)
    last = len(record.t_us) - N - 1
    if last <= min(first, len(record.t_us)):
        raise ValueError("the record is too short")
    at = np.unique(np.linspace(first, last, onsets).astype(np.int64))
    detector: _Tests | _Bank = _Tests(axis, record, at) if thresholds is None else _Bank(axis, thresholds, record, at)
    results, not_found = dict[InjectedFault, TrialResult](), set[tuple[str, bool]]()
    by_size = sorted(faults, key=lambda fault: -abs(fault.size))
    for number, (fault, load, u, y) in enumerate(inject(axis, record, by_size, at, N)):
        kind = fault.parameter, fault.size > 0
        alarms = [FirstAlarm()] * len(at)
        if kind not in not_found:
            windows = [record._replace(u=u).select(slice(k, k + N)) for k in at.tolist()]
            if y is not None:
                windows = [window._replace(y=y[:, k]) for k, window in enumerate(windows)]
            alarms = detector.first_alarms(windows)
        delays, names, directions, causes = zip(*alarms, strict=True)
        if not any(map(math.isfinite, delays)):
            not_found.add(kind)
        peak = math.nan if load is None else float(np.abs(u).max())
        results[fault] = TrialResult(fault, load is not None, np.array(delays), names, directions, peak, causes)
        progress((number + 1) / len(faults))
    return [results[fault] for fault in faults], len(at)


class _Tests:
    """The CUSUM tests from each onset on, side by side."""

    def __init__(self, axis: MonitoredAxis, record: SampleBlock, at: Ints) -> None:
        model, settings = axis
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
    """Crossings of each axis of a batch in its block; all blocks must have the same arrays."""
    columns = {
        name: np.stack([getattr(block, name) for block in blocks], axis=-1)
        for name in ("t_us", "u", "y", "shift", "gate", "weight")
        if getattr(blocks[0], name) is not None
    }
    return batch.crossings(**columns)


class _Bank:
    """The multi-model detector from each onset on, one after the other."""

    def __init__(self, axis: MonitoredAxis, thresholds: MultiModelThresholds, record: SampleBlock, at: Ints) -> None:
        self._interval_s = axis.settings.interval_s
        self._bank = bank_of(*axis, thresholds)
        healthy = HypothesisBank(*axis, self._bank.hypotheses, allowance=self._bank.allowance)
        self._states = list[tuple[Memory, tuple[int, ...]]]()
        for ends in pairwise([0, *at.tolist()]):
            healthy.run(record.select(slice(*ends)))
            self._states.append((healthy.memory, healthy.moved))

    def first_alarms(self, windows: Sequence[SampleBlock]) -> list[FirstAlarm]:
        """The first alarm in the samples after each onset, with its final name if that comes within them.

        If there is no alarm at any of ``PROBES`` onsets over the record, the others are taken to have none: trials
        without an alarm take longest.
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
                    causes = {cause.cause: cause.probability for cause in event.shares}
                    return FirstAlarm(delay_s, share.cause, direction, causes)
        return first


def _delay_s(samples: SampleBlock, time_us: int, interval_s: float) -> float:
    """Time [s] from the onset, one interval before the first of these samples, to an alarm."""
    return float(time_us - samples.t_us[0]) * 1e-6 + interval_s
