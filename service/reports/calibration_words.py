"""The tables of a calibration as text, for the terminal and the page."""

from __future__ import annotations

import math
from collections.abc import Iterator

from monitor_core.calibration.catch import Caught
from monitor_core.detection.detector_protocol import DetectorName
from service.calibration.found import Calibration
from service.calibration.told import Told
from service.reports.words import percent, plain

THRESHOLD_TITLES = ("", "alpha_1", "alpha_2", "allowance", "sd of the estimate")
HYPOTHESIS_TITLES = ("cause", "sizes", "h", "largest allowance")
DETECTORS: dict[DetectorName, str] = {"cusum": "CUSUM tests", "bank": "bank of hypotheses"}
_SHORT: dict[DetectorName, str] = {"cusum": "CUSUM", "bank": "bank"}
_VERB: dict[DetectorName, tuple[str, str]] = {"cusum": ("alarm", "look on"), "bank": ("alarms", "looks on")}
_SELDOM = 0.05


def promises(of: Calibration) -> Iterator[str]:
    """False alarms of each detector, in one sentence; why there is no bank."""
    for one in of.told:
        yield f"The {DETECTORS[one.detector]}, {part(of, one)}: {one.promise}."
    if of.bank is None:
        yield "No bank of hypotheses: the axis can have none."


def part(of: Calibration, one: Told) -> str:
    """What a detector will do with these thresholds."""
    return f"which {_VERB[one.detector][one.detector != of.alarms]}"


def threshold_rows(of: Calibration) -> Iterator[tuple[str, ...]]:
    """One for each parameter."""
    for i, name in enumerate(of.model.monitored):
        own = of.settings.thresholds[i]
        yield (
            name,
            plain(own.alpha1, 3),
            plain(own.alpha2, 3),
            percent(own.allowance) if own.allowance else "0",
            percent(float(of.scatter.sigma[i])),
        )


def hypothesis_rows(of: Calibration) -> Iterator[tuple[str, ...]]:
    """One for each cause."""
    own = of.bank.limits.own if of.bank else ()
    for cause in dict.fromkeys(one.cause for one in own):
        mine = [one for one in own if one.cause == cause]
        low, high = (f"{of_all(one.h for one in mine):.1f}" for of_all in (min, max))
        allowed = max(one.allowance for one in mine)
        between = low if low == high else f"{low} to {high}"
        yield cause, str(len(mine)), between, f"{allowed:.2g}" if allowed else "0"


def smallest_titles(of: Calibration) -> tuple[str, ...]:
    """Up and down by each detector, in the order in which they are told."""
    return ("", *(f"{_SHORT[one.detector]}: {way}" for one in of.told for way in ("up", "down")))


def smallest_rows(of: Calibration) -> Iterator[tuple[str, ...]]:
    """One for each parameter: the smallest changes that each detector finds in time."""
    for name in of.model.monitored:
        yield name, *(_smallest(size) for one in of.told for size in one.smallest(name))


def _smallest(size: float | None) -> str:
    return "none" if size is None else percent(size, signed=True)


def fault_titles(of: Calibration, told: Told) -> tuple[str, ...]:
    """Over the columns of ``fault_rows``; the last is the delay of the other detector."""
    named = "named" if told.detector == "bank" else "named first"
    others = (f"{_SHORT[one.detector]}: median" for one in _others(of, told))
    return ("fault", "how", "found in time", "median delay", "in 9 of 10 by", *others, named)


def fault_rows(of: Calibration, told: Told) -> Iterator[tuple[str, ...]]:
    """One for each fault, as a detector found it."""
    beside = _others(of, told)
    for k, one in enumerate(told.caught):
        yield (
            f"{one.fault.parameter} {percent(one.fault.size, signed=True)}",
            "exact" if one.exact else "simulated",
            percent(one.found_within(told.within_s)),
            _seconds(one.delay(0.5)),
            _seconds(one.delay(0.9)),
            *(_seconds(other.caught[k].delay(0.5)) for other in beside),
            _names(one),
        )


def _others(of: Calibration, told: Told) -> list[Told]:
    """Which found the same faults."""
    return [one for one in of.told if one.detector != told.detector and one.caught]


def _seconds(delay: float) -> str:
    return f"{plain(delay, 3)} s" if math.isfinite(delay) else "later"


def _names(one: Caught) -> str:
    """What its alarms were called, the most frequent first; what was seldom is counted together."""
    counts = sorted(((one.first.count(name), name) for name in set(one.first) if name), reverse=True)
    whole = sum(n for n, _ in counts)
    often = [(n, name) for n, name in counts if n == counts[0][0] or n >= _SELDOM * whole]
    if rest := whole - sum(n for n, _ in often):
        often.append((rest, "others"))
    return ", ".join(name if n == whole else f"{name} {percent(n / whole)}" for n, name in often)


def confusion_titles(told: Told) -> tuple[str, ...]:
    """Over the columns."""
    names = next(iter(told.confusion().values()), {})
    return ("fault in", *(name or "none yet" for name in names))


def confusion_rows(told: Told) -> Iterator[tuple[str, ...]]:
    """One for each parameter: how its faults, of all sizes, were called."""
    for name, row in told.confusion().items():
        total = sum(row.values())
        yield (name, *(percent(n / total) if total else "" for n in row.values()))
