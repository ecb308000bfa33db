"""The paper's Figures 5 and 6 over many seeds: what comes out.  The limits on it are in make soak."""

from time import perf_counter

import pytest

from monitor_core.drive.structure import Output
from monitor_core.modeling.standard_drives import MONITORED
from tests.bench.measure import Say
from tests.core.figures import figure_6, homecoming

pytestmark = pytest.mark.bench

FIGURE_5, FIGURE_6 = 100, 1000
LEFT_S = 5.0
"""Between the fault and the end of the record."""
OUTPUTS: tuple[Output, ...] = ("speed", "angle")


def test_figure_5(seed: int, say: Say) -> None:
    rows: list[tuple[object, ...]] = []
    for output in OUTPUTS:
        ratio = homecoming(output, range(seed + 1000, seed + 1000 + FIGURE_5), seed)
        bias = (f"{100 * (v - 1):+.2f} %" for v in ratio.mean(axis=1))
        spread = (f"{100 * v:.2f} %" for v in ratio.std(axis=1))
        rows += [(f"from {output}", "bias", *bias), ("", "spread", *spread)]
    say(f"Figure 5, theta from 20 % above nominal, {FIGURE_5} seeds", ("", "", *MONITORED), rows)


def test_figure_6(seed: int, say: Say) -> None:
    start = perf_counter()
    rows = []
    for parameter, row in figure_6(seed, FIGURE_6).rows.items():
        shares = (f"{100 * row.right:.1f} %", f"{100 * row.wrong:.1f} %") if parameter else ("-", row.wrong)
        delay = "beyond 5" if row.delay_s > LEFT_S else f"{row.delay_s:.2f}"
        g = (f"{v:.1f}" for v in row.largest_g)
        rows.append((parameter or "none", *shares, row.false, delay if parameter else "-", *g))
    duration_s = perf_counter() - start
    say(
        f"Figure 6, +20 % after 5 s of 10 s, {FIGURE_6} seeds, {duration_s:.0f} s; g: median largest",
        (
            "fault in",
            "right first",
            "wrong first",
            "false before",
            "delay s (median)",
            *(f"g {name}" for name in MONITORED),
        ),
        rows,
    )
