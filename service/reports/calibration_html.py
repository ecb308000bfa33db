"""A calibration as one page that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from monitor_core.calibration.doubts import duration
from service.calibration.found import Calibration
from service.reports.calibration_plots import power_picture
from service.reports.calibration_words import (
    BANK_TITLES,
    FAULT_TITLES,
    HYPOTHESIS_TITLES,
    THRESHOLD_TITLES,
    bank_promise,
    bank_rows,
    confusion_rows,
    confusion_titles,
    fault_rows,
    hypothesis_rows,
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
    yield verdict("warn" if of.warnings else "good", "Thresholds found:", f"{of.promise}.")
    yield tiles(_tiles(of))
    if of.warnings:
        yield section("What to know", sentences(of.warnings))
    yield section("Thresholds", _rows(THRESHOLD_TITLES, threshold_rows(of)), legend(_THRESHOLDS))
    if of.caught:
        yield section("What will be found", *_power(of))
        yield section("All faults that were tried", _rows(FAULT_TITLES, fault_rows(of)), legend(_INJECTED))
        yield section(
            "Name of the first alarm", _rows(confusion_titles(of), confusion_rows(of)), legend(_FIRST)
        )
    yield section("Bank of hypotheses", *_bank(of))
    yield section("Where it comes from", _provenance(of))


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
_FIRST = "Faults of all sizes that were tried, by the parameter whose alarm came first."


_BANK = (
    "The second detector: predictors side by side, one for each cause and size of a change, faults of the sensors among"
    " them. g is the sum of log-likelihood ratios, less the allowance; alarm when g &gt; h. Each has the same share"
    " of the budget, and keeps it with a certainty of 95 %. Names are those that the alarm got, up to three memories"
    " after it was raised."
)


def _bank(of: Calibration) -> Iterator[str]:
    yield f"<p>{escaped(bank_promise(of))}</p>"
    if of.bank is None:
        return
    if of.bank.caught:
        yield _rows(BANK_TITLES, bank_rows(of))
    yield _rows(HYPOTHESIS_TITLES, hypothesis_rows(of))
    yield legend(_BANK)


def _tiles(of: Calibration) -> Iterator[tuple[str, str]]:
    most, low, _ = of.between_s
    yield f"1 in {duration(most)}", "false alarms of the axis, most likely"
    yield (
        f"1 in {duration(low)}",
        f"at worst, with 95 % certainty; wanted: no more than 1 in {duration(of.budget_s)}",
    )
    for name in of.model.monitored:
        sizes = [abs(v) for v in of.smallest(name) if v is not None]
        words = percent(max(sizes)) if len(sizes) == 2 else "-"
        yield words, f"smallest change of {escaped(name)}, up and down, found within {of.within_s:.3g} s"


def _power(of: Calibration) -> Iterator[str]:
    for number, name in enumerate(of.model.monitored):
        how = {one.exact for one in of.caught if one.fault.parameter == name}
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
