"""Faults injected at many onsets of a healthy record: when a detector detects them, and under which name."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.healthy_records import first_tested
from monitor_core.calibration.injection import EquivalentLoad, changed_values, equivalent_load, faulty_torque
from monitor_core.calibration.simulated_copies import Innovations, Plants, innovations
from monitor_core.detection import Crossing
from monitor_core.detection.alarm import direction_of
from monitor_core.detection.cusum.cusum_evidence import BatchEvent
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
    detector = _Tests(model, settings) if limits is None else _Bank(model, settings, limits)
    resume = [detector.after(record.select(slice(*ends))) for ends in pairwise([0, *at.tolist()])]
    found = []
    for number, (fault, load, u, y) in enumerate(inject(model, settings, record, faults, at, N)):
        alarms = []
        for k, resume_at_onset in enumerate(resume):
            samples = record._replace(u=u).select(slice(at[k], at[k] + N))
            samples = samples if y is None else samples._replace(y=y[:, k])
            resume_at_onset()
            alarms.append(_first_alarm(detector, samples, settings.interval_s))
        delays, names, directions = zip(*alarms, strict=True)
        peak = math.nan if load is None else float(np.abs(u).max())
        found.append(TrialResult(fault, load is not None, np.array(delays), names, directions, peak))
        progress((number + 1) / len(faults))
    return found, len(at)


def _first_alarm(detector: _Tests | _Bank, samples: SampleBlock, interval_s: float) -> FirstAlarm:
    """The first alarm in these samples, with its final name if that comes within them."""
    first = FirstAlarm()
    for rows in np.array_split(np.arange(samples.size), PARTS):
        for t_us, name, direction, is_final in detector.run(samples.select(rows)):
            delay_s = first.delay_s
            if not first.name:
                delay_s = float(t_us - samples.t_us[0]) * 1e-6 + interval_s
                first = FirstAlarm(delay_s, name, direction)
            if is_final:
                return FirstAlarm(delay_s, name, direction)
    return first


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


Alarm = tuple[int, str, str, bool]
"""Time [us], name, "up", "down" or "", and whether the name is final."""


class _Tests:
    """The CUSUM tests, from any state of the healthy monitor on."""

    def __init__(self, model: AxisModel, settings: Settings) -> None:
        self._batch = AxisBatch([model], [settings])

    def after(self, part: SampleBlock) -> Callable[[], None]:
        """Run a further part of the healthy record; what is returned goes back to the state after it."""
        self._run(part)
        return partial(self._batch.restore, 0, *self._batch.column(0))

    def run(self, samples: SampleBlock) -> Iterator[Alarm]:
        """Alarms in the next samples."""
        for _, event in self._run(samples):
            if isinstance(event, Crossing):
                yield event.time_us, event.parameter, event.direction, True

    def _run(self, samples: SampleBlock) -> list[tuple[int, BatchEvent]]:
        t_us, u, y = samples.t_us[:, np.newaxis], samples.u[:, np.newaxis], samples.y[:, np.newaxis]
        shift = None if samples.shift is None else samples.shift[..., np.newaxis]
        gate = None if samples.gate is None else samples.gate[:, np.newaxis]
        weight = None if samples.weight is None else samples.weight[:, np.newaxis]
        return self._batch.run(t_us, u, y, None, shift, gate, weight)


class _Bank:
    """The multi-model detector, from any state of a bank on that has not alarmed."""

    def __init__(self, model: AxisModel, settings: Settings, limits: Sequence[Limit]) -> None:
        self._bank = bank_of(model, settings, Limits(1.0, tuple(limits)))
        self._quiet = HypothesisBank(model, settings, self._bank.hypotheses, allowance=self._bank.allowance)

    def after(self, part: SampleBlock) -> Callable[[], None]:
        """As ``_Tests.after``."""
        self._quiet.run(*part[:6])
        return partial(self._resume, self._quiet.memory, self._quiet.moved)

    def _resume(self, memory: Memory, moved: tuple[int, ...]) -> None:
        self._bank.reset()
        self._bank.follow(moved)
        self._bank.memory = memory

    def run(self, samples: SampleBlock) -> Iterator[Alarm]:
        """As ``_Tests.run``."""
        for event in self._bank.run(*samples[:6]):
            if isinstance(event, ChangeDetected | CauseIdentified):
                share = event.shares[0]
                direction = direction_of(share.size) if share.cause else ""
                yield event.time_us, share.cause, direction, isinstance(event, CauseIdentified)
