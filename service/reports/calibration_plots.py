"""Pictures of a calibration: fault size against delay, and against the probability of detection."""

from __future__ import annotations

import math

from service.calibration.found import FOUND, Calibration
from service.reports.plot_style import FOUND as LINE
from service.reports.plot_style import GRID, SIMULATED, as_svg, figure

_HEIGHT = 2.6


def power_picture(of: Calibration, name: str, number: int) -> str:
    """Of the faults of one parameter: how many are found in time, and how soon."""
    mine = sorted((one for one in of.caught if one.fault.parameter == name), key=lambda one: one.fault.size)
    sizes = [100 * one.fault.size for one in mine]
    with figure(_HEIGHT) as drawn:
        left, right = drawn.subplots(1, 2)
        left.plot(sizes, [100 * one.found_within(of.within_s) for one in mine], "o-", color=LINE, ms=4)
        left.axhline(100 * FOUND, color=GRID, lw=1)
        left.set_ylim(-3, 103)
        left.set_title(f"found within {of.within_s:.3g} s [%]")
        for share, style, label in ((0.5, "o-", "half of them"), (0.9, "s--", "9 of 10")):
            delays = [v if math.isfinite(v := one.delay(share)) else math.nan for one in mine]
            colour = LINE if share == 0.5 else SIMULATED
            right.plot(sizes, delays, style, color=colour, ms=4, label=label)
        right.set_ylim(bottom=0)
        right.set_title("delay of the first alarm [s]")
        right.legend()
        for axes in (left, right):
            axes.set_xlabel(f"change of {name} [% of its size]")
        return as_svg(
            drawn, f"Faults of parameter {number + 1}: share found and delay by size", f"power{number}"
        )
