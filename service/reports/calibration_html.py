"""A calibration as one page that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from monitor_core.calibration import DetectorResult
from monitor_core.detection import DetectorName
from monitor_core.wording import duration
from service.reports.calibration_plots import power_picture
from service.reports.calibration_report import (
    DETECTORS,
    HYPOTHESIS_TITLES,
    THRESHOLD_TITLES,
    Calibration,
    confusion_rows,
    confusion_titles,
    fault_rows,
    fault_titles,
    hypothesis_rows,
    part,
    promises,
    smallest_rows,
    smallest_titles,
    threshold_rows,
)
from service.reports.page import (
    document,
    heads,
    legend,
    listed,
    number_cell,
    section,
    sentences,
    table,
    tiles,
    verdict,
)
from service.reports.text_format import escaped, percent

_LEFT = ("fault", "how", "named first", "named", "")


def as_html(calibration: Calibration) -> str:
    """The whole page."""
    p = calibration.provenance
    subtitle = f"{escaped(p.date[:10])}, axiswatch {escaped(p.version)}"
    return document(f"Calibration of {calibration.axis.id}", subtitle, *_content(calibration))


def _content(calibration: Calibration) -> Iterator[str]:
    first, *others = calibration.detectors
    yield verdict("warn" if calibration.warnings else "good", "Thresholds found:", f"{first.promise}.")
    yield tiles(_tiles(calibration))
    if calibration.warnings:
        yield section("What to know", sentences(calibration.warnings))
    promised = listed(escaped(words) for words in promises(calibration))
    yield section("Which detector alarms", promised, legend(_KIND) if others else "")
    if first.caught:
        yield section("What will be found", *_power(calibration), legend(_INJECTED), *_smallest(calibration))
    for one in calibration.detectors:
        if one.caught:
            yield section(
                f"By the {DETECTORS[one.detector]}, {part(calibration, one)}", *_found(calibration, one)
            )
    yield section(
        "Thresholds of the CUSUM tests",
        _rows(THRESHOLD_TITLES, threshold_rows(calibration)),
        legend(_THRESHOLDS),
    )
    if calibration.result.bank is not None:
        hypotheses = _rows(HYPOTHESIS_TITLES, hypothesis_rows(calibration))
        yield section("Thresholds of the multi-model detector", hypotheses, legend(_BANK))
    yield section("Where it comes from", _provenance(calibration))


_KIND = (
    "Both run. The alarms come from one of them, <code>alarm_source</code> in the table"
    " <code>[robot.axis.detector]</code> of the configuration; the other runs in shadow mode."
)
_THRESHOLDS = (
    "nu = alpha_1 sqrt(lambda_0 P_ii) + allowance &times; size, h = alpha_2 &times; size. All tests have the same"
    " share of the budget, and the axis keeps the whole of it with a certainty of 95 %. nu is such that the smallest"
    " possible fault is found in the time that was asked for. The standard deviation is that of the estimates in the"
    " records, as part of their size."
)
_INJECTED = (
    "Exact: put into the record by the torque that the same motion would have needed. Simulated: what the identified"
    " model says that the fault changes, added to the record."
)
_NAMES: dict[DetectorName, str] = {
    "cusum": "Names: the parameter whose alarm came first; the alarm is named three memories later.",
    "multimodel": "Names: those that the alarm got, up to three memories after it was raised, or six if it is noise.",
}
_BANK = (
    "Predictors side by side, one for each cause and size of a change, faults of the sensors among them. g is the sum"
    " of log-likelihood ratios, less the allowance; alarm when g &gt; h. Each has the same share of the budget, and the"
    " multi-model detector keeps it with a certainty of 95 %."
)


def _tiles(calibration: Calibration) -> Iterator[tuple[str, str]]:
    first = calibration.detectors[0]
    most, low, _ = first.between_s
    yield f"1 in {duration(most)}", f"false alarms of the {DETECTORS[first.detector]}, most likely"
    yield (
        f"1 in {duration(low)}",
        f"at worst, with 95 % certainty; wanted: no more than 1 in {duration(calibration.result.budget_s)}",
    )
    within = f"{calibration.result.within_s:.3g} s"
    for name in calibration.result.model.monitored:
        sizes = [abs(v) for v in first.smallest(name) if v is not None]
        words = percent(max(sizes)) if len(sizes) == 2 else "-"
        yield (
            words,
            f"smallest change of {escaped(name)}, up and down, found within {within}",
        )


def _smallest(calibration: Calibration) -> Iterator[str]:
    yield legend(
        f"Smallest change found within {calibration.result.within_s:.3g} s from 9 of 10 onsets, of those tried:"
    )
    yield _rows(smallest_titles(calibration), smallest_rows(calibration))


def _found(calibration: Calibration, one: DetectorResult) -> Iterator[str]:
    yield _rows(fault_titles(calibration, one), fault_rows(calibration, one))
    yield _rows(confusion_titles(one), confusion_rows(one))
    yield legend(f"Faults of all sizes that were tried, and what they were called. {_NAMES[one.detector]}")


def _power(calibration: Calibration) -> Iterator[str]:
    for number, name in enumerate(calibration.result.model.monitored):
        how = {one.exact for one in calibration.result.caught if one.fault.parameter == name}
        if not how:
            continue
        words = "exact" if how == {True} else "simulated"
        picture = power_picture(calibration, name, number)
        yield f"<figure><figcaption>{escaped(name)} ({words})</figcaption>{picture}</figure>"


def _rows(titles: Iterable[str], rows: Iterable[tuple[str, ...]]) -> str:
    titles = tuple(titles)
    cells = "".join(
        f"<tr><th>{escaped(row[0])}</th>"
        + "".join(
            f"<td>{escaped(cell)}</td>" if title in _LEFT else number_cell(cell)
            for title, cell in zip(titles[1:], row[1:], strict=True)
        )
        + "</tr>"
        for row in rows
    )
    return table(heads(titles, (title for title in titles[1:] if title not in _LEFT)), cells)


def _provenance(calibration: Calibration) -> str:
    p = calibration.provenance
    sources = (
        f"{escaped(s.text)}: {s.samples} samples, {s.seconds:.4g} s<br><span class='hash'>sha256 {s.sha256}</span>"
        for s in calibration.sources
    )
    again = f"<p>axiswatch {escaped(p.version)}, {escaped(p.date)}. To do it again:</p><pre>{escaped(p.command)}</pre>"
    return listed(sources) + again
