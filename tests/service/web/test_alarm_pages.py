"""Alarms on the page: found from the overview, acknowledged, shelved, commented; out of service, repaired."""

import time
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest
from playwright.sync_api import Page, Route, expect

from monitor_core.detection import Alarm, Cause
from monitor_core.monitoring import AlarmEvent, AlarmRules
from service.pipeline.persistence.alarm_recording import AlarmsSnapshot, as_recorded
from service.pipeline.persistence.replay_reports import NoReplayError, ReplayReports, ReportState
from service.store.alarm_entries import AlarmEntry
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import Note
from tests.end_to_end.processes import PATIENCE_S
from tests.service.web.conftest import Stage, with_axis
from tests.service.web.page_parts import alarm_row, tile

pytestmark = pytest.mark.browser
expect.set_options(timeout=PATIENCE_S * 1000)


def test_it_shows_alarms_active_first_and_those_that_are_not_yet_recorded_can_be_acknowledged(
    page: Page, stage: Stage, fm_alarm: Alarm
) -> None:
    page.goto("/#/alarms")
    expect(page.get_by_text("No alarm in this list.")).to_be_visible()
    entry, as_it_was = AlarmEntry("demo.axis2", "1", 1.0, fm_alarm, AlarmRules("high")), stage.snapshot
    waiting = as_recorded(entry, 7, recorded=False)
    stage.snapshot = replace(stage.snapshot, alarms=AlarmsSnapshot(unrecorded=(waiting,), waiting=1))
    row = alarm_row(page)
    expect(row).to_contain_text("active not yet recorded")
    expect(row).to_contain_text("unacknowledged, high priority")
    expect(row.get_by_role("button")).to_have_count(1)
    notes = list[tuple[int, str]]()

    def acknowledge(alarm_id: int, note: Note) -> RecordedAlarm:
        notes.append((alarm_id, note.comment))
        done = as_recorded(entry._replace(acknowledged=note), alarm_id, recorded=False)
        stage.snapshot = replace(stage.snapshot, alarms=AlarmsSnapshot(unrecorded=(done,), waiting=1))
        return done

    stage.acknowledge = acknowledge
    row.get_by_role("button", name="Acknowledge alarm 7").click()
    form = page.get_by_role("dialog")
    form.get_by_label("Comment").fill("heard it")
    form.get_by_role("button", name="Acknowledge").click()
    expect(row).to_contain_text("acknowledged, high priority")
    expect(row.get_by_role("button")).to_have_count(0)
    assert notes == [(7, "heard it")]
    expect(page.get_by_text("alarms that are not yet recorded: 1")).to_be_visible()
    stage.snapshot = as_it_was
    expect(page.get_by_text("No alarm in this list.")).to_be_visible()
    ended = replace(fm_alarm, raised_us=fm_alarm.raised_us + 1, ended_us=stage.now_us, direction="down")
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    stage.record("demo.axis2", "N m s/rad", 0.06, ended)
    sentence = "fm is 0.018 N m s/rad (31 %, 25 to 36) above its nominal value"
    for words in ("active", "demo.axis1", "fm", "up", "+0.0183 ± 0.0035", "+30.5 %", sentence):
        expect(alarm_row(page)).to_contain_text(words)
    expect(page.locator("#news")).to_have_text(f"New alarm: demo.axis1: {sentence}")
    expect(page).to_have_title("(1) axiswatch")
    expect(page.locator("link[rel=icon]")).to_have_attribute("href", "/static/icon-1.svg")
    page.get_by_role("button", name="ended").click()
    expect(alarm_row(page)).to_contain_text("demo.axis2")
    expect(alarm_row(page, 2)).to_have_count(0)


def test_from_the_overview_to_what_is_to_be_done(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    """Which axis, since when, how sure, what to do: one click away; the same is printed."""
    alike = replace(fm_alarm, causes=(Cause("fm", 0.97, ("ka",)), Cause("kT", 0.03)))
    stage.record("demo.axis1", "N m s/rad", 0.06, alike)
    page.goto("/")
    lines = page.get_by_role("list", name="1 active alarm")
    expect(lines).to_contain_text("since 2026-03-01 11:59:51")
    lines.get_by_role("link", name="fm is 0.018 N m s/rad").click()
    sheet = page.get_by_role("article", name="Alarm 1")
    for words in (
        "97.0 %",
        "would look the same: ka",
        "Acknowledge it",
        "from −0.6 s to +0.2 s with a probability of 90 %",
        "fm (viscous friction of the motor)",
        "step",
    ):
        expect(sheet).to_contain_text(words if words != "step" else "sudden")
    page.emulate_media(media="print")
    expect(page.locator("header")).to_be_hidden()
    expect(sheet.get_by_role("button", name="Print")).to_be_hidden()
    expect(sheet.get_by_text("Printed")).to_be_visible()


def test_an_alarm_is_named_when_the_evidence_is_in(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    changed = replace(fm_alarm, parameter="kT", stage="changed", causes=(), kind="", past=())
    changed = replace(changed, onset_low_us=None, onset_high_us=None)
    page.goto("/#/alarms")
    expect(page.get_by_text("No alarm in this list.")).to_be_visible()
    stage.record("demo.axis1", "1", 1.0, changed)
    expect(alarm_row(page)).to_contain_text("kT ▲ up not yet named")
    expect(alarm_row(page)).to_contain_text("something has changed, at first sight kT")
    expect(page.locator("#news")).to_contain_text("New alarm: demo.axis1")
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    expect(alarm_row(page)).to_contain_text("fm ▲ up at first kT")
    expect(alarm_row(page).get_by_role("cell").nth(4)).to_contain_text("−0.6 s +0.2 s")
    expect(page.locator("#news")).to_have_text(
        "Alarm: demo.axis1: fm is 0.018 N m s/rad (31 %, 25 to 36) above its nominal value"
    )
    expect(alarm_row(page, 2)).to_have_count(0)


def test_an_alarm_is_acknowledged_shelved_and_shown_again(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto("/#/alarms")
    row = alarm_row(page)
    expect(row).to_contain_text("unacknowledged, medium priority")
    row.get_by_role("button", name="Acknowledge").click()
    form = page.get_by_role("dialog", name="Acknowledge: demo.axis1 fm ▲ up")
    expect(form.get_by_label("Hide for")).to_have_count(0)
    form.get_by_label("Comment").fill("<b>seen</b>")
    form.get_by_role("button", name="Acknowledge").click()
    expect(row).to_contain_text("acknowledged, medium priority")
    expect(row.get_by_role("button", name="Acknowledge")).to_have_count(0)
    row.get_by_role("button", name="Shelve").click()
    form = page.get_by_role("dialog", name="Shelve: demo.axis1 fm ▲ up")
    expect(form.get_by_label("Comment")).to_be_empty()
    form.get_by_label("Hide for").select_option("3 days")
    form.get_by_label("Work order").fill("WO-17")
    form.get_by_role("button", name="Shelve").click()
    expect(row).to_contain_text("shelved until")
    expect(row).to_contain_text("work order WO-17")
    expect(page).to_have_title("axiswatch")
    row.get_by_role("button", name="Unshelve").click()
    form = page.get_by_role("dialog", name="Unshelve: demo.axis1 fm ▲ up")
    form.get_by_role("button", name="Cancel").click()
    expect(form).to_have_count(0)
    found = [(t.event, t.comment, t.work_order) for t in stage.journal.transitions(number)]
    assert found[1:] == [("acknowledge", "<b>seen</b>", ""), ("shelve", "", "WO-17")]
    alarm = stage.journal.get(number)
    assert alarm is not None
    assert alarm.shelved_until_us == stage.now_us + 3 * 86_400_000_000
    row.get_by_role("link", name="fm ▲ up").click()
    expect(page.get_by_role("table", name="What has happened to it")).to_contain_text("<b>seen</b>")


def test_an_axis_is_taken_out_of_service(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto("/#/axes/demo.axis1")
    page.get_by_role("button", name="Take out of service").click()
    form = page.get_by_role("dialog", name="Take out of service: demo.axis1")
    form.get_by_label("Comment").fill("new gearbox")
    form.get_by_role("button", name="Take out of service").click()
    expect(form).to_have_count(0)
    removed = stage.journal.services.removed()["demo.axis1"]
    assert (removed.who, removed.comment) == ("local", "new gearbox")
    with_axis(stage, out_of_service=removed)
    banner = page.get_by_role("region", name="Service")
    expect(banner).to_contain_text("Out of service since 2026-03-01 12:00:00 (local; new gearbox)")
    page.goto("/")
    expect(tile(page, "demo.axis1")).to_contain_text("out of service")
    expect(page).to_have_title("axiswatch")
    tile(page, "demo.axis1").click()
    banner.get_by_role("button", name="Return to service").click()
    page.get_by_role("dialog").get_by_role("button", name="Return to service").click()
    expect(page.get_by_role("dialog")).to_have_count(0)
    assert stage.journal.services.removed() == {}


TONES = """
    window.tones = 0;
    const start = OscillatorNode.prototype.start;
    OscillatorNode.prototype.start = function () { window.tones += 1; return start.call(this); };
"""


def test_a_new_alarm_sounds_where_that_is_wanted(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    """The switch itself sounds once; an alarm does when it comes, not when it is named or seen again."""
    page.add_init_script(TONES)
    page.goto("/#/alarms")
    expect(page.get_by_text("No alarm in this list.")).to_be_visible()
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    expect(alarm_row(page)).to_be_visible()
    # The list is asked for by itself: the switch has seen the alarm when the title has.
    expect(page).to_have_title("(1) axiswatch")
    assert page.evaluate("tones") == 0
    page.get_by_role("button", name="Sound: off").click()
    expect(page.get_by_role("button", name="Sound: on")).to_be_visible()
    assert page.evaluate("tones") == 1
    stage.record("demo.axis2", "N m s/rad", 0.06, replace(fm_alarm, raised_us=fm_alarm.raised_us + 1))
    expect(alarm_row(page, 1)).to_contain_text("follows alarm 1")
    expect(alarm_row(page, 2)).to_contain_text("first-out")
    page.wait_for_function("tones === 2")
    page.reload()
    expect(page.get_by_role("button", name="Sound: on")).to_be_visible()
    expect(alarm_row(page, 2)).to_be_visible()
    assert page.evaluate("tones") == 0
    page.get_by_role("button", name="most frequent").click()
    expect(page.get_by_role("table", name="most frequent")).to_contain_text("demo.axis2")


def test_what_is_refused_is_said_in_the_form_and_an_ended_alarm_gets_a_comment(
    page: Page, stage: Stage, fm_alarm: Alarm
) -> None:
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto("/#/alarms")
    alarm_row(page).get_by_role("button", name="Acknowledge").click()
    stage.journal.act(number, AlarmEvent.ACKNOWLEDGE, Note(stage.now_us, "somebody else"))
    form = page.get_by_role("dialog")
    form.get_by_role("button", name="Acknowledge").click()
    expect(form.get_by_role("alert")).to_contain_text("not possible: acknowledge; the alarm is acknowledged")
    form.get_by_role("button", name="Cancel").click()
    stage.record("demo.axis1", "N m s/rad", 0.06, replace(fm_alarm, ended_us=stage.now_us))
    page.goto(f"/#/alarms/{number}")
    page.get_by_role("button", name="Comment").click()
    form = page.get_by_role("dialog", name="Comment: demo.axis1 fm ▲ up")
    form.get_by_role("button", name="Comment").click()
    expect(form.get_by_role("alert")).to_contain_text("Give a comment, a work order or both.")
    form.get_by_label("Work order").fill("WO-18")
    form.get_by_role("button", name="Comment").click()
    expect(page.get_by_role("table", name="What has happened to it")).to_contain_text("work order WO-18")


def test_a_form_is_sent_once_and_waits_for_a_daemon_that_is_late(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    """Later than polled answers may be: else a person reads that nobody answered, and does it again."""
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    sent: list[str] = []

    def late(route: Route) -> None:
        sent.append(route.request.url)
        time.sleep(4.5)
        route.continue_()

    page.route("**/comment", late)
    page.goto(f"/#/alarms/{number}")
    page.get_by_role("button", name="Comment").click()
    form = page.get_by_role("dialog", name="Comment: demo.axis1 fm ▲ up")
    form.get_by_label("Work order").fill("WO-18")
    form.get_by_role("button", name="Comment").dblclick()
    expect(form).to_have_count(0)
    expect(page.get_by_role("table", name="What has happened to it")).to_contain_text("work order WO-18")
    assert len(sent) == 1


def test_the_oldest_alarm_can_be_reached(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    """A page has a hundred; each older one begins where the one before has ended."""
    for k in range(250):
        at_us = fm_alarm.raised_us - 60_000_000 * (250 - k)
        ended = replace(fm_alarm, onset_us=at_us, raised_us=at_us, updated_us=at_us, ended_us=at_us + 1, past=())
        stage.record(f"demo.axis{1 + k % 2}", "N m s/rad", 0.06, ended)
    page.goto("/#/alarms")
    page.get_by_role("button", name="ended").click()
    newer, older = (page.get_by_role("button", name=f"{which} alarms") for which in ("Newer", "Older"))
    for words in ("1 to 100 of 250", "101 to 200 of 250", "201 to 250 of 250"):
        expect(page.get_by_text(words)).to_be_visible()
        if not words.startswith("201"):
            older.press("Enter")
    expect(older).to_be_disabled()
    expect(older).to_be_focused()
    expect(alarm_row(page, 50).get_by_role("link", name="fm")).to_have_attribute("href", "#/alarms/1")
    newer.click()
    expect(page.get_by_text("101 to 200 of 250")).to_be_visible()
    page.get_by_role("button", name="all", exact=True).click()
    expect(page.get_by_text("1 to 100 of 250")).to_be_visible()


def test_after_a_form_the_keyboard_goes_on_where_it_was(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto("/#/alarms")
    row = alarm_row(page)
    button = row.get_by_role("button", name="Acknowledge")
    for end in ("Escape", "Cancel"):
        button.focus()
        page.keyboard.press("Enter")
        expect(page.get_by_role("dialog").get_by_label("Comment")).to_be_visible()
        if end == "Escape":
            page.keyboard.press("Escape")
        else:
            page.get_by_role("dialog").get_by_role("button", name="Cancel").press("Enter")
        expect(page.locator("dialog")).to_have_count(0)  # removed, not only closed: it takes no key any more
        expect(button).to_be_focused()
    page.keyboard.press("Enter")
    page.get_by_role("dialog").get_by_role("button", name="Acknowledge").press("Enter")
    expect(button).to_have_count(0)
    expect(row.get_by_role("button", name="Shelve")).to_be_focused()
    page.get_by_role("button", name="unacknowledged").click()
    expect(page.get_by_text("No alarm in this list.")).to_be_visible()


def test_a_form_that_has_just_been_left_does_not_close_the_next_one(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    """The browser reports the end of a dialog a moment later, which on a busy machine is after the next key."""
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto("/#/alarms")
    alarm_row(page).get_by_role("button", name="Acknowledge").click()
    expect(page.get_by_role("dialog", name="Acknowledge")).to_be_visible()
    shelve = alarm_row(page).get_by_role("button", name="Shelve", include_hidden=True)
    shelve.evaluate("button => { document.querySelector('dialog').close(); button.click(); }")
    form = page.get_by_role("dialog", name="Shelve")
    expect(form).to_be_visible()
    page.evaluate("() => new Promise((done) => setTimeout(done, 100))")
    expect(form).to_be_visible()


class SlowReplays:
    """Makes a report where the test says so; the first time it is busy."""

    def __init__(self, page: Path) -> None:
        self._page, self.shown, self._asked = page, ReportState("none"), 0

    def state(self, _alarm: RecordedAlarm) -> ReportState:
        return self.shown

    def page(self, _alarm: RecordedAlarm) -> Path:
        return self._page

    def begin(self, _alarm: RecordedAlarm) -> None:
        self._asked += 1
        if self._asked == 1:
            raise NoReplayError("the report of alarm 7 is being made; try again after it")
        self.shown = ReportState("running")


@pytest.fixture
def replays(stage: Stage, tmp_path: Path) -> SlowReplays:
    found = SlowReplays(tmp_path / "frames-alarm1.html")
    stage.replays = cast(ReplayReports, found)
    return found


def test_a_replay_report_is_made_and_saved(
    replays: SlowReplays, stage: Stage, page: Page, fm_alarm: Alarm, tmp_path: Path
) -> None:
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto(f"/#/alarms/{number}")
    make = page.get_by_role("button", name="Make the replay report")
    make.click()
    expect(page.get_by_text("the report of alarm 7 is being made; try again after it")).to_be_visible()
    make.click()
    expect(page.get_by_text("The replay report is being made.")).to_be_visible()
    replays.shown = ReportState("failed", "its process was ended")
    expect(page.get_by_text("its process was ended")).to_be_visible()
    (tmp_path / "frames-alarm1.html").write_text("<h1>Replay</h1>", encoding="utf-8")
    make.click()
    expect(page.get_by_text("The replay report is being made.")).to_be_visible()  # the request has been answered
    replays.shown = ReportState("made")
    with page.expect_download() as saved:
        page.get_by_role("link", name="Replay report").click()
    assert saved.value.path().read_text(encoding="utf-8") == "<h1>Replay</h1>"
