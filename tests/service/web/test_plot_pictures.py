"""What a plot draws of a history with gaps, and of values that are huge, constant or no numbers: pictures compared."""

import io
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect
from scipy.ndimage import maximum_filter, minimum_filter

from service.pipeline.persistence.history_recording import HistoryRecording
from service.store.history_store import HistoryPoint, HistorySeries
from tests.service.web.conftest import NOON_US, Stage, point_values

pytestmark = pytest.mark.browser

PICTURES = Path(__file__).parent / "pictures"
NEAR = 24
"""Of 255: a pixel may differ by so much from what the golden picture has around it, within a pixel"""
MOST = 5e-4
"""Of the pixels: a line that is not there, or is too much, takes more than a hundred times as many."""

ALIKE = 5
"""Pictures one after the other, a tenth of a second each, that are the same: nothing more comes"""

CASES: dict[str, Callable[[int], float]] = {
    "no-numbers": lambda k: np.nan if k % 20 < 5 else 0.9 + 2e-3 * k,
    "alone": lambda k: 0.9 + 2e-3 * k if k % 12 == 0 else np.inf,
    "huge": lambda k: (-1.0) ** (k // 8) * 1e30,
    "constant": lambda _: 0.99317,
    "gap": lambda k: 0.9 + 2e-2 * (k % 9),
}


@pytest.mark.parametrize("name", CASES)
def test_the_plot_looks_as_it_did(name: str, page: Page, stage: Stage, history: HistoryRecording) -> None:
    """Its inner part, without the texts of the axes: those are drawn with the fonts of the machine."""
    stage.healthy()
    fill(history, CASES[name], gap=name == "gap")
    page.set_viewport_size({"width": 1000, "height": 900})
    page.goto("/#/axes/demo.axis2")
    panel = page.get_by_role("region", name="kT")
    plot = panel.get_by_role("img", name="kT: estimate").locator(".u-over")
    expect(plot).to_be_visible()
    plot.scroll_into_view_if_needed()
    drawn = settled(plot)
    path = PICTURES / f"{name}.png"
    if os.environ.get("AXISWATCH_UPDATE_GOLDEN"):
        Image.fromarray(drawn).save(path, optimize=True)
    golden = pixels(path.read_bytes())
    assert drawn.shape == golden.shape
    share = max(differing(drawn, golden), differing(golden, drawn))
    print(name, share)
    assert share < MOST


def fill(history: HistoryRecording, estimate: Callable[[int], float], *, gap: bool) -> None:
    """Ten minutes of the second axis until noon, of which three may lack."""
    assert history.store is not None
    series = HistorySeries("demo.axis2", "kT", "1")
    times = [NOON_US // 1_000_000 - 10 * (60 - k) for k in range(60)]
    history.store.add(
        [
            HistoryPoint(series, t, (estimate(k), *point_values(k)[1:]))
            for k, t in enumerate(times)
            if not (gap and 20 <= k < 38)
        ]
    )


def settled(plot: Locator) -> np.ndarray:
    """The picture once it no longer changes: the history comes after the page."""
    before, alike = np.zeros(0), 0
    for _ in range(100):
        drawn = pixels(plot.screenshot())
        alike = alike + 1 if np.array_equal(drawn, before) else 0
        if alike == ALIKE:
            return drawn
        before = drawn
        plot.page.wait_for_timeout(100)
    raise AssertionError("the plot goes on changing")


def pixels(picture: bytes) -> np.ndarray:
    """Red, green and blue (H, W, 3)."""
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"))


def differing(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the pixels of a whose colour b has nowhere around them."""
    window = (3, 3, 1)
    low, high = minimum_filter(b, window).astype(int), maximum_filter(b, window).astype(int)
    return float(((a < low - NEAR) | (a > high + NEAR)).any(axis=2).mean())


def test_a_line_that_lacks_is_seen() -> None:
    golden = np.full((100, 400, 3), 255, np.uint8)
    drawn = golden.copy()
    drawn[50, :, :2] = 0
    assert differing(drawn, golden) > 4 * MOST
