"""A calibration as one page that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from monitor_core.calibration.doubts import duration
from monitor_core.detection.detector_protocol import DetectorName
from service.calibration.found import Calibration
from service.calibration.told import Told
from service.reports.calibration_plots import power_picture
from service.reports.calibration_words import (
    DETECTORS,
    HYPOTHESIS_TITLES,
    THRESHOLD_TITLES,
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
from service.reports.words import escaped, percent

_LEFT = ("fault", "how", "named first", "named", "")


def as_html(of: Calibration) -> str:
    """The whole page."""
    p = of.provenance
    subtitle = f"{escaped(p.date[:10])}, axiswatch {escaped(p.version)}"
    return document(f"Calibration of {of.axis.id}", subtitle, *_content(of))


def _content(of: Calibration) -> Iterator[str]:
    first, *others = of.told
    yield verdict("warn" if of.warnings else "good", "Thresholds found:", f"{first.promise}.")
    yield tiles(_tiles(of))
    if of.warnings:
        yield section("What to know", sentences(of.warnings))
    promised = listed(escaped(words) for words in promises(of))
    yield section("Which detector alarms", promised, legend(_KIND) if others else "")
    if first.caught:
        yield section("What will be found", *_power(of), legend(_INJECTED), *_smallest(of))
    for one in of.told:
        if one.caught:
            yield section(f"By the {DETECTORS[one.detector]}, {part(of, one)}", *_found(of, one))
    yield section(
        "Thresholds of the CUSUM tests", _rows(THRESHOLD_TITLES, threshold_rows(of)), legend(_THRESHOLDS)
    )
    if of.bank is not None:
        hypotheses = _rows(HYPOTHESIS_TITLES, hypothesis_rows(of))
        yield section("Thresholds of the bank of hypotheses", hypotheses, legend(_BANK))
    yield section("Where it comes from", _provenance(of))


_KIND = (
    "Both run; the alarms of one count, and the page tells what the other would say. <code>kind</code> in the table"
    " <code>[robot.axis.detector]</code> of the configuration says which."
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
    "bank": "Names: those that the alarm got, up to three memories after it was raised, or six if it is noise.",
}
_BANK = (
    "Predictors side by side, one for each cause and size of a change, faults of the sensors among them. g is the sum"
    " of log-likelihood ratios, less the allowance; alarm when g &gt; h. Each has the same share of the budget, and the"
    " bank keeps it with a certainty of 95 %."
)


def _tiles(of: Calibration) -> Iterator[tuple[str, str]]:
    first = of.told[0]
    most, low, _ = first.between_s
    yield f"1 in {duration(most)}", f"false alarms of the {DETECTORS[first.detector]}, most likely"
    yield (
        f"1 in {duration(low)}",
        f"at worst, with 95 % certainty; wanted: no more than 1 in {duration(of.budget_s)}",
    )
    for name in of.model.monitored:
        sizes = [abs(v) for v in first.smallest(name) if v is not None]
        words = percent(max(sizes)) if len(sizes) == 2 else "-"
        yield words, f"smallest change of {escaped(name)}, up and down, found within {of.within_s:.3g} s"


def _smallest(of: Calibration) -> Iterator[str]:
    yield legend(
        f"Smallest change that is found within {of.within_s:.3g} s in 9 of 10, of those that were tried:"
    )
    yield _rows(smallest_titles(of), smallest_rows(of))


def _found(of: Calibration, one: Told) -> Iterator[str]:
    yield _rows(fault_titles(of, one), fault_rows(of, one))
    yield _rows(confusion_titles(one), confusion_rows(one))
    yield legend(f"Faults of all sizes that were tried, and what they were called. {_NAMES[one.detector]}")


def _power(of: Calibration) -> Iterator[str]:
    for number, name in enumerate(of.model.monitored):
        how = {one.exact for one in of.caught if one.fault.parameter == name}
        if not how:
            continue
        words = "exact" if how == {True} else "simulated"
        picture = power_picture(of, name, number)
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


def _provenance(of: Calibration) -> str:
    p = of.provenance
    sources = (
        f"{escaped(s.text)}: {s.samples} samples, {s.seconds:.4g} s<br><span class='hash'>sha256 {s.sha256}</span>"
        for s in of.sources
    )
    again = f"<p>axiswatch {escaped(p.version)}, {escaped(p.date)}. To do it again:</p><pre>{escaped(p.command)}</pre>"
    return listed(sources) + again
