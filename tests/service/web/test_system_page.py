"""The daemon itself on the page: its buses, files, configuration, who has changed what; the commissioning."""

import pytest
from playwright.sync_api import Page, expect

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmEvent
from service.store.alarm_transitions import Note
from tests.end_to_end.processes import PATIENCE_S
from tests.service.web.conftest import Stage
from tests.service.web.page_parts import unfold

pytestmark = pytest.mark.browser
expect.set_options(timeout=PATIENCE_S * 1000)


def test_the_system_page_shows_buses_files_configuration_and_who_has_changed_what(
    configured: Stage, page: Page, fm_alarm: Alarm
) -> None:
    number = configured.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    note = Note(configured.now_us, "anna", "<b>seen</b>", "WO-17")
    configured.journal.act(number, AlarmEvent.ACKNOWLEDGE, note)
    page.clock.install()
    page.goto("/#/system")
    buses = page.get_by_role("table", name="Buses")
    for words in ("down: Network is down", "242\u202f420", "queue full 12"):
        expect(buses).to_contain_text(words)
    samples = page.get_by_role("table", name="Samples by axis")
    expect(samples).to_contain_text("no partner 5")
    expect(samples).not_to_contain_text("projected")  # such samples are used
    expect(page.get_by_role("table", name="Clocks")).to_contain_text("fitted cycle")
    expect(page.get_by_role("table", name="Files")).to_contain_text("alarms.sqlite")
    page.clock.run_for(11_000)
    expect(page.get_by_text("of one core of")).to_be_visible()  # between two answers
    unfold(page)
    text = page.get_by_label("Configuration", exact=True)
    expect(text).to_contain_text('nominal_file = "demo.axis1-nominal.toml"')
    trail = page.get_by_role("table", name="Who has changed what")
    for words in ("anna", "acknowledged", "demo.axis1", "Alarm 1 fm", "<b>seen</b>; work order WO-17"):
        expect(trail).to_contain_text(words)
    page.get_by_role("button", name="Record the last minutes").click()
    expect(page.get_by_role("alert")).to_contain_text("no frames are kept")


def test_the_commissioning_is_checked_and_its_reports_open(configured: Stage, page: Page) -> None:
    page.goto("/#/system")
    page.get_by_role("link", name="Commissioning", exact=True).click()
    expect(page.get_by_role("heading", name="Commissioning", exact=True)).to_be_visible()
    expect(page.get_by_text("Axes without samples: see what comes with")).to_be_visible()
    steps = page.get_by_role("table", name="Steps")
    for words in ("1 of 2 axes", "axiswatch listen --config axiswatch.toml"):
        expect(steps).to_contain_text(words)
    expect(page.get_by_role("table", name="Signals now")).to_have_count(0)
    page.get_by_role("button", name="Check all axes").click()
    found = page.get_by_role("table", name="Signals now").get_by_role("row")
    expect(found).to_have_count(3)
    for words in (
        "200.0",
        "0.4100 ms",
        "0.5 %",
        "−1.500 … 1.250",
        "Axis1State.Torque",
        "the torque <b>is stuck</b>",
    ):
        expect(found.nth(1)).to_contain_text(words)
    page.get_by_role("link", name="report: Nominal values, demo.axis2").click()
    expect(page.get_by_role("heading", name="Identification of demo.axis2")).to_be_visible()
