"""The report of a calibration as one HTML page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

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
from service.reports.html import render, safe
from service.reports.text_format import percent


def as_html(calibration: Calibration) -> str:
    """The whole page."""
    first = calibration.detectors[0]
    return render(
        "calibration.html",
        title=f"Calibration of {calibration.axis.id}",
        calibration=calibration,
        key_figures=list(_key_figures(calibration)),
        promises=list(promises(calibration)),
        within=f"{calibration.result.within_s:.3g} s",
        power_pictures=list(_power_pictures(calibration)) if first.caught else [],
        smallest=_table(smallest_titles(calibration), smallest_rows(calibration)),
        detectors=[
            {
                "name": detector.detector,
                "title": f"{DETECTORS[detector.detector]}, {part(calibration, detector)}",
                "faults": _table(fault_titles(calibration, detector), fault_rows(calibration, detector)),
                "confusion": _table(confusion_titles(detector), confusion_rows(detector)),
            }
            for detector in calibration.detectors
            if detector.caught
        ],
        thresholds=_table(THRESHOLD_TITLES, threshold_rows(calibration)),
        hypotheses=None
        if calibration.result.bank is None
        else _table(HYPOTHESIS_TITLES, hypothesis_rows(calibration)),
    )


def _table(titles: Iterable[str], rows: Iterable[tuple[str, ...]]) -> dict[str, Any]:
    return {"titles": tuple(titles), "rows": list(rows)}


def _key_figures(calibration: Calibration) -> Iterator[tuple[str, str]]:
    first, result = calibration.detectors[0], calibration.result
    most, low, _ = first.between_s
    yield f"1 in {duration(most)}", f"false alarms of the {DETECTORS[first.detector]}, most likely"
    wanted = f"wanted: no more than 1 in {duration(result.budget_s)}"
    yield f"1 in {duration(low)}", f"at worst, with 95 % certainty; {wanted}"
    for name in result.model.monitored:
        sizes = [abs(v) for v in first.smallest(name) if v is not None]
        smallest = percent(max(sizes)) if len(sizes) == 2 else "-"
        yield smallest, f"smallest change of {name}, up and down, found within {result.within_s:.3g} s"


def _power_pictures(calibration: Calibration) -> Iterator[tuple[str, str]]:
    for number, name in enumerate(calibration.result.model.monitored):
        exact = {caught.exact for caught in calibration.result.caught if caught.fault.parameter == name}
        if exact:
            kind = "exact" if exact == {True} else "simulated"
            yield f"{name} ({kind})", safe(power_picture(calibration, name, number))
