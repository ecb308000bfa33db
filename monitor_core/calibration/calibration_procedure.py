"""Calibration: computes thresholds, and the faults that they detect, from healthy records and a false-alarm budget.

The steps: deviations of the estimates in the records (healthy_records.py) are checked (record_doubts.py).  Bootstrap
copies of the records (copy_excursions.py) give the tails of the CUSUM sums (false_alarm_tail.py), from which the
thresholds follow (budget.py).  Faults are injected into the longest record (fault_trials.py).  The multi-model detector
is calibrated with the same records and budget (multimodel_thresholds.py), and so are its probabilities of causes
(evidence_share.py).
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from monitor_core.calibration.budget import Rates, nu_over_sigma, rates, thresholds
from monitor_core.calibration.copy_excursions import SAMPLES
from monitor_core.calibration.evidence_share import SHARE_ONSETS, evidence_share
from monitor_core.calibration.fault_trials import TrialResult, run_trials
from monitor_core.calibration.healthy_records import deviations, time_with_standstill
from monitor_core.calibration.healthy_statistics import HealthyStatistics, healthy_statistics
from monitor_core.calibration.injection import InjectedFault, changed_values
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.multimodel_healthy import COPY_SAMPLES
from monitor_core.calibration.multimodel_thresholds import BankThresholds, bank_thresholds
from monitor_core.calibration.record_doubts import (
    check_healthy,
    check_longest,
    check_promise,
    check_records,
    check_settings,
    check_within,
)
from monitor_core.calibration.result import CalibrationResult, MultiModelCalibration
from monitor_core.detection.multimodel.multimodel_detector import MultiModelThresholds, reason_unavailable
from monitor_core.drive.axis_model import AxisModel
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings, Threshold

WITHIN_MEMORIES = 10.0
"""Changes are to be found within this number of memory lengths of tests, unless ``within_s`` is given."""
OBSERVED_SHARE = 2.0
"""Each change is observed for this multiple of that time."""

CalibrationProgress = Callable[[str, float, float], None]
"""Receives the name of the present step, the work done, and the total work."""
PartialProgress = Callable[[float], None]
"""Receives the completed share, 0 to 1."""
Task = Callable[[PartialProgress], BankThresholds | None]
Launcher = Callable[[Task], AbstractContextManager[Task]]
"""Starts a task, if possible on another core.  The context gives a function that waits for the result and reports
progress; leaving the context stops the task."""


@dataclass(frozen=True)
class CalibrationOptions:
    """Options of a calibration.

    Attributes:
        budget_s: mean time between false alarms of the axis that the thresholds must keep [s].
        within_s: time within which changes of the smallest possible size must be found [s]; None: ten memory lengths,
            in addition to the time in which gates and ``min_speed`` exclude the samples.
        sizes: changes to try, as shares of the size of the parameter, upwards and downwards.
        onsets: number of onsets in the record for each change.
        seed: seed of the bootstrap.
        copies: number of samples of bootstrap copies for the CUSUM tests.
        bank_copies: number of samples of bootstrap copies for the multi-model detector.
    """

    budget_s: float
    within_s: float | None = None
    sizes: tuple[float, ...] = (0.05, 0.1, 0.2, 0.3, 0.5)
    onsets: int = 100
    seed: int = 1
    copies: int = SAMPLES
    bank_copies: int = COPY_SAMPLES


def calibrate(
    model: AxisModel,
    settings: Settings,
    records: Sequence[SampleBlock],
    options: CalibrationOptions,
    progress: CalibrationProgress = lambda _step, _done, _total: None,
    launch: Launcher = nullcontext,
) -> CalibrationResult:
    """Find thresholds that keep a false-alarm budget, from records of the healthy axis.

    Args:
        model: the axis with its nominal values.
        settings: how the axis is monitored; thresholds in it are ignored.
        records: healthy records, preferably with the motion that will be monitored; ten minutes are good.
        options: the budget, and which changes to try.
        progress: called with the present step.
        launch: starts the calibration of the multi-model detector, which is half of the work, on another core.

    Returns:
        The thresholds in ``result.settings``, their false-alarm rate with its uncertainty, and the detected changes.

    Raises:
        CalibrationError: these records yield no thresholds; the text says why and what would be right.
    """
    axis, memory_s = MonitoredAxis(model, settings), settings.memory * settings.interval_s
    tests_s = options.within_s or WITHIN_MEMORIES * memory_s
    samples = options.budget_s / settings.interval_s

    def step(name: str) -> PartialProgress:
        return lambda part: progress(name, part, 1.0)

    check_within(settings, tests_s)
    check_settings(settings)
    healthy = deviations(axis, records, step("healthy records"))
    within_s = options.within_s or time_with_standstill(tests_s, healthy, settings.interval_s)
    check_records(axis, healthy)
    check_longest(axis, records)
    check_healthy(axis, healthy)
    rng, rng_multimodel = np.random.default_rng(options.seed).spawn(2)
    k = nu_over_sigma(len(model.monitored), settings.memory, samples, tests_s / memory_s)
    task = partial(_bank_thresholds, axis, records, samples, rng_multimodel, options.bank_copies)
    with launch(task) as pending:
        statistics = healthy_statistics(axis, records, healthy, k, rng, options.copies, step("copies of the records"))
        own, rate = _thresholds(statistics, samples, settings.interval_s, int(rng.integers(2**62)))
        calibrated = replace(settings, thresholds=own)
        trials = partial(_trials, axis._replace(settings=calibrated), records, within_s)
        caught, onsets = trials(options, None, step("faults"))
        bank = pending(step("multi-model detector"))
    return CalibrationResult(
        model=model,
        settings=calibrated,
        budget_s=options.budget_s,
        within_s=within_s,
        scatter=statistics.scatter,
        rates=rate,
        allowance=statistics.allowance,
        caught=caught,
        onsets=onsets,
        records_s=sum(float(r.t_us[-1] - r.t_us[0]) * 1e-6 for r in records),
        bank=None if bank is None else _multimodel(bank, options, trials),
    )


def _bank_thresholds(
    axis: MonitoredAxis,
    records: Sequence[SampleBlock],
    samples: float,
    rng: np.random.Generator,
    copies: int,
    report: PartialProgress,
) -> BankThresholds | None:
    """Thresholds of the multi-model detector; None: it is not available for the axis."""
    return None if reason_unavailable(*axis) else bank_thresholds(axis, records, samples, rng, copies, report)


def _thresholds(
    statistics: HealthyStatistics, samples: float, interval_s: float, seed: int
) -> tuple[tuple[Threshold, ...], Rates]:
    """Thresholds of the CUSUM tests, and their false-alarm rate.

    Both use the same random draws, so that the rate reproduces the bound with which the thresholds keep the budget.
    """
    own = thresholds(statistics.scatter, statistics.tails, statistics.allowance, samples, np.random.default_rng(seed))
    rate = rates(statistics.scatter, statistics.tails, own, np.random.default_rng(seed))
    alone = rates(statistics.alone, statistics.tails, own, np.random.default_rng(seed))
    check_promise(statistics.scatter, rate, alone, samples, interval_s)
    return own, rate


def _multimodel(
    bank: BankThresholds,
    options: CalibrationOptions,
    trials: Callable[[CalibrationOptions, MultiModelThresholds], tuple[list[TrialResult], int]],
) -> MultiModelCalibration:
    """Trials of the detector: a few in which all of the evidence counts, and all with the share that these suggest."""
    few = replace(options, onsets=min(options.onsets, SHARE_ONSETS))
    share = evidence_share(trials(few, MultiModelThresholds(1.0, bank.own))[0])
    return MultiModelCalibration(bank, trials(options, MultiModelThresholds(1.0, bank.own, share))[0], share)


def _trials(
    axis: MonitoredAxis,
    records: Sequence[SampleBlock],
    within_s: float,
    options: CalibrationOptions,
    thresholds: MultiModelThresholds | None,
    progress: PartialProgress = lambda _: None,
) -> tuple[list[TrialResult], int]:
    """Detection of changes in the longest record, by the CUSUM tests or the multi-model detector; none: too short."""
    longest = max(records, key=lambda record: len(record.t_us))
    faults = [
        InjectedFault(name, sign * size)
        for name in axis.model.monitored
        for sign in (1, -1)
        for size in options.sizes
        if _is_possible(axis.model, name, sign * size)
    ]
    for share in (OBSERVED_SHARE, 1.0):
        try:
            return run_trials(axis, longest, faults, options.onsets, share * within_s, thresholds, progress)
        except ValueError:
            continue
    return [], 0


def _is_possible(model: AxisModel, name: str, change: float) -> bool:
    try:
        changed_values(model, name, change)
    except (ValueError, ZeroDivisionError):
        return False
    return True
