"""The report of a calibration as one HTML page, with the plots of fault size against delay and share found."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from monitor_core.calibration import FOUND_SHARE, DetectorResult
from monitor_core.wording import duration
from service.reports import calibration_report as content
from service.reports.calibration_report import DETECTORS, Calibration
from service.reports.formats import percent
from service.reports.html import render, safe
from service.reports.plot_style import FOUND, GRID, SIMULATED, as_svg, figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HEIGHT = 2.9


def as_html(calibration: Calibration) -> str:
    """The whole page."""
    return render(
        "calibration.html",
        title=f"Calibration of {calibration.axis.id}",
        calibration=calibration,
        key_figures=list(_key_figures(calibration)),
        promises=list(content.promises(calibration)),
        power_pictures=list(_power_pictures(calibration)) if calibration.detectors[0].caught else [],
        smallest=content.smallest(calibration),
        detectors=[
            (
                detector.detector,
                f"{DETECTORS[detector.detector]}, {content.part(calibration, detector)}",
                content.faults(calibration, detector),
                content.confusion(detector),
            )
            for detector in calibration.detectors
            if detector.caught
        ],
        thresholds=content.thresholds(calibration),
        hypotheses=content.hypotheses(calibration),
    )


def _key_figures(calibration: Calibration) -> Iterator[tuple[str, str]]:
    first, result = calibration.detectors[0], calibration.result
    most, low, _ = first.between_s
    yield f"1 in {duration(most)}", f"false alarms of the {DETECTORS[first.detector]}, most likely"
    wanted = f"wanted: no more than 1 in {duration(result.budget_s)}"
    yield f"1 in {duration(low)}", f"at worst, with 95 % certainty; {wanted}"
    for name in result.model.monitored:
        sizes = [abs(v) for v in first.smallest(name) if v is not None]
        size = percent(max(sizes)) if len(sizes) == 2 else "-"
        yield size, f"smallest change of {name}, up and down, found within {result.within_s:.3g} s"


def _power_pictures(calibration: Calibration) -> Iterator[tuple[str, str]]:
    for number, name in enumerate(calibration.result.model.monitored):
        exact = {caught.exact for caught in calibration.result.caught if caught.fault.parameter == name}
        if exact:
            kind = "exact" if exact == {True} else "simulated"
            yield f"{name} ({kind})", safe(_power_picture(calibration, name, number))


def _power_picture(calibration: Calibration, name: str, number: int) -> str:
    """Faults of one parameter: probability of detection in time, and delay."""
    with figure(_HEIGHT) as drawn:
        left, right = drawn.subplots(1, 2)
        for result, colour in zip(calibration.detectors, (FOUND, SIMULATED), strict=False):
            _curves(result, name, left, right, colour)
        left.axhline(100 * FOUND_SHARE, color=GRID, lw=1)
        left.set_ylim(-3, 103)
        left.set_title(f"found within {calibration.result.within_s:.3g} s [%]")
        right.set_ylim(bottom=0)
        right.set_title("delay of the first alarm [s], of 9 of 10 dashed")
        for axes in (left, right):
            axes.set_xlabel(f"change of {name} [% of its size]")
        handles, labels = left.get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        words = f"Faults of parameter {number + 1}: share found and delay by size"
        return as_svg(drawn, words, f"power{number}")


def _curves(result: DetectorResult, name: str, left: Axes, right: Axes, colour: str) -> None:
    """Curves of one detector; there is no delay where it detects nothing."""
    mine = [trial for trial in result.caught if trial.fault.parameter == name]
    mine.sort(key=lambda trial: trial.fault.size)
    sizes = [100 * trial.fault.size for trial in mine]
    shares = [100 * trial.found_within(result.within_s) for trial in mine]
    left.plot(sizes, shares, "o-", color=colour, ms=4, label=DETECTORS[result.detector])
    for share, style in ((0.5, "o-"), (0.9, "s--")):
        delays = [v if math.isfinite(v := trial.delay(share)) else math.nan for trial in mine]
        right.plot(sizes, delays, style, color=colour, ms=4)
