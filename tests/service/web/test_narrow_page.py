"""The page on a telephone, by the keyboard alone, and on paper."""

import re
from dataclasses import replace

import pytest
from playwright.sync_api import Page, expect

from monitor_core.detection import Alarm, Cause
from monitor_core.monitoring.unrecorded_heat import OTHER_HEAT
from tests.end_to_end.processes import PATIENCE_S
from tests.service.web.conftest import Stage
from tests.service.web.page_parts import ADDRESSES, serious_faults, unfold

pytestmark = pytest.mark.browser
expect.set_options(timeout=PATIENCE_S * 1000)

FORMS = {
    "#/alarms": ("Quittieren", "Zurückstellen", "Kommentieren"),
    "#/axes/demo.axis1": ("Außer Betrieb nehmen", "Neu einlernen"),
}


def go(page: Page, address: str) -> None:
    page.evaluate("(address) => { location.hash = address; }", address)
    expect(page.locator("main")).to_contain_text("demo.axis1")


def open_on_a_telephone(page: Page) -> None:
    """The page in German, whose words are longer."""
    page.set_viewport_size({"width": 360, "height": 740})
    page.goto("/")
    page.get_by_role("button", name="Deutsch").click()


def test_on_a_telephone_nothing_is_cut_off_and_axe_finds_nothing(
    configured: Stage, page: Page, fm_alarm: Alarm
) -> None:
    configured.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    open_on_a_telephone(page)
    for address in ADDRESSES:
        go(page, address)
        unfold(page)
        assert page.evaluate("document.documentElement.scrollWidth") == 360, address
        assert serious_faults(page) == [], address


def test_each_form_is_filled_in_by_the_keyboard_and_left_where_it_was_opened(
    stage: Stage, page: Page, fm_alarm: Alarm
) -> None:
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    open_on_a_telephone(page)
    for address, names in FORMS.items():
        go(page, address)
        for name in names:
            button = page.locator("main").get_by_role("button", name=name)
            button.press("Enter")
            form = page.get_by_role("dialog", name=name)
            expect(form).to_be_visible()
            assert serious_faults(page) == [], name
            for box in form.get_by_role("checkbox").all():
                assert (box.bounding_box() or {"width": 0})["width"] >= 18
            for _ in range(12):  # the last stop of the form sends it
                if form.get_by_role("button", name=name).and_(page.locator(":focus")).count():
                    break
                page.keyboard.press("Tab")
            expect(form.get_by_role("button", name=name)).to_be_focused()
            page.keyboard.press("Escape")
            expect(form).to_have_count(0)
            expect(button).to_be_focused()


def test_an_alarm_on_paper_is_a_sheet_with_dates_and_the_name_of_its_frames(
    stage: Stage, page: Page, fm_alarm: Alarm
) -> None:
    """Also where it is printed on the day of the alarm; a sheet is narrower than many screens."""
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.clock.set_fixed_time(stage.now_us / 1e6)
    page.goto(f"/#/alarms/{number}")
    sheet = page.get_by_role("article", name="Alarm 1")
    raised = sheet.locator("dt", has_text=re.compile("^Raised$")).locator("+ dd")
    expect(raised).to_have_text("11:59:53", use_inner_text=True)
    page.set_viewport_size({"width": 680, "height": 960})
    page.emulate_media(media="print")
    expect(raised).to_have_text("2026-03-01 11:59:53", use_inner_text=True)
    expect(sheet.get_by_text("Printed 2026-03-01 12:00:00")).to_be_visible()
    head = sheet.get_by_role("table", name="What has happened to it").get_by_role("columnheader", name="Event")
    assert (head.bounding_box() or {"height": 0})["height"] > 10  # a table, not a block for each row
    assert page.pdf(format="A4").count(b"/Type /Page\n") == 1


def test_a_fault_of_a_sensor_asks_for_the_sensor_and_a_payload_for_the_payload(
    stage: Stage, page: Page, fm_alarm: Alarm
) -> None:
    advice = {"output scale": "Check sensor, cable", "load": "Compare what the robot carries"}
    for k, (name, words) in enumerate(advice.items()):
        later = replace(fm_alarm, parameter=name, causes=(Cause(name, 1.0),), raised_us=fm_alarm.raised_us + k)
        number = stage.record("demo.axis1", "1", 1.0, later)
        page.goto(f"/#/alarms/{number}")
        expect(page.get_by_role("article")).to_contain_text(words)


@pytest.mark.parametrize("is_known", [False, True])
def test_friction_of_an_axis_whose_warmth_is_not_known_may_be_the_cold(
    is_known: bool, stage: Stage, page: Page, fm_alarm: Alarm
) -> None:
    if not is_known:
        axes = tuple(replace(axis, heat=None) for axis in stage.snapshot.axes)
        stage.snapshot = replace(stage.snapshot, axes=axes)
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto(f"/#/alarms/{number}")
    advice = page.get_by_role("article").get_by_text("A colder or warmer gearbox")
    expect(page.get_by_role("article")).to_contain_text("fm (viscous friction of the motor)")
    expect(advice).to_have_count(0 if is_known else 1)
    heat = replace(fm_alarm, causes=(Cause("fm", 1.0, (OTHER_HEAT,)),), raised_us=fm_alarm.raised_us + 1)
    number = stage.record("demo.axis1", "N m s/rad", 0.06, heat)
    page.goto(f"/#/alarms/{number}")
    expect(page.get_by_role("article")).to_contain_text(f"would look the same: {OTHER_HEAT}")
    expect(advice).to_have_count(1)
    expect(page.get_by_role("article")).not_to_contain_text("cannot tell these apart")


def test_of_several_alarms_a_tile_names_the_first_and_how_many_more(stage: Stage, page: Page, fm_alarm: Alarm) -> None:
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    later_us = fm_alarm.raised_us + 9_000_000
    later = replace(fm_alarm, parameter="kT", direction="down", raised_us=later_us)
    stage.record("demo.axis1", "1", 1.0, later)
    page.goto("/")
    expect(page.locator("a.tile").first.locator(".head .state")).to_have_text("▲ fm +1")
