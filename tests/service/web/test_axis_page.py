"""The page of an axis in a real browser: estimates over time, the drive, signals of the last seconds, Bode plot."""

import re

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from monitor_core.detection import Alarm
from monitor_core.samples import SampleBlock
from tests.service.web.conftest import NOON_US, Stage, with_axis
from tests.service.web.page_parts import serious_faults, tile
from tests.service.web.watched_drives import reference, traced

pytestmark = pytest.mark.browser


def test_an_axis_shows_estimates_over_time_and_the_long_term_trend_where_it_is_known(page: Page) -> None:
    page.goto("/")
    tile(page, "demo.axis1").click()
    panel = page.get_by_role("region", name="fm")
    for words in (
        "viscous friction of the motor",
        "0.0783 ± 0.0042",
        "0.06000",
        "+30.5 %",
        "72.5 % of threshold",
        "tested for 10 min with these nominal values",
    ):
        expect(panel).to_contain_text(words)
    for plot in ("fm: estimate with 90 % band", "fm: test statistic"):
        expect(page.get_by_role("img", name=plot).locator("canvas")).to_be_visible()
    drift = "fm drifts up by 0.0024 N m s/rad ± 0.00013 per day; fm reaches 0.09 N m s/rad in 12 to 20 days"
    expect(page.get_by_text(drift)).to_be_visible()
    expect(page.get_by_role("img", name="fm: means over its long-term history").locator("canvas")).to_be_visible()
    changes_the_range_of_time(page)
    page.goto("/#/axes/demo.axis2")
    expect(page.get_by_text("Too little history for a trend yet.")).to_be_visible()


def changes_the_range_of_time(page: Page) -> None:
    """By presets, keys and mouse."""
    tools = page.get_by_role("group", name="Time range")
    expect(tools).to_contain_text("2026-03-01 11:49:59 – 2026-03-01 11:59:59 (UTC)")
    tools.get_by_role("button", name="1 h").click()
    expect(tools).to_contain_text("2026-03-01 10:59:59")
    tools.focus()
    page.keyboard.press("ArrowLeft")
    expect(tools).to_contain_text("2026-03-01 10:44:59 – 2026-03-01 11:44:59")
    expect(tools.get_by_role("button", name="live")).to_have_attribute("aria-pressed", "false")
    page.keyboard.press("+")
    expect(tools).to_contain_text("2026-03-01 10:59:59 – 2026-03-01 11:29:59")
    page.keyboard.press("Home")
    expect(tools).to_contain_text("– 2026-03-01 11:59:59")
    plot = page.get_by_role("img", name="fm: estimate").locator(".u-over")
    plot.scroll_into_view_if_needed()
    place = plot.bounding_box()
    assert place is not None
    middle = place["y"] + place["height"] / 2
    page.mouse.move(place["x"] + 0.25 * place["width"], middle)
    page.mouse.down()
    page.mouse.move(place["x"] + 0.75 * place["width"], middle)
    page.mouse.up()
    expect(tools).to_contain_text(re.compile(r"11:37:\d\d – 2026-03-01 11:52:\d\d"))


def add_samples(stage: Stage) -> None:
    """A second of samples, as the worker adds them; one of them is an outlier."""
    observer = stage.live.observer()
    assert observer is not None
    k = np.arange(200)
    y = np.sin(0.05 * k)
    eps = np.where(k == 100, np.nan, 1e-3 * np.cos(k))
    block = SampleBlock(NOON_US - 1_000_000 + 5000 * k, np.cos(0.05 * k), y)
    observer("demo.axis1", block, traced(eps, y - np.nan_to_num(eps, nan=0.01)))


def shows_the_drive(page: Page) -> None:
    """As a chain that marks the parameter with an alarm."""
    drive = page.get_by_role("region", name="Drive")
    parts = drive.locator(".chain > li")
    expect(parts).to_have_count(7)  # motor, gear, its shaft, spring, gearbox, spring, arm
    expect(parts.first).to_contain_text("Jm 0.005896 kg")
    expect(parts.last).to_contain_text("1/Ja")
    marked = drive.locator(".part.out")
    expect(marked).to_have_count(1)
    for words in ("viscous friction", "fm", "+30.5 %", "alarm"):
        expect(marked).to_contain_text(words)
    expect(marked.get_by_role("img", name="medium priority")).to_be_visible()
    expect(drive.get_by_text("not tested")).to_have_count(1)  # 1/Ja is not observed


def test_the_drive_its_signals_and_its_bode_plot_which_are_asked_for_once_they_are_opened(
    page: Page, stage: Stage, fm_alarm: Alarm
) -> None:
    with_axis(stage, watched=reference(outlier_limit=6.0))
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url.rsplit("/", 1)[-1].split("?")[0]))
    page.goto("/#/axes/demo.axis1")
    signals = page.get_by_role("button", name="Signals of the last seconds")
    expect(signals).to_have_attribute("aria-expanded", "false")
    shows_the_drive(page)
    assert not {"signals", "bode"} & set(asked)
    signals.focus()
    with page.expect_response(lambda response: "/signals" in response.url):
        page.keyboard.press("Enter")
    expect(page.get_by_text("The daemon keeps the samples from now on")).to_be_visible()
    add_samples(stage)
    for plot in ("Motor torque [N m]", "Measured and predicted motion [rad]", "Prediction error [rad]"):
        expect(page.get_by_role("img", name=plot).locator("canvas")).to_be_visible()
    expect(page.get_by_text("limit of outliers (± 6.000")).to_be_visible()
    page.get_by_role("button", name="Bode plot").click()
    # The first answer loads a part of the program; the page asks again.
    expect(page.get_by_text("Largest change of the magnitude: −2.")).to_be_visible(timeout=60_000)
    for plot in ("Magnitude [dB, of rad/(N\u202fm)]", "Phase [°]"):
        expect(page.get_by_role("img", name=plot).locator("canvas")).to_be_visible()
    assert serious_faults(page) == []
    page.emulate_media(color_scheme="dark")
    assert serious_faults(page) == []
    page.set_viewport_size({"width": 360, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    signals.click()
    expect(page.get_by_role("img", name="Motor torque [N m]")).to_have_count(0)
