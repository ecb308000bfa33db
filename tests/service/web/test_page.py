"""The dashboard in a real browser: what it shows, that it follows, and that it says when nobody answers."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Literal
from urllib.parse import quote

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from monitor_core.detection import Alarm, Cause
from monitor_core.monitoring import AlarmEvent, AlarmRules, NotTested, Status
from service.can.frames import Frame, FrameBlock
from service.config.drive_sources import shipped
from service.pipeline.alarm_recording import AlarmsSnapshot, as_recorded
from service.pipeline.recording import Extracts, RecordingFolder
from service.pipeline.snapshot import AxisSnapshot
from service.store.alarm_transitions import Note
from service.store.journal import Entry
from service.store.tokens import Scope, TokenFile
from service.web.access import Access
from service.web.app import STATIC
from service.web.report_pages import ReportPages
from service.web.robot_setup import RobotSetup, SignalCheck
from tests.service.web.conftest import (
    PARAMETERS,
    SIGNAL_CHECK,
    Stage,
    monitored_axis,
    robot_setup,
    with_status,
)
from tests.service.web.page_parts import Daemon, alarm_row, parameter, tile

pytestmark = pytest.mark.browser
expect.set_options(timeout=30_000)  # a busy machine may take long
DASHBOARD = STATIC.with_name("dashboard")


@pytest.fixture
def shipped_report(stage: Stage) -> Path:
    """The report of the demo, served with the page."""
    folder = shipped("demo/axiswatch.toml").parent
    stage.reports = ReportPages(folder, [axis.id for axis in stage.snapshot.axes])
    return folder


@pytest.fixture
def configured(stage: Stage) -> Stage:
    """With the configuration of the demo."""
    stage.setup = robot_setup()
    stage.reports = ReportPages(stage.setup.file.parent, [axis.id for axis in stage.snapshot.axes])
    return stage


def test_the_overview_shows_axes_with_estimates(page: Page) -> None:
    page.goto("/")
    row = parameter(page, "demo.axis1", "fm")
    for words in ("fm", "0.0783 ± 0.0050", "+30.5 %", "alarm"):
        expect(row).to_contain_text(words)
    expect(tile(page, "demo.axis2")).to_contain_text("no sample yet")
    expect(parameter(page, "demo.axis2", "fm")).to_contain_text("–")


def test_the_axes_are_searched_filtered_and_reached_by_keys(
    page: Page, stage: Stage, fm_alarm: Alarm
) -> None:
    stage.record("demo.axis2", "N m s/rad", 0.06, fm_alarm)
    page.goto("/")
    expect(page.locator("a.tile").first).to_contain_text("demo.axis2")  # it needs more
    page.get_by_label("Order").select_option("by name")
    expect(page.locator("a.tile").first).to_contain_text("demo.axis1")
    page.get_by_role("button", name="alarm 1").click()
    expect(page.locator("a.tile")).to_have_count(1)
    page.get_by_role("button", name="all 2").click()
    page.keyboard.press("/")
    page.keyboard.type("viscous AXIS1")
    expect(page.locator("a.tile")).to_have_count(1)
    page.keyboard.press("Control+A")
    page.keyboard.type("nothing like it")
    expect(page.get_by_text("No axis matches.")).to_be_visible()
    page.get_by_label("Search axis or parameter").fill("")
    tile(page, "demo.axis1").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", name="demo.axis2")).to_be_visible()


def test_three_hundred_axes_are_on_one_screen(page: Page, stage: Stage) -> None:
    axes = [monitored_axis(f"axis{k}") for k in range(300)]
    stage.snapshot = replace(stage.snapshot, axes=tuple(axes), buses=stage.snapshot.buses[:1], messages=())
    page.set_viewport_size({"width": 1920, "height": 1080})
    page.goto("/")
    expect(page.locator("a.tile")).to_have_count(300)
    label = re.compile(
        r"demo.axis7: .*kT 0\.993 ± 0\.035, −0\.7 %, tracking; 1/Ja .*not tested; fm .*, \+30\.5 %, alarm"
    )
    expect(page.get_by_title("demo.axis7", exact=True)).to_have_attribute("aria-label", label)
    outside = "[...document.querySelectorAll('a.tile')].filter((t) => t.getBoundingClientRect().bottom > 1080).length"
    assert page.evaluate(outside) == 0


def test_it_tells_why_it_is_not_ready(page: Page, stage: Stage) -> None:
    page.goto("/")
    expect(page.locator("#state")).to_have_text("not ready")
    expect(page.get_by_text("bus can1: down: Network is down")).to_be_visible()
    expect(page.get_by_text("its checkpoint is not used")).to_be_visible()
    stage.healthy()
    expect(page.locator("#state")).to_have_text("ready")
    for hidden in ("#reasons", "#insecure", "#sign-in"):
        expect(page.locator(hidden)).to_have_count(0)


def test_the_report_of_the_commissioning_opens_from_it(shipped_report: Path, page: Page) -> None:
    """With its styles, as the browser applies them, and from there the page of an axis."""
    page.goto("/")
    page.get_by_role("link", name="Commissioning report").click()
    expect(page.get_by_role("heading", name="Commissioned robot")).to_be_visible()
    expect(page.locator(".verdict")).to_have_css("border-left-style", "solid")
    page.get_by_role("link", name="demo.axis2-calibration.html").click()
    expect(page.get_by_role("heading", name="Calibration of demo.axis2")).to_be_visible()
    assert page.locator("svg").count() >= 3


def test_without_a_report_there_is_no_link(page: Page) -> None:
    page.goto("/")
    expect(page.locator("#state")).to_have_text("not ready")
    expect(page.get_by_text("Commissioning report")).to_have_count(0)


def test_it_shows_alarms_active_first(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    page.goto("/#/alarms")
    expect(page.get_by_text("No alarm in this list.")).to_be_visible()
    ended = replace(fm_alarm, raised_us=fm_alarm.raised_us + 1, ended_us=stage.now_us, direction="down")
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    stage.record("demo.axis2", "N m s/rad", 0.06, ended)
    sentence = "fm is 0.018 N m s/rad (31 %) above its nominal value"
    for words in ("active", "demo.axis1", "fm", "up", "+0.0183 ± 0.0041", "+30.5 %", sentence):
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
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    expect(alarm_row(page)).to_contain_text("fm ▲ up at first kT")
    expect(alarm_row(page).get_by_role("cell").nth(4)).to_contain_text("−0.6 s +0.2 s")
    expect(page.locator("#news")).to_have_text(
        "Alarm: demo.axis1: fm is 0.018 N m s/rad (31 %) above its nominal value"
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
    first, *others = stage.snapshot.axes
    stage.snapshot = replace(stage.snapshot, axes=(replace(first, out_of_service=removed), *others))
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


def test_an_ended_alarm_gets_a_comment(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    number = stage.record("demo.axis1", "N m s/rad", 0.06, replace(fm_alarm, ended_us=stage.now_us))
    page.goto(f"/#/alarms/{number}")
    page.get_by_role("button", name="Comment").click()
    form = page.get_by_role("dialog", name="Comment: demo.axis1 fm ▲ up")
    form.get_by_role("button", name="Comment").click()
    expect(form.get_by_role("alert")).to_contain_text("status 422")
    form.get_by_label("Work order").fill("WO-18")
    form.get_by_role("button", name="Comment").click()
    expect(page.get_by_role("table", name="What has happened to it")).to_contain_text("work order WO-18")


def test_what_is_refused_is_said_in_the_form(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto("/#/alarms")
    alarm_row(page).get_by_role("button", name="Acknowledge").click()
    stage.journal.act(number, AlarmEvent.ACKNOWLEDGE, Note(stage.now_us, "somebody else"))
    form = page.get_by_role("dialog")
    form.get_by_role("button", name="Acknowledge").click()
    expect(form.get_by_role("alert")).to_contain_text("not possible: acknowledge; the alarm is acknowledged")


def test_an_alarm_that_is_not_yet_recorded_is_shown_without_buttons(
    page: Page, stage: Stage, fm_alarm: Alarm
) -> None:
    waiting = as_recorded(Entry("demo.axis2", "1", 1.0, fm_alarm, AlarmRules("high")))
    stage.snapshot = replace(stage.snapshot, alarms=AlarmsSnapshot(unrecorded=(waiting,), waiting=1))
    page.goto("/#/alarms")
    row = alarm_row(page)
    expect(row).to_contain_text("active not yet recorded")
    expect(row).to_contain_text("unacknowledged, high priority")
    expect(row.get_by_role("button")).to_have_count(0)
    expect(page.get_by_text("alarms that are not yet recorded: 1")).to_be_visible()


def test_it_follows_the_estimates(page: Page, stage: Stage) -> None:
    page.goto("/")
    row = parameter(page, "demo.axis1", "kT")
    expect(row).to_contain_text("0.993 ± 0.035")
    kT, *others = PARAMETERS
    kT = replace(kT, estimate=0.8, standard_deviation=0.01, status=Status.ALARM)
    with_status(stage, parameters=(kT, *others))
    expect(row).to_contain_text("0.800 ± 0.020")
    expect(row).to_contain_text("−20.0 %")


def test_it_asks_for_a_token_where_the_daemon_wants_one(
    stage: Stage, shipped_report: Path, tmp_path: Path, browser: Browser
) -> None:
    """A wrong one is refused; the right one is kept by the tab alone, and the reports open by their links."""
    tokens = TokenFile(tmp_path / "tokens.json")
    secret = tokens.new("anna", Scope.READ)
    stage.access = Access(tokens)
    daemon = Daemon(stage)
    try:
        page = browser.new_page(base_url=f"http://127.0.0.1:{daemon.port}")
        page.goto("/docs")
        expect(page.get_by_label("Token")).to_be_visible()
        page.goto("/")
        expect(page.locator("#state")).to_have_text("token needed")
        expect(page.get_by_role("alert")).to_have_count(0)
        for given, words in ((secret[:-1], "not known, or was revoked"), (secret, "")):
            page.get_by_label("Token").fill(given)
            page.get_by_role("button", name="Use").click()
            if words:
                expect(page.locator("#sign-in")).to_contain_text(words)
        expect(page.locator("a.tile")).to_have_count(2)
        expect(page.locator("#sign-in")).to_have_count(0)
        expect(page.get_by_role("link", name="Metrics")).to_have_count(0)
        page.get_by_role("link", name="Commissioning report").click()
        page.get_by_role("link", name="demo.axis2-calibration.html").click()
        expect(page.get_by_role("heading", name="Calibration of demo.axis2")).to_be_visible()
        page.goto("/docs")
        expect(page.get_by_text("GET /api/v1/alarms", exact=False).first).to_be_visible()
        page.goto("/")
        expect(page.locator("a.tile")).to_have_count(2)
        tokens.revoke("anna")
        expect(page.locator("#sign-in")).to_contain_text("not known, or was revoked")
        other = browser.new_page(base_url=f"http://127.0.0.1:{daemon.port}")
        other.goto("/")
        expect(other.locator("#sign-in")).to_contain_text("this needs a token")
    finally:
        daemon.stop()


def test_frames_are_saved_with_a_token_too(
    stage: Stage, tmp_path: Path, browser: Browser, fm_alarm: Alarm
) -> None:
    tokens = TokenFile(tmp_path / "tokens.json")
    stage.access = Access(tokens)
    folder = RecordingFolder(tmp_path / "recordings", 10**9)
    stage.extracts = Extracts(folder, 8.0, 2.0, lambda: stage.now_us)
    stage.extracts.add("can0", FrameBlock.from_frames([Frame(fm_alarm.raised_us, 0x101, False, bytes(8))]))
    written = stage.extracts.request()
    stage.extracts.tick()
    name = written.result(10).name
    secret = tokens.new("anna", Scope.READ)
    daemon = Daemon(stage)
    try:
        page = browser.new_page(base_url=f"http://127.0.0.1:{daemon.port}")
        page.goto("/#/system")
        page.get_by_label("Token").fill(secret)
        page.get_by_role("button", name="Use").click()
        with page.expect_download() as saved:
            page.get_by_role("link", name=name).click()
        assert saved.value.path().read_bytes() == (tmp_path / "recordings" / name).read_bytes()
    finally:
        daemon.stop()
        stage.extracts.close()


def test_it_says_that_it_is_not_protected(stage: Stage, browser: Browser) -> None:
    stage.access = Access(remote=True, insecure=True)
    daemon = Daemon(stage)
    try:
        page = browser.new_page(base_url=f"http://127.0.0.1:{daemon.port}")
        page.goto("/")
        expect(page.locator("#insecure")).to_contain_text("everyone whose machine reaches this address")
    finally:
        daemon.stop()


def test_it_says_for_how_long_nobody_has_answered_and_comes_back(
    page: Page, daemon: Daemon, stage: Stage
) -> None:
    page.goto("/")
    expect(page.locator("a.tile")).to_have_count(2)
    expect(page.get_by_role("alert")).to_have_count(0)
    daemon.stop()
    expect(page.get_by_role("alert")).to_contain_text("No data for", timeout=5000)
    expect(page.locator("#state")).to_have_text("no answer")
    expect(page.locator("main")).to_have_css("filter", "grayscale(1)")
    expect(page.locator("a.tile")).to_have_count(2)
    again = Daemon(stage, daemon.port)
    try:
        expect(page.get_by_role("alert")).to_have_count(0)
        expect(page.locator("#state")).to_have_text("not ready")
    finally:
        page.goto("about:blank")
        again.stop()


def test_requests_that_hang_are_no_answers(page: Page) -> None:
    """As with a daemon that is stopped: the connections stay, and nothing comes."""
    page.goto("/")
    expect(page.locator("a.tile")).to_have_count(2)
    page.route("**/api/**", lambda _: None)
    expect(page.get_by_role("alert")).to_contain_text("No data for", timeout=5000)


NAMES = {
    "HTML": "<img src=x onerror=alert(1)>",
    "right to left": "\u202e\u05e8\u05d5\u05d1\u05d5\u05d8.\u05e6\u05d9\u05e8/1",
    "long": "robot." + "a" * 194,
}


def setup_of(axes: list[AxisSnapshot]) -> RobotSetup:
    """A configuration of axes with these names, which no file may have, and findings with them."""
    setup = robot_setup()
    config = setup.config()
    model = config.robot[0].axis[0]
    names = [(axis.robot, (model.model_copy(update={"name": axis.name}),)) for axis in axes]
    robots = tuple(config.robot[0].model_copy(update={"name": name, "axis": own}) for name, own in names)
    named = config.model_copy(update={"robot": robots})

    def look(axis_id: str) -> SignalCheck:
        signal = SIGNAL_CHECK.signals[0].model_copy(update={"signal": axis_id})
        return SIGNAL_CHECK.model_copy(
            update={"signals": [signal] * 2, "problems": [axis_id], "doubts": [axis_id]}
        )

    return replace(setup, config=lambda: named, look=look)


@pytest.fixture
def named(stage: Stage, fm_alarm: Alarm) -> int:
    """Axes with these names wherever there is one, in findings and comments, too; the last of their alarms."""
    axes = []
    for name in NAMES.values():
        robot, _, own = name.rpartition(".")
        axes.append(replace(stage.snapshot.axes[0], id=name, robot=robot, name=own))
        number = stage.record(name, name, 0.06, fm_alarm)
        stage.journal.act(number, AlarmEvent.COMMENT, Note(stage.now_us, name, name))
    stage.snapshot = replace(stage.snapshot, axes=tuple(axes), messages=tuple(NAMES.values()))
    stage.setup = setup_of(axes)
    return number


@pytest.mark.parametrize("width", [3840, 1280, 360])
def test_names_are_text_and_all_fits_the_screen(width: int, named: int, page: Page) -> None:
    name = NAMES["long"]
    own = name.rpartition(".")[2]
    page.set_viewport_size({"width": width, "height": 800})
    page.goto("/")
    for address in (
        "/#/",
        "/#/alarms",
        f"/#/alarms/{named}",
        "/#/system",
        "/#/system/commissioning",
        f"/#/axes/{quote(name, safe='')}",
    ):
        page.goto(address)
        expect(page.locator("main")).to_contain_text(own)
        if address.startswith("/#/system"):
            unfold(page)
            table = "Signals now" if address.endswith("commissioning") else "Who has changed what"
            expect(page.get_by_role("table", name=table)).to_contain_text(own)
        assert page.evaluate("document.documentElement.scrollWidth") <= width, address
        expect(page.locator("main img")).to_have_count(0)
    expect(page.get_by_role("heading", level=1)).to_have_text(name)


def unfold(page: Page) -> None:
    """All that a page shows only on demand."""
    for place in (
        *page.locator("main summary").all(),
        *page.get_by_role("button", name="Check all axes").all(),
    ):
        place.click()


def test_the_gate_that_pauses_estimation_is_shown(page: Page, stage: Stage) -> None:
    kT, *others = (replace(p, not_tested=NotTested.CONDITIONS) for p in PARAMETERS)
    with_status(stage, parameters=(kT, *others))
    axis = stage.snapshot.axes[0]
    stage.snapshot = replace(stage.snapshot, axes=(replace(axis, gated_by="temperature is not known"),))
    page.goto("/")
    expect(parameter(page, "demo.axis1", "kT")).to_contain_text("not tested")
    expect(parameter(page, "demo.axis1", "fm")).to_contain_text("alarm")
    tile(page, "demo.axis1").click()
    banner = page.get_by_role("list", name="not tested: demo.axis1")
    expect(banner).to_contain_text("operating conditions exclude the samples (temperature is not known)")
    expect(banner).to_contain_text("estimation paused: temperature is not known")


def test_values_that_are_no_numbers_are_dashes(page: Page, stage: Stage) -> None:
    broken = replace(PARAMETERS[0], estimate=math.nan, standard_deviation=math.nan, g_up=math.inf)
    with_status(stage, parameters=(broken, replace(PARAMETERS[1], nominal=0.0, estimate=0.0)))
    page.goto("/")
    row = parameter(page, "demo.axis1", "kT")
    expect(row.locator(".value")).to_have_text("–")
    expect(row.locator(".share")).to_have_text("–")
    expect(parameter(page, "demo.axis1", "1/Ja").locator(".share")).to_contain_text("0.000")


def test_it_speaks_german_and_keeps_the_language(page: Page) -> None:
    page.goto("/")
    page.get_by_role("button", name="Deutsch").click()
    expect(page.locator("html")).to_have_attribute("lang", "de")
    expect(page.locator("#state")).to_have_text("nicht bereit")
    expect(parameter(page, "demo.axis1", "kT")).to_contain_text("0,993 ± 0,035")
    page.reload()
    expect(page.get_by_role("link", name="Übersicht")).to_be_visible()


def test_a_repaired_axis_learns_new_nominal_values_after_a_confirmation(page: Page, stage: Stage) -> None:
    """With answers of its own: the tests of the API have those of the daemon."""
    sent = list[object]()
    now = {"number": 1, "state": "current", "done_s": None, "length_s": None, "words": ""}
    first = {
        "number": 1, "state": "current", "source": "configuration", "began": "2026-03-01T11:50:00Z",
        "in_force": "2026-03-01T11:50:00Z", "ended": None, "who": "configuration", "comment": None, "work_order": None,
        "reason": None, "values": [{"name": "fm", "unit": "1", "value": 0.061, "former": 0.058, "kept": None}],
    }  # fmt: skip

    def axes(route: Route) -> None:
        body = route.fetch().json()
        route.fulfill(json={**body, "axes": [{**axis, "epoch": now} for axis in body["axes"]]})

    def baseline(route: Route) -> None:
        sent.append(route.request.post_data_json)
        now.update(state="learning", words="learning: nothing yet of 0.5 hours of operation")
        route.fulfill(json={**first, "number": 2, "state": "learning"})

    page.route("**/api/v1/events", lambda route: route.fulfill(status=503))
    page.route("**/api/v1/axes", axes)
    page.route("**/api/v1/axes/demo.axis1/epochs", lambda route: route.fulfill(json={"epochs": [first]}))
    page.route("**/api/v1/axes/demo.axis1/baseline", baseline)
    page.goto("/#/axes/demo.axis1")
    expect(page.get_by_role("table", name="Epochs")).to_contain_text("fm = 0.06100 (before: 0.05800)")
    page.get_by_role("button", name="Re-baseline").click()
    form = page.get_by_role("dialog", name="Re-baseline: demo.axis1")
    form.get_by_label("Learn for").fill("0.5")
    form.get_by_label("Comment").fill("gearbox changed")
    form.get_by_role("button", name="Re-baseline").click()
    expect(form).to_be_visible()  # not confirmed
    assert sent == []
    form.get_by_role("checkbox").check()
    form.get_by_role("button", name="Re-baseline").click()
    expect(form).to_have_count(0)
    wanted = {
        "mode": "window",
        "hours": 0.5,
        "verify_hours": 8,
        "comment": "gearbox changed",
        "work_order": "",
    }
    assert sent == [wanted]
    expect(page.get_by_role("list", name="not tested: demo.axis1")).to_contain_text("learning: nothing yet")
    page.goto("/")
    expect(tile(page, "demo.axis1")).to_contain_text("learning: nothing yet")


def test_the_system_page_shows_buses_drops_and_clocks(page: Page) -> None:
    page.goto("/#/system")
    buses = page.get_by_role("table", name="Buses")
    for words in ("down: Network is down", "242\u202f420", "queue_full 12"):
        expect(buses).to_contain_text(words)
    expect(page.get_by_role("table", name="Samples by axis")).to_contain_text("no_partner")
    expect(page.get_by_role("table", name="Clocks")).to_contain_text("fitted cycle")
    page.get_by_role("button", name="Record the last minutes").click()
    expect(page.get_by_role("alert")).to_contain_text("no frames are kept")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_serious_fault(
    scheme: Literal["light", "dark"], configured: Stage, page: Page, fm_alarm: Alarm
) -> None:
    number = configured.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.emulate_media(color_scheme=scheme)
    page.goto("/")
    page.evaluate((DASHBOARD / "node_modules" / "axe-core" / "axe.min.js").read_text(encoding="utf-8"))
    for address in (
        "#/",
        "#/axes/demo.axis1",
        "#/alarms",
        f"#/alarms/{number}",
        "#/system",
        "#/system/commissioning",
    ):
        page.evaluate("(address) => { location.hash = address; }", address)
        expect(page.locator("main")).to_contain_text("demo.axis1")
        for unfolded in (
            *page.locator("main summary").all(),
            *page.get_by_role("button", name="Check all axes").all(),
        ):
            unfolded.click()
        if address.endswith("commissioning"):
            expect(page.get_by_role("table", name="Signals now").get_by_role("row")).to_have_count(3)
        found = page.evaluate("axe.run({ resultTypes: ['violations'] })")["violations"]
        serious = [
            (v["id"], [node["html"][:120] for node in v["nodes"]])
            for v in found
            if v["impact"] in ("serious", "critical")
        ]
        assert serious == [], address


def test_the_documentation_needs_no_other_host(page: Page) -> None:
    page.goto("/docs")
    page.get_by_text("GET /api/v1/axes/{axis}/trend").click()
    expect(page.get_by_text("maximum number of entries; neighbours are merged")).to_be_visible()


def test_the_system_page_shows_files_configuration_and_who_has_changed_what(
    configured: Stage, page: Page, fm_alarm: Alarm
) -> None:
    number = configured.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    note = Note(configured.now_us, "anna", "<b>seen</b>", "WO-17")
    configured.journal.act(number, AlarmEvent.ACKNOWLEDGE, note)
    page.clock.install()
    page.goto("/#/system")
    expect(page.get_by_role("table", name="Files")).to_contain_text("alarms.sqlite")
    page.clock.run_for(11_000)
    expect(page.get_by_text("of one core of")).to_be_visible()  # between two answers
    unfold(page)
    text = page.get_by_label("Configuration", exact=True)
    expect(text).to_contain_text('nominal_file = "demo.axis1-nominal.toml"')
    trail = page.get_by_role("table", name="Who has changed what")
    for words in ("anna", "acknowledged", "demo.axis1", "Alarm 1 fm", "<b>seen</b>; work order WO-17"):
        expect(trail).to_contain_text(words)


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


def test_who_may_not_see_the_configuration_is_told_what_it_needs(
    configured: Stage, browser: Browser, tmp_path: Path
) -> None:
    tokens = TokenFile(tmp_path / "tokens.json")
    secret = tokens.new("wall", Scope.READ)
    configured.access = Access(tokens)
    daemon = Daemon(configured)
    try:
        page = browser.new_page(base_url=f"http://127.0.0.1:{daemon.port}")
        page.goto("/#/system")
        page.get_by_label("Token").fill(secret)
        page.get_by_role("button", name="Use").click()
        page.get_by_text("Configuration", exact=True).click()
        expect(page.get_by_text("this needs a token with the scope admin")).to_be_visible()
        page.close()
    finally:
        daemon.stop()
