"""Faults injected at many onsets of a healthy record: detection by the multi-model detector."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.fault_trials import Fault, TrialResult, inject, onset_samples
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.multimodel_detector import Limit, Limits, bank_of
from monitor_core.detection.multimodel.multimodel_events import CauseIdentified, ChangeDetected
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.hypotheses import Memory
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

PARTS = 20
"""In which a fault is watched: from one in which it is named on no more."""


class _FirstAlarm(NamedTuple):
    """The first alarm, s after the onset; its final name, or its first one if it was not named."""

    delay_s: float = math.inf
    cause: str = ""
    size: float = 0.0


class _HealthyState(NamedTuple):
    """State of a bank, and the steps by which its nominal values had moved."""

    memory: Memory
    moved: tuple[int, ...]


def run_multimodel_trials(
    model: AxisModel,
    settings: Settings,
    own: Sequence[Limit],
    record: SampleBlock,
    faults: Sequence[Fault],
    onsets: int,
    seconds: float,
    progress: Callable[[float], None] = lambda _: None,
) -> list[TrialResult]:
    """As ``run_trials``, by the multi-model detector with these limits; ``first`` is the cause that it names.

    Raises:
        ValueError: the record is too short for that.
    """
    N = round(seconds / settings.interval_s)
    at = onset_samples(model, settings, record, onsets, N)
    bank = bank_of(model, settings, Limits(1.0, tuple(own)))
    before = _healthy_states(bank, record, at)
    found = []
    for number, (fault, load, u, y) in enumerate(inject(model, settings, record, faults, at, N)):
        firsts = [
            _first_alarm(bank, record, u, None if y is None else y[:, k], int(a), N, before[k])
            for k, a in enumerate(at.tolist())
        ]
        found.append(
            TrialResult(
                fault,
                load is not None,
                np.array([first.delay_s for first in firsts]),
                tuple(first.cause for first in firsts),
                tuple("" if not first.cause else "down" if first.size < 0 else "up" for first in firsts),
                float(np.abs(u).max()) if load is not None else math.nan,
            )
        )
        progress((number + 1) / len(faults))
    return found


def _healthy_states(bank: HypothesisBank, record: SampleBlock, at: Ints) -> list[_HealthyState]:
    """States of the healthy bank just before each of these samples; none of its hypotheses alarms before."""
    quiet = HypothesisBank(bank.model, bank.settings, bank.hypotheses, allowance=bank.allowance)
    done, found = 0, []
    for end in at.tolist():
        part = record.select(slice(done, end))
        quiet.run(part.t_us, part.u, part.y, part.gate, part.shift)
        found.append(_HealthyState(quiet.memory, quiet.moved))
        done = end
    return found


def _first_alarm(
    bank: HypothesisBank,
    record: SampleBlock,
    u: Floats,
    y: Floats | None,
    at: int,
    N: int,
    before: _HealthyState,
) -> _FirstAlarm:
    bank.reset()
    bank.follow(before.moved)
    bank.memory = before.memory
    first = _FirstAlarm()
    for rows in np.array_split(np.arange(at, at + N), PARTS):
        outputs = record.y[rows] if y is None else y[rows - at]
        gate = None if record.gate is None else record.gate[rows]
        shift = None if record.shift is None else record.shift[rows]
        for event in bank.run(record.t_us[rows], u[rows], outputs, gate, shift):
            if isinstance(event, ChangeDetected) and not first.cause:
                delay = float(event.time_us - record.t_us[at]) * 1e-6 + bank.settings.interval_s
                first = _FirstAlarm(delay, event.shares[0].cause, event.shares[0].size)
            elif isinstance(event, CauseIdentified):
                return first._replace(cause=event.shares[0].cause, size=event.shares[0].size)
    return first
