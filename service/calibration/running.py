"""The whole way from healthy records to thresholds, and what they find."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from monitor_core.calibration.budget import Rates, rates, thresholds
from monitor_core.calibration.catch import Caught, Fault, catch
from monitor_core.calibration.catch_by_bank import catch_by_bank
from monitor_core.calibration.doubts import (
    CalibrationError,
    check_healthy,
    check_promise,
    check_records,
    check_settings,
    duration,
)
from monitor_core.calibration.healthy import Samples, deviations
from monitor_core.calibration.hypotheses import BankLimits, bank_limits
from monitor_core.calibration.injection import changed
from monitor_core.calibration.learned import Learned, learned
from monitor_core.calibration.surrogate import SAMPLES
from monitor_core.calibration.watched import COPIES
from monitor_core.detection.detector_protocol import DetectorName
from monitor_core.detection.multimodel.multimodel_detector import unfit
from monitor_core.drive.axis_model import AxisModel
from monitor_core.settings import Settings, Threshold
from service.calibration.beside import Beside
from service.calibration.found import Bank, Calibration, Provenance
from service.calibration.reading import read
from service.config import Config, NamedAxis
from service.config.axis_settings import axis_model, axis_settings
from service.config.detector_choice import alarming

WITHIN = 10.0
"""Memories within which faults are to be found, unless told otherwise."""
LEAST_WITHIN = 2.0
LOOKED_AT = 2.0
"""Of that time each fault is watched."""
_DOUBTFUL, _EXTRAPOLATED = 2.0, 30.0
"""Scatter beside what P says; and rate below those that were simulated, from which it is said."""

Progress = Callable[[str, float, float], None]
"""What is going on, how much of it is done, and how much there is."""


@dataclass(frozen=True)
class Wishes:
    """What the user wants; times in seconds.

    ``sizes``: changes of the parameters, as parts of their sizes, tried upwards and downwards.  ``within_s`` None: ten
    memories.  ``onsets``: at how many places of the record each begins.  ``copies`` and
    ``bank_copies``: samples of healthy records that are simulated, for the CUSUM tests and for the bank.
    """

    budget_s: float
    within_s: float | None
    sizes: tuple[float, ...]
    onsets: int
    seed: int = 1
    copies: int = SAMPLES
    bank_copies: int = COPIES


def calibrate(
    config: Config,
    axis: NamedAxis,
    texts: Sequence[str],
    wishes: Wishes,
    provenance: Provenance,
    progress: Progress = lambda _, __, ___: None,
) -> Calibration:
    """Thresholds for the axis from healthy records of it.

    Raises:
        CalibrationError: from these records no thresholds can be had.
        AxisError: the axis cannot be monitored as configured.
        RecordError, DbcError, IngestError: a record cannot be read.
    """
    model = axis_model(axis.config)
    settings = axis_settings(axis, model)
    memory_s = settings.memory * settings.interval_s
    within_s = wishes.within_s or WITHIN * memory_s
    if within_s < LEAST_WITHIN * memory_s:
        raise CalibrationError(
            f"--within {within_s:g}: a memory is {memory_s:.3g} s, and no test is sure before twice that,"
            f" {LEAST_WITHIN * memory_s:.3g} s; give at least that, or a shorter memory_s"
        )
    check_settings(settings)
    records, sources = read(texts, config, axis, model, lambda part: progress("reading", part, 1.0))
    found = deviations(model, settings, records, lambda part: progress("healthy records", part, 1.0))
    check_records(model, settings, found)
    check_healthy(model, settings, found)
    rng, of_bank = np.random.default_rng(wishes.seed).spawn(2)
    samples = wishes.budget_s / settings.interval_s
    told: Callable[[float], None] = lambda part: progress("copies of the records", part, 1.0)  # noqa: E731
    # Half of the work each: the copies for the tests, and those for the bank.
    with Beside(partial(_limits, model, settings, records, samples, of_bank, wishes.bank_copies)) as aside:
        memories = within_s / memory_s
        known = learned(model, settings, records, found, samples, memories, rng, wishes.copies, told)
        own, rate = _thresholds(known, samples, settings.interval_s, int(rng.integers(2**62)))
        calibrated = replace(settings, thresholds=own)
        caught, onsets = _caught(model, calibrated, records, wishes, within_s, progress)
        limits = aside.result(lambda part: progress("bank of hypotheses", part, 1.0))
    faults = [one.fault for one in caught]
    bank = _bank(model, calibrated, records, limits, faults, wishes, within_s) if limits else None
    alarms: DetectorName = "cusum" if bank is None else alarming(axis.config, True)
    result = Calibration(
        axis, model, calibrated, wishes.budget_s, within_s, known.scatter, rate, known.allowance, caught, onsets,
        sources, (), provenance, bank, alarms,
    )  # fmt: skip
    return replace(result, warnings=tuple(_warnings(result)))


def _thresholds(
    known: Learned, samples: float, interval_s: float, drawn: int
) -> tuple[tuple[Threshold, ...], Rates]:
    """Of the CUSUM tests, and how often they alarm.

    All from the same draws: with others the bound of a far budget, which is that wide, would not be met again.
    """
    own = thresholds(known.scatter, known.tails, known.allowance, samples, np.random.default_rng(drawn))
    rate = rates(known.scatter, known.tails, own, np.random.default_rng(drawn))
    alone = rates(known.alone, known.tails, own, np.random.default_rng(drawn))
    check_promise(known.scatter, rate, alone, samples, interval_s)
    return own, rate


def _caught(
    model: AxisModel,
    settings: Settings,
    records: Sequence[Samples],
    wishes: Wishes,
    within_s: float,
    progress: Progress,
) -> tuple[list[Caught], int]:
    """Of faults in the longest record; nothing where it is too short for that."""
    longest = max(records, key=lambda one: len(one.t_us))
    faults = [
        Fault(name, sign * size)
        for name in model.monitored
        for sign in (1, -1)
        for size in wishes.sizes
        if _possible(model, name, sign * size)
    ]
    told: Callable[[float], None] = lambda part: progress("faults", part, 1.0)  # noqa: E731
    for share in (LOOKED_AT, 1.0):
        try:
            return catch(model, settings, longest, faults, wishes.onsets, share * within_s, told)
        except ValueError:
            continue
    return [], 0


def _limits(
    model: AxisModel,
    settings: Settings,
    records: Sequence[Samples],
    samples: float,
    rng: np.random.Generator,
    copies: int,
    tell: Callable[[float], None],
) -> BankLimits | None:
    """Of the bank; None where the axis can have none."""
    if unfit(model, settings):
        return None
    return bank_limits(model, settings, records, samples, rng, copies, tell)


def _bank(
    model: AxisModel,
    settings: Settings,
    records: Sequence[Samples],
    limits: BankLimits,
    faults: Sequence[Fault],
    wishes: Wishes,
    within_s: float,
) -> Bank:
    """The limits of the bank, and what it catches of the same faults."""
    longest = max(records, key=lambda one: len(one.t_us))
    for share in (LOOKED_AT, 1.0) if faults else ():
        try:
            caught = catch_by_bank(
                model, settings, limits.own, longest, faults, wishes.onsets, share * within_s
            )
        except ValueError:
            continue
        return Bank(limits, caught)
    return Bank(limits, ())


def _possible(model: AxisModel, name: str, change: float) -> bool:
    try:
        changed(model, name, change)
    except (ValueError, ZeroDivisionError):
        return False
    return True


def _warnings(of: Calibration) -> Iterator[str]:
    """What to know, in words."""
    _, low, high = of.tests.between_s
    if of.rates.beyond > _EXTRAPOLATED:
        yield (
            f"CUSUM tests: one false alarm in {duration(of.budget_s)} cannot be observed in"
            f" {duration(sum(s.seconds for s in of.sources))} of records: the rate is extrapolated by a factor of"
            f" {float(f'{of.rates.beyond:.1g}'):,.0f} beyond what was simulated, and the interval, one in"
            f" {duration(low)} to one in {duration(high)}, is that wide."
        )
    p_says = of.scatter.mean_s / np.sqrt(of.settings.divisor)
    for name, ratio in zip(of.model.monitored, of.scatter.sigma / p_says, strict=True):
        if ratio > _DOUBTFUL:
            yield (
                f"{name} scatters {ratio:.2g} times as much as P says (innovations that are not white, or a model that"
                " is not the axis): alpha_1 makes up for it."
            )
    beyond = of.scatter.beyond
    rows = zip(of.model.monitored, of.scatter.mean_d, beyond, strict=True)
    if off := [f"{name} by {100 * mean:+.2g} %" for name, mean, more in rows if more > 0]:
        yield (
            f"Off its nominal value all along, in parts of its size: {', '.join(off)}. nu allows for it. Nominal values"
            f" from these records, by `axiswatch identify` with `--start values --free {','.join(of.model.monitored)}`,"
            " let smaller faults be found."
        )
    for name, allowed in zip(of.model.monitored, of.allowance - beyond, strict=True):
        if allowed > 0:
            yield (
                f"{name} differs between parts of the records beyond chance: nu allows for {100 * allowed:.2g} % of"
                " its size."
            )
    if not of.caught:
        yield "The records are too short to let faults begin in them: what would be found was not tried."
