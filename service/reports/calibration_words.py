"""The tables of a calibration as text, for the terminal and the page."""

from __future__ import annotations

import math
from collections.abc import Iterator

from monitor_core.calibration.catch import Caught
from monitor_core.calibration.doubts import duration
from service.calibration.found import Calibration
from service.reports.words import percent, plain

THRESHOLD_TITLES = ("", "alpha_1", "alpha_2", "allowance", "sd of the estimate", "smallest found, up", "down")
FAULT_TITLES = ("fault", "how", "found in time", "median delay", "in 9 of 10 by", "named first")
BANK_TITLES = ("fault", "found in time", "median delay", "CUSUM tests", "in 9 of 10 by", "named")
HYPOTHESIS_TITLES = ("cause", "sizes", "h", "largest allowance")


def threshold_rows(of: Calibration) -> Iterator[tuple[str, ...]]:
    """One for each parameter."""
    for i, name in enumerate(of.model.monitored):
        own = of.settings.thresholds[i]
        up, down = of.smallest(name)
        yield (
            name,
            plain(own.alpha1, 3),
            plain(own.alpha2, 3),
            percent(own.allowance) if own.allowance else "0",
            percent(float(of.scatter.sigma[i])),
            *(_smallest(v) for v in (up, down)),
        )


def bank_rows(of: Calibration) -> Iterator[tuple[str, ...]]:
    """What the bank of hypotheses finds of each fault, beside the CUSUM tests' median delay."""
    for one, paper in zip(of.bank.caught if of.bank else (), of.caught, strict=False):
        yield (
            f"{one.fault.parameter} {percent(one.fault.size, signed=True)}",
            percent(one.found_within(of.within_s)),
            _seconds(one.delay(0.5)),
            _seconds(paper.delay(0.5)),
            _seconds(one.delay(0.9)),
            _names(one),
        )


def hypothesis_rows(of: Calibration) -> Iterator[tuple[str, ...]]:
    """One for each cause."""
    own = of.bank.limits.own if of.bank else ()
    for cause in dict.fromkeys(one.cause for one in own):
        mine = [one for one in own if one.cause == cause]
        low, high = min(one.h for one in mine), max(one.h for one in mine)
        allowed = max(one.allowance for one in mine)
        between = f"{low:.1f}" if len(mine) == 1 else f"{low:.1f} to {high:.1f}"
        yield cause, str(len(mine)), between, f"{allowed:.2g}" if allowed else "0"


def bank_promise(of: Calibration) -> str:
    """False alarms of the bank, in one sentence; why there is none."""
    if of.bank is None:
        return "No bank of hypotheses: the axis can have none."
    most, low, high = (duration(v) for v in of.bank_between_s)
    return f"Bank of hypotheses: one false alarm in {most}, with 90 % certainty between one in {low} and one in {high}."


def _smallest(size: float | None) -> str:
    return "none tried" if size is None else percent(size, signed=True)


def fault_rows(of: Calibration) -> Iterator[tuple[str, ...]]:
    """One for each fault."""
    for one in of.caught:
        yield (
            f"{one.fault.parameter} {percent(one.fault.size, signed=True)}",
            "exact" if one.exact else "simulated",
            percent(one.found_within(of.within_s)),
            _seconds(one.delay(0.5)),
            _seconds(one.delay(0.9)),
            _names(one),
        )


def _seconds(delay: float) -> str:
    return f"{plain(delay, 3)} s" if math.isfinite(delay) else "later"


def _names(one: Caught) -> str:
    counts = sorted(((one.first.count(name), name) for name in set(one.first) if name), reverse=True)
    whole = sum(n for n, _ in counts)
    return ", ".join(name if n == whole else f"{name} {percent(n / whole)}" for n, name in counts)


def confusion_titles(of: Calibration) -> tuple[str, ...]:
    """Over the columns."""
    return ("fault in", *of.model.monitored, "none yet")


def confusion_rows(of: Calibration) -> Iterator[tuple[str, ...]]:
    """One for each parameter: how its faults, of all sizes, were called at the first alarm."""
    for name, row in of.confusion().items():
        total = sum(row.values())
        yield (name, *(percent(n / total) if total else "" for n in row.values()))
