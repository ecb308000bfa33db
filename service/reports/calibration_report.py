"""A calibration of a configured axis with its origin, in words and tables: on the terminal, and for the page."""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from rich.console import Console
from rich.text import Text

from monitor_core.calibration import CalibrationResult, DetectorResult, TrialResult
from monitor_core.detection import DetectorName
from monitor_core.drive import HEAT
from monitor_core.monitoring import MOST_NEW_POSES, RMS_SPEED, ConditionRange, PoseMap
from monitor_core.samples import SampleBlock
from monitor_core.wording import duration, listed, percent
from service.config import NamedAxis
from service.ingest.records.loaded_records import RecordOrigin
from service.reports.formats import Provenance, TextTable, for_terminal, labelled, plain


@dataclass(frozen=True)
class Calibration:
    """The result for an axis, its records, and the detector that will raise the alarms with these thresholds."""

    axis: NamedAxis
    result: CalibrationResult
    sources: Sequence[RecordOrigin]
    warnings: Sequence[str]
    provenance: Provenance
    alarms: DetectorName = "cusum"
    ranges: Sequence[ConditionRange] = ()
    """Ranges of the conditions in the records"""
    poses: Sequence[PoseMap] = ()
    """Maps of the poses in the records, if the load on the axis follows them"""

    @property
    def detectors(self) -> tuple[DetectorResult, ...]:
        """Performance of each detector; the detector that raises the alarms comes first."""
        results = [d for d in (self.result.by_bank, self.result.tests) if d is not None]
        return tuple(sorted(results, key=lambda d: d.detector != self.alarms))


def print_text(calibration: Calibration, console: Console) -> None:
    """Report the smallest changes found in time, the promise, faults and names of the alarming detector, thresholds."""

    def show(title: str, table: TextTable) -> None:
        console.print(for_terminal(table, title))

    console.print(Text(calibration.axis.id, style="bold"))
    first, result = calibration.detectors[0], calibration.result
    if first.caught:
        show(f"Smallest change found within {result.within_s:.3g} s, in 9 of 10", smallest(calibration))
    for words in promises(calibration):
        console.print(Text(words), soft_wrap=True)
    if first.caught:
        by = f"by the {DETECTORS[first.detector]}"
        title = f"Faults that begin at {result.onsets} places of the record, {by}"
        show(title, faults(calibration, first))
        show(f"Names, all sizes, {by}", confusion(first))
    show("Thresholds of the CUSUM tests", thresholds(calibration))
    if (causes := hypotheses(calibration)) is not None:
        show("Thresholds of the multi-model detector", causes)
    if calibration.ranges:
        show("Conditions of the records", conditions(calibration))
    for words in calibration.warnings:
        console.print(labelled("Note", words), soft_wrap=True)


# --- Sentences and tables ---------------------------------------------------------------------------------------------


DETECTORS: dict[DetectorName, str] = {"cusum": "CUSUM tests", "multimodel": "multi-model detector"}
_SHORT: dict[DetectorName, str] = {"cusum": "CUSUM", "multimodel": "models"}
_VERB: dict[DetectorName, tuple[str, str]] = {
    "cusum": ("alarm", "run in shadow mode"),
    "multimodel": ("alarms", "runs in shadow mode"),
}
_SELDOM = 0.05


def answer(calibration: Calibration) -> str:
    """First line of the report: the smallest change of each parameter that the alarming detector finds in time."""
    first, result = calibration.detectors[0], calibration.result
    if not first.caught:
        return "What would be found was not tried."
    found, lost = [], []
    for name in result.model.monitored:
        sizes = [size for size in first.smallest(name) if size is not None]
        if len(sizes) == 2:
            found.append(f"{name} from {percent(max(map(abs, sizes)))}")
        else:
            lost.append(" ".join([name, *(f"(only {percent(size, signed=True)})" for size in sizes)]))
    words = f"Found within {result.within_s:.3g} s: {f'changes of {listed(found)}' if found else 'nothing'}."
    return f"{words} Not found so soon, of what was tried: {listed(lost)}." if lost else words


def promises(calibration: Calibration) -> Iterator[str]:
    """False-alarm rate of each detector in one sentence, or why there is no multi-model detector."""
    for detector in calibration.detectors:
        yield f"The {DETECTORS[detector.detector]}, {part(calibration, detector)}: {detector.promise}."
    if calibration.result.bank is None:
        yield "No multi-model detector: the axis can have none."


def part(calibration: Calibration, detector: DetectorResult) -> str:
    """The role of a detector when these thresholds are used."""
    return f"which {_VERB[detector.detector][detector.detector != calibration.alarms]}"


def thresholds(calibration: Calibration) -> TextTable:
    """A row for each parameter."""
    result = calibration.result
    rows = [
        (
            name,
            plain(own.alpha1, 3),
            plain(own.alpha2, 3),
            percent(float(allowed)) if allowed else "0",
            percent(float(sigma)),
        )
        for name, own, allowed, sigma in zip(
            result.model.monitored,
            result.settings.thresholds,
            result.settings.tests(len(result.model.monitored))[2],
            result.scatter.sigma,
            strict=True,
        )
    ]
    return TextTable(("", "alpha_1", "alpha_2", "allowance", "sd of the estimate"), rows)


def hypotheses(calibration: Calibration) -> TextTable | None:
    """A row for each cause that the multi-model detector knows; None: there is no such detector."""
    if calibration.result.bank is None:
        return None
    own, rows = calibration.result.bank.thresholds.own, []
    for cause in dict.fromkeys(trial.cause for trial in own):
        mine = [trial for trial in own if trial.cause == cause]
        low, high = (f"{of_all(trial.h for trial in mine):.1f}" for of_all in (min, max))
        allowed = max(trial.allowance for trial in mine)
        between = low if low == high else f"{low} to {high}"
        rows.append((cause, str(len(mine)), between, f"{allowed:.2g}" if allowed else "0"))
    return TextTable(("cause", "sizes", "h", "largest allowance"), rows)


def counted(calibration: Calibration) -> str:
    """Share of the evidence that counts for the probabilities of causes, as text; empty without such a detector."""
    bank = calibration.result.bank
    return "" if bank is None else percent(bank.evidence_share)


def smallest(calibration: Calibration) -> TextTable:
    """A row for each parameter: the smallest changes that each detector finds in time, up and down."""
    detectors = calibration.detectors
    titles = [f"{_SHORT[detector.detector]}: {way}" for detector in detectors for way in ("up", "down")]
    rows = [
        (name, *(_smallest(size) for detector in detectors for size in detector.smallest(name)))
        for name in calibration.result.model.monitored
    ]
    return TextTable(("", *titles), rows)


def _smallest(size: float | None) -> str:
    return "none" if size is None else percent(size, signed=True)


def faults(calibration: Calibration, result: DetectorResult) -> TextTable:
    """A row for each fault found by a detector, with the delay of the other detector if it was tested on it, too."""
    named = "named" if result.detector == "multimodel" else "named first"
    others = [d for d in calibration.detectors if d.detector != result.detector and d.caught]
    medians = [f"{_SHORT[other.detector]}: median" for other in others]
    rows = [
        (
            f"{trial.fault.parameter} {percent(trial.fault.size, signed=True)}",
            "exact" if trial.exact else "simulated",
            percent(trial.found_within(result.within_s)),
            _seconds(trial.delay(0.5)),
            _seconds(trial.delay(0.9)),
            *(_seconds(other.caught[k].delay(0.5)) for other in others),
            _names(trial),
        )
        for k, trial in enumerate(result.caught)
    ]
    return TextTable(("fault", "how", "found in time", "median delay", "in 9 of 10 by", *medians, named), rows)


def _seconds(delay: float) -> str:
    return f"{plain(delay, 3)} s" if math.isfinite(delay) else "later"


def _names(trial: TrialResult) -> str:
    """Names given by its alarms, the most frequent first; rare ones are counted together."""
    counts = sorted(((trial.first.count(name), name) for name in set(trial.first) if name), reverse=True)
    total = sum(n for n, _ in counts)
    often = [(n, name) for n, name in counts if n == counts[0][0] or n >= _SELDOM * total]
    if rest := total - sum(n for n, _ in often):
        often.append((rest, "others"))
    return ", ".join(name if n == total else f"{name} {percent(n / total)}" for n, name in often)


def confusion(result: DetectorResult) -> TextTable:
    """A row for each parameter: names of the alarms of its faults, of all sizes."""
    counts = result.confusion()
    names = [name or "none yet" for name in next(iter(counts.values()), {})]
    rows = [
        (name, *(percent(n / max(sum(row.values()), 1)) if any(row.values()) else "" for n in row.values()))
        for name, row in counts.items()
    ]
    return TextTable(("fault in", *names), rows)


def conditions(calibration: Calibration) -> TextTable:
    """A row for each condition; outside of these ranges the promise is not valid."""
    rows = [(r.condition, plain(r.low, 3), plain(r.high, 3)) for r in calibration.ranges]
    return TextTable(("", "lowest", "highest"), rows)


_ONE_DAY_S, _SHORT_S = 86400.0, 3600.0


def one_sided(
    records: Sequence[SampleBlock], found: Sequence[ConditionRange], followed: Collection[str] = ()
) -> Iterator[str]:
    """Cautions about records that cover little of the conditions that the axis will meet.

    ``followed``: signals that the friction of the axis follows.
    """
    starts = [record.t_us[0] * 1e-6 for record in records]
    longest = max((record.t_us[-1] - record.t_us[0]) * 1e-6 for record in records)
    if max(starts) - min(starts) < _ONE_DAY_S and longest < _SHORT_S:
        brief = f"The records {'last' if _undated(records) else 'are of one day and last'} {duration(longest)} at most."
        if followed:
            wider = "only larger changes are found" if HEAT in followed else "the axis is not tested"
            yield (
                f"{brief} Friction follows {listed(sorted(followed))}. Where that is more than a tenth of its range"
                f" outside the range of the records, {wider}; add records from the cold and from the warm axis."
            )
        else:
            yield (
                f"{brief} What changes over hours or days is not in them: friction, for example, falls by a fifth to a"
                " half while an axis warms up. Expect alarms when it is warmer or colder than in the records; add"
                " records from the cold and from the warm axis."
            )
    for r in found:
        if r.condition != RMS_SPEED and r.high == r.low:
            yield f"{r.condition} is {r.low:.3g} in all records: at other values the promise does not hold."


def _undated(records: Sequence[SampleBlock]) -> bool:
    """Whether the times of the records do not tell their days: they overlap, as each record begins at zero."""
    spans = sorted((int(record.t_us[0]), int(record.t_us[-1])) for record in records)
    return any(later[0] < earlier[1] for earlier, later in pairwise(spans))


def new_poses(poses: Sequence[PoseMap]) -> Iterator[str]:
    """A caution where the load follows the pose: another program may need other records."""
    angles = dict.fromkeys(name for known in poses for name in known.angles)
    if angles:
        yield (
            f"The load on this axis follows {listed(list(angles))}, and is known in the poses of these records. While"
            f" more than {percent(MOST_NEW_POSES)} of the way of the axis is in other poses (5 to 20 degrees from"
            " them), nothing is tested: record every program of the robot."
        )


_DOUBTFUL_SCATTER, _FAR_EXTRAPOLATION = 2.0, 30.0
"""Scatter relative to P, and extrapolation of the rate beyond the simulation, above which a caution is given."""


def warnings(result: CalibrationResult) -> Iterator[str]:
    """Cautions about a result, as sentences."""
    _, low, high = result.tests.between_s
    if result.rates.beyond > _FAR_EXTRAPOLATION:
        yield (
            f"CUSUM tests: one false alarm in {duration(result.budget_s)} cannot be observed in"
            f" {duration(result.records_s)} of records: the rate is extrapolated by a factor of"
            f" {float(f'{result.rates.beyond:.1g}'):,.0f} beyond what was simulated, and the interval, one in"
            f" {duration(low)} to one in {duration(high)}, is that wide."
        )
    p_says = result.scatter.mean_s / np.sqrt(result.settings.divisor)
    for name, ratio in zip(result.model.monitored, result.scatter.sigma / p_says, strict=True):
        if ratio > _DOUBTFUL_SCATTER:
            yield (
                f"{name} scatters {ratio:.2g} times as much as P says (innovations that are not white, or a model that"
                " is not the axis): alpha_1 makes up for it."
            )
    beyond = result.scatter.beyond
    rows = zip(result.model.monitored, result.scatter.mean_d, beyond, strict=True)
    if off := [f"{name} by {100 * mean:+.2g} %" for name, mean, more in rows if more > 0]:
        yield (
            f"Off the nominal value in all records, in parts of the size: {', '.join(off)}. The tests allow for it."
            " With nominal values from these records, by `axiswatch identify` with `--start values --free"
            f" {','.join(result.model.monitored)}`, smaller faults can be found."
        )
    for name, allowed in zip(result.model.monitored, result.allowance - beyond, strict=True):
        if allowed > 0:
            yield (
                f"{name} differs between parts of the records beyond chance: the tests allow for {100 * allowed:.2g} %"
                " of its size."
            )
    if not result.caught:
        yield "The records are too short to let faults begin in them: what would be found was not tried."
