"""Checks of healthy records: they must be long enough, have excitation, and contain no change of the axis."""

import math
from collections.abc import Sequence

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.calibration.budget import Rates
from monitor_core.calibration.healthy_records import RecordDeviations, first_tested
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.scatter import SAMPLES_PER_MEMORY, Scatter, binned, looked_at
from monitor_core.drive.structure import LOAD
from monitor_core.monitoring.axis_monitor import AxisMonitor
from monitor_core.monitoring.axis_status import unidentifiable_words
from monitor_core.monitoring.not_tested import SEEDING_MEMORIES, fitting_memory
from monitor_core.monitoring.recommended_settings import time_constant
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from monitor_core.wording import duration, listed, rounded_up

MIN_MEMORIES = 20
"""Least number of memories of tested samples."""
LEAST_TESTED = 0.5
"""Least share of tested samples among those after P(0) was found."""
MIN_STEP_SIGMAS = 5.0
"""Standard deviations of the estimate: a larger change inside a record, or a larger constant deviation, is a fault."""
MIN_FAULT = 0.1
"""A deviation, constant or from some time on, is a fault only beyond this share of the size: the allowance of the tests
covers a smaller one.  No nominal values are exact, and another program shows another part of their errors."""
_MIN_MEAN_SIGMAS = 6.0
"""Standard deviations of the difference of two means: a larger difference is not chance."""
MIN_WITHIN_MEMORIES = 2.0
_EDGE_MEMORIES = 5
"""Memories at each end of a record that are not searched for a change."""
MAX_RATE_RATIO = 1000.0
"""Largest ratio of the upper bound of the rate to the most likely rate with which a calibration is accepted.  For a
long budget it is the square root of the budget in memories, if that is larger: a record of minutes cannot support a
year better."""


_COPIED_MEMORIES = 4
"""Fewest memories of a record, after its tests begin, that can be copied: copies must forget their start"""


class CalibrationError(Exception):
    """Records that yield no thresholds; the text says why, with numbers, and what would be right.

    Attributes:
        budget_s: time between false alarms [s] that the records would support as a budget; None: not known.
        memory_s: memory for which the records would suffice [s]; None: not known.
        joint_state: whether that memory needs ``joint_state = true``.
        without: parameters that the records do not determine; without them the records may suffice.
        misfit: whether the nominal values do not fit the records, as values that were found from them do not if the
            drive lacks something.
        changes: whether a parameter changes within a record.
        reason: the text without what would be right.
    """

    def __init__(
        self,
        text: str,
        budget_s: float | None = None,
        memory_s: float | None = None,
        joint_state: bool = False,
        without: Sequence[str] = (),
        misfit: bool = False,
        changes: bool = False,
        advice: str = "",
    ) -> None:
        super().__init__(f"{text}; {advice}" if advice else text)
        self.reason = text
        self.budget_s = budget_s
        self.memory_s = memory_s
        self.joint_state = joint_state
        self.without = tuple(without)
        self.misfit = misfit
        self.changes = changes


def check_settings(settings: Settings) -> None:
    """Check that the settings allow tests.

    Raises:
        CalibrationError: some nominal values cannot be distinguished.
    """
    for words in unidentifiable_words(settings.unidentifiable):
        raise CalibrationError(words)


def check_within(settings: Settings, within_s: float) -> None:
    """Check that the memory is short enough to find a change within ``within_s`` seconds.

    Raises:
        CalibrationError: it is too long.
    """
    memory_s = settings.memory * settings.interval_s
    if within_s < MIN_WITHIN_MEMORIES * memory_s:
        raise CalibrationError(
            f"--within {within_s:g}: the memory is {memory_s:.3g} s, and a reliable test needs at least twice that,"
            f" {MIN_WITHIN_MEMORIES * memory_s:.3g} s; give at least that, or a shorter memory_s"
        )


def check_records(axis: MonitoredAxis, found: Sequence[RecordDeviations]) -> None:
    """Check that the records are long enough and move the axis.

    Raises:
        CalibrationError: the records are too short, or the axis moves too little.
    """
    tested = np.concatenate([deviations.tested for deviations in found])
    after = len(tested) - sum(deviations.seeding + deviations.gated for deviations in found)
    if not tested.any():
        _check_tests_begin(axis, found, len(tested), after)
    _check_observed(axis, found, tested, after)
    _check_length(axis, found, tested)


def check_longest(axis: MonitoredAxis, records: Sequence[SampleBlock]) -> None:
    """Check that one record is long enough for copies of it: each begins with an unknown P(0).

    Raises:
        CalibrationError: all are too short.
    """
    h, memory = axis.settings.interval_s, axis.settings.memory
    for record in records:
        start = first_tested(AxisMonitor(*axis.without_tests), record)
        left = record.size - start if record.gate is None else np.count_nonzero(record.gate[start:])
        if left >= _COPIED_MEMORIES * memory:
            return
    needed_s = axis.settings.settle_s + (SEEDING_MEMORIES + _COPIED_MEMORIES) * memory * h
    raise CalibrationError(
        f"the longest record holds {max(record.size for record in records) * h:.3g} s, and one of at least"
        f" {rounded_up(needed_s):g} s that move the axis is needed: join the files of one recording, or set a shorter"
        " memory_s"
    )


def _check_tests_begin(axis: MonitoredAxis, found: Sequence[RecordDeviations], count: int, after: int) -> None:
    """Check that the records are long enough to find P(0), and that they determine all parameters."""
    model, settings = axis
    h, memory = settings.interval_s, settings.memory
    if uncertain := found[-1].uncertain:
        raise CalibrationError(
            f"P(0) was not found, because {listed(uncertain)} cannot be determined within a memory of"
            f" {memory * h:.3g} s: take {'it' if len(uncertain) == 1 else 'them'} out of `monitor`, raise memory_s, or"
            " give motion that accelerates and has several speeds within memory_s",
            without=uncertain,
        )
    if after < memory:
        needed = SEEDING_MEMORIES + MIN_MEMORIES + 1
        settling_s = len(found) * settings.settle_s
        slowest_s = time_constant(model, h, settings.K)
        shorter, joint = fitting_memory(slowest_s, settings, (count * h - settling_s) / needed)
        ways = [f"give at least {rounded_up(settling_s + needed * memory * h):g} s that move the axis"]
        if shorter is not None:
            ways.append(f"set memory_s = {shorter:g}{' and joint_state = true' if joint else ''}")
        raise CalibrationError(
            f"the records hold {count * h:.3g} s, which is too short for the tests to begin: that takes ten"
            f" memories of {memory * h:.3g} s of motion; {', or '.join(ways)}",
            memory_s=shorter,
            joint_state=joint,
        )


def _check_observed(axis: MonitoredAxis, found: Sequence[RecordDeviations], tested: Bools, after: int) -> None:
    """Check that each parameter is observed for most of the time."""
    h = axis.settings.interval_s
    for i, name in enumerate(axis.model.monitored):
        share = tested[:, i].sum() / max(after, 1)
        if share < LEAST_TESTED:
            hints = "".join(f"; {words}" for deviations in found for words in deviations.confounded[:2])
            raise CalibrationError(
                f"{name} is observed in {100 * share:.0f} % of the time after the start, {tested[:, i].sum() * h:.3g}"
                f" of {after * h:.3g} s{hints}: give records that move the axis as in operation",
                without=(name,),
            )


def _check_length(axis: MonitoredAxis, found: Sequence[RecordDeviations], tested: Bools) -> None:
    """Check that all parameters together are tested for long enough."""
    model, settings = axis
    h, memory = settings.interval_s, settings.memory
    tested_samples = tested.all(axis=1).sum()
    if tested_samples < MIN_MEMORIES * memory:
        # With another memory, P(0) takes another part of the records.
        slowest_s = time_constant(model, h, settings.K)
        usable_s = (tested_samples + SEEDING_MEMORIES * memory * len(found)) * h
        memories = MIN_MEMORIES + SEEDING_MEMORIES * len(found)
        shorter, joint = fitting_memory(slowest_s, settings, usable_s / (memories + 1))
        way = "" if shorter is None else f", or memory_s = {shorter:g}{' with joint_state = true' if joint else ''}"
        gated = sum(deviations.gated for deviations in found)
        in_all_s = memories * memory * h * len(tested) / (len(tested) - gated)
        in_all = (
            f"; the axis is at rest, or a gate is closed, for {100 * gated / len(tested):.0f} % of the time, so give"
            f" records of about {duration(in_all_s)}"
        )
        raise CalibrationError(
            f"{tested_samples * h:.3g} s of the records can be used, {tested_samples / memory:.0f} memories of"
            f" {memory * h:.3g} s: at least {MIN_MEMORIES} are needed,"
            f" {MIN_MEMORIES * memory * h:.3g} s{in_all if gated else ''}{way}",
            memory_s=shorter,
            joint_state=joint,
        )


def check_healthy(axis: MonitoredAxis, found: Sequence[RecordDeviations]) -> None:
    """Check that no parameter changes inside a record, and that the nominal values fit the axis.

    Raises:
        CalibrationError: a parameter changes, or deviates throughout.
    """
    for deviations in found:
        _check_no_change(axis, deviations)
    _check_no_offset(axis, found)


def _check_no_change(axis: MonitoredAxis, deviations: RecordDeviations) -> None:
    model, settings = axis
    use = looked_at(deviations, settings.memory)
    d = deviations.d[use]
    n, edge = len(d), _EDGE_MEMORIES * SAMPLES_PER_MEMORY
    if n < 4 * edge:
        return
    changes = []
    # What the nominal values are known to be off by, beside the heat, changes with it.
    least = np.maximum(MIN_FAULT, settings.model_errors(d.shape[1]))
    for i in range(d.shape[1]):
        k, step, sd = _largest_step(d[:, i], edge)
        sure = abs(step) / (sd * math.sqrt(2 * SAMPLES_PER_MEMORY * (1 / k + 1 / (n - k))))
        if abs(step) > max(MIN_STEP_SIGMAS * sd, least[i]) and sure > _MIN_MEAN_SIGMAS:
            changes.append((abs(step) / sd, i, k, step))
    if not changes:
        return
    ratio, i, k, step = max(changes, key=lambda change: change[0])
    # The estimate has changed by half within a memory of the fault.
    at = max(0, k - round(0.7 * SAMPLES_PER_MEMORY))
    seconds = (deviations.t_us[use[at]] - deviations.t_us[0]) * 1e-6
    unit, name = model.parameters[i].unit, model.monitored[i]
    # Another payload is no fault of the axis; without it the rest may be healthy.
    of_payload = f", or take {LOAD} out of `monitor`" if name == LOAD else ""
    raise CalibrationError(
        f"{deviations.name}: {name} changes by {step * model.scale[i]:+.3g}"
        f"{'' if unit == '1' else f' {unit}'}"
        f" ({100 * step:+.1f} % of its size, {ratio:.0f} standard deviations of the estimate) about {seconds:.4g} s"
        f" after the beginning: this is no healthy record. Use only the part before the change, as with"
        f" {deviations.name}@0:{max(seconds - 1, 0):.0f}{of_payload}",
        without=(name,) if name == LOAD else (),
        changes=True,
    )


def _largest_step(d: Floats, edge: int) -> tuple[int, float, float]:
    """Index of the most significant step of the mean, its size, and the standard deviation on each side."""
    n = len(d)
    k = np.arange(edge, n - edge)
    total = np.cumsum(d)
    before, after = total[k - 1] / k, (total[-1] - total[k - 1]) / (n - k)
    best = int(np.argmax(np.abs(after - before) * np.sqrt(k * (n - k))))
    at = int(k[best])
    ends = np.concatenate(
        [
            d[: max(at - SAMPLES_PER_MEMORY, 2)] - d[: max(at - SAMPLES_PER_MEMORY, 2)].mean(),
            d[at + SAMPLES_PER_MEMORY :] - d[at + SAMPLES_PER_MEMORY :].mean(),
        ]
    )
    return at, float(after[best] - before[best]), float(ends.std())


def _check_no_offset(axis: MonitoredAxis, found: Sequence[RecordDeviations]) -> None:
    d = np.concatenate([binned(deviations, axis.settings.memory)[:, 0] for deviations in found])
    mean, sd = d.mean(axis=0), d.std(axis=0)
    for i in np.argsort(-abs(mean) / sd).tolist():
        if abs(mean[i]) > max(MIN_STEP_SIGMAS * sd[i], MIN_FAULT):
            raise CalibrationError(
                f"{axis.model.monitored[i]} differs from its nominal value throughout,"
                f" by {100 * mean[i]:+.1f} % of its size,"
                f" {abs(mean[i]) / sd[i]:.0f} standard deviations of the estimate: the nominal values do not fit these"
                " records",
                misfit=True,
                advice="identify the axis with them first",
            )


def check_promise(scatter: Scatter, rates: Rates, alone: Rates, samples: float, interval_s: float) -> None:
    """Check that records of this length can support the budget.

    The copies rely on the model, so the rates from the records ``alone`` must not contradict them.

    Raises:
        CalibrationError: the records cannot support the budget.
    """
    most = max(rates.upper, alone.upper) / rates.total
    widest = max(MAX_RATE_RATIO, math.sqrt(samples / scatter.memory))
    if most <= widest and math.isfinite(rates.upper) and rates.upper * samples <= 1.5:
        return
    seconds = scatter.memories * scatter.memory * interval_s
    # The uncertainty of the log rate is proportional to the log of the budget over the root of the length.
    log = math.log(max(samples / scatter.memory, math.e))
    width = max(math.log(max(most, 1.0 + 1e-9)), 1e-9) if math.isfinite(most) else 2 * math.log(widest)
    longer = seconds * max(1.5, (width / math.log(widest)) ** 2)
    budget_s = scatter.memory * interval_s * math.exp(log * min(0.9, math.log(widest) / width))
    raise CalibrationError(
        f"{seconds:.3g} s of the records can be used, {scatter.memories:.0f} memories: too short to promise one false"
        f" alarm in {duration(samples * interval_s)}. The true rate may be {_times(most)} times the estimated one. Give"
        f" about {duration(longer)}, or a budget of one in {duration(budget_s)}",
        budget_s,
    )


def _times(most: float) -> str:
    return f"{float(f'{most:.1g}'):,.0f}" if math.isfinite(most) else "any number of"
