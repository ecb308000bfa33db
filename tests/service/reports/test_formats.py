"""Numbers and lines as reports show them."""

import re

import numpy as np
import pytest

from monitor_core.wording import percent
from service.reports.formats import plain
from service.reports.plot_style import as_svg, figure


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (281329.51, 5, "281330"),
        (0.0059321, 3, "0.00593"),
        (130.2, 2, "130"),
        (1e9, 5, "1e+09"),
        (-12345.6, 5, "-12346"),
        (0, 5, "0"),
        (99999.7, 5, "100000"),
    ],
)
def test_numbers_as_people_read_them(value: float, digits: int, text: str) -> None:
    assert plain(value, digits) == text


def test_percentages() -> None:
    assert [percent(0.00123), percent(0.5, signed=True), percent(None)] == ["0.12 %", "+50 %", ""]


def test_a_long_line_is_drawn_with_few_points_and_keeps_its_peaks(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y = rng.standard_normal(50_000)
    y[rng.integers(1, 49_999, 2)] = 100, -100
    with figure(2) as drawn:
        axes = drawn.subplots()
        axes.plot(y, gid="noise")
        axes.set_ylim(-100, 100)
        text = as_svg(drawn, "noise", "noise")
    found = re.search(r'id="noise">\s*<path d="([^"]*)"', text)
    assert found is not None
    heights = np.array(re.findall(r"[ML] \S+ (\S+)", found[1]), float)
    assert heights.size < 15_000
    box = axes.get_window_extent()
    assert np.ptp(heights) == pytest.approx(box.height * 72 / drawn.dpi, abs=0.02)
