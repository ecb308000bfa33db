"""Plots of a calibration: fault size against delay, and against the probability of detection, for each detector."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from monitor_core.calibration import FOUND_SHARE, DetectorResult
from service.reports.calibration_report import DETECTORS, Calibration
from service.reports.plot_style import FOUND as LINE
from service.reports.plot_style import GRID, SIMULATED, as_svg, figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HEIGHT = 2.9
_COLOURS = (LINE, SIMULATED)
"""Of the detector that alarms, and of the other."""


def power_picture(calibration: Calibration, name: str, number: int) -> str:
    """Faults of one parameter: probability of detection in time, and delay."""
    with figure(_HEIGHT) as drawn:
        left, right = drawn.subplots(1, 2)
        for result, colour in zip(calibration.detectors, _COLOURS, strict=False):
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
        return as_svg(
            drawn, f"Faults of parameter {number + 1}: share found and delay by size", f"power{number}"
        )


def _curves(result: DetectorResult, name: str, left: Axes, right: Axes, colour: str) -> None:
    """Curves of one detector; there is no delay where it detects nothing."""
    mine = sorted(
        (trial for trial in result.caught if trial.fault.parameter == name),
        key=lambda trial: trial.fault.size,
    )
    sizes = [100 * trial.fault.size for trial in mine]
    shares = [100 * trial.found_within(result.within_s) for trial in mine]
    left.plot(sizes, shares, "o-", color=colour, ms=4, label=DETECTORS[result.detector])
    for share, style in ((0.5, "o-"), (0.9, "s--")):
        delays = [v if math.isfinite(v := trial.delay(share)) else math.nan for trial in mine]
        right.plot(sizes, delays, style, color=colour, ms=4)
