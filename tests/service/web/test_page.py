"""The page in a real browser: what it shows, that it follows, and that it says when nobody answers."""

import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmEvent, AlarmRules, NotTested, Status
from service.config.drive_sources import shipped
from service.pipeline.alarm_recording import AlarmsSnapshot, as_recorded
from service.store.alarm_transitions import Note
from service.store.journal import Entry
from service.store.tokens import Scope, TokenFile
from service.web.access import Access
from service.web.report_pages import ReportPages
from service.web.server import serve
from tests.service.web.conftest import PARAMETERS, Stage, with_status

pytestmark = pytest.mark.browser


class Daemon:
    """The web server of a stage, in a thread of its own."""

    def __init__(self, stage: Stage) -> None:
        self._stop, self._ready = threading.Event(), threading.Event()
        self.port = 0
        arguments = (stage.app(), "127.0.0.1", 0, self._started, self._stop)
        self._thread = threading.Thread(target=serve, args=arguments)
        self._thread.start()
        assert self._ready.wait(30)

    def _started(self, port: int) -> None:
        self.port = port
        self._ready.set()

    def stop(self) -> None:
        self._stop.set()
        self._thread.join(30)


@pytest.fixture(scope="module")
def browser(need: Callable[[str], str]) -> Iterator[Browser]:
    chromium = need("chromium")
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture
def shipped_report(stage: Stage) -> Path:
    """The report of the demo, served with the page."""
    folder = shipped("demo/axiswatch.toml").parent
    stage.reports = ReportPages(folder, [axis.id for axis in stage.snapshot.axes])
    return folder


@pytest.fixture
def daemon(stage: Stage) -> Iterator[Daemon]:
    started = Daemon(stage)
    yield started
    started.stop()


@pytest.fixture
def page(browser: Browser, daemon: Daemon) -> Iterator[Page]:
    """A page that must not complain, nor ask any other host."""
    complaints: list[str] = []
    own = f"http://127.0.0.1:{daemon.port}"
    opened = browser.new_page(base_url=own)
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on("request", lambda r: None if r.url.startswith(own) else complaints.append(r.url))
    yield opened
    opened.close()
    assert complaints == []


def test_it_shows_axes_with_estimates_and_the_long_term_trend_where_it_is_known(page: Page) -> None:
    page.goto("/")
    card = page.get_by_role("article", name="demo.axis1")
    row = card.get_by_role("row", name="fm")
    for words in ("viscous friction of the motor", "0.06000", "0.0783 ± 0.0026", "+30.5 %", "alarm"):
        expect(row).to_contain_text(words)
    expect(row.get_by_role("meter", name="CUSUM up of fm")).to_have_attribute("aria-valuenow", "73")
    headers = card.get_by_role("columnheader").all_inner_texts()
    assert headers == ["Parameter", "Nominal", "Estimate", "Deviation", "CUSUM", "Status"]
    expect(page.get_by_role("article", name="demo.axis2")).to_contain_text("no sample yet")
    courses = page.get_by_role("list", name="Long-term trend of demo.axis1").get_by_role("listitem")
    expect(courses).to_have_count(1)
    drift = "fm drifts up by 0.0024 N m s/rad ± 0.00013 per day; fm reaches 0.09 N m s/rad in 12 to 20 days"
    expect(courses).to_contain_text(drift)
    expect(courses.get_by_role("img", name="fm over its long-term history")).to_be_visible()
    expect(page.get_by_role("list", name="Long-term trend of demo.axis2")).to_be_hidden()


def test_it_tells_why_it_is_not_ready(page: Page, stage: Stage) -> None:
    page.goto("/")
    expect(page.locator("#state")).to_have_text("not ready")
    expect(page.get_by_text("bus can1: down: Network is down")).to_be_visible()
    expect(page.get_by_text("its checkpoint is not used")).to_be_visible()
    stage.healthy()
    expect(page.locator("#state")).to_have_text("ready")
    for hidden in ("#reasons", "#insecure", "#sign-in"):
        expect(page.locator(hidden)).to_be_hidden()


def test_the_report_of_the_commissioning_opens_from_it(shipped_report: Path, page: Page) -> None:
    """With its styles, as the browser applies them, and from there the page of an axis."""
    page.goto("/")
    link = page.get_by_role("link", name="Commissioning report")
    expect(page.locator("#state")).to_have_text("not ready")
    expect(link).to_be_visible()
    link.click()
    expect(page.get_by_role("heading", name="Commissioned robot")).to_be_visible()
    expect(page.locator(".verdict")).to_have_css("border-left-style", "solid")
    page.get_by_role("link", name="demo.axis2-calibration.html").click()
    expect(page.get_by_role("heading", name="Calibration of demo.axis2")).to_be_visible()
    assert page.locator("svg").count() >= 3


def test_without_a_report_there_is_no_link(page: Page) -> None:
    page.goto("/")
    expect(page.locator("#state")).to_have_text("not ready")
    expect(page.get_by_text("Commissioning report")).to_be_hidden()


def test_it_shows_alarms_active_first(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    page.goto("/")
    expect(page.get_by_text("No alarm has been raised.")).to_be_visible()
    ended = replace(fm_alarm, raised_us=fm_alarm.raised_us + 1, ended_us=stage.now_us, direction="down")
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    stage.record("demo.axis2", "N m s/rad", 0.06, ended)
    rows = page.get_by_role("table", name="Alarms").get_by_role("row")
    expect(rows).to_have_count(3)
    sentence = "fm is 0.018 N m s/rad (31 %) above its nominal value"
    for words in ("active", "demo.axis1", "fm", "up", "+0.0183 ± 0.0021", "+30.5 %", sentence):
        expect(rows.nth(1)).to_contain_text(words)
    expect(rows.nth(2)).to_contain_text("ended")
    expect(page.locator("#news")).to_have_text(f"New alarm: demo.axis1: {sentence}")
    expect(page).to_have_title("(1) axiswatch")


def test_an_alarm_is_named_when_the_evidence_is_in(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    changed = replace(fm_alarm, parameter="kT", stage="changed", causes=(), kind="", past=())
    changed = replace(changed, onset_low_us=None, onset_high_us=None)
    page.goto("/")
    expect(page.get_by_text("No alarm has been raised.")).to_be_visible()
    stage.record("demo.axis1", "1", 1.0, changed)
    row = page.get_by_role("table", name="Alarms").get_by_role("row").nth(1)
    expect(row).to_contain_text("kT ▲ up not yet named")
    expect(row).to_contain_text("something has changed, at first sight kT")
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    expect(row).to_contain_text("fm ▲ up at first kT")
    expect(row.get_by_role("cell").nth(4)).to_contain_text("−0.6 s +0.2 s")
    expect(page.locator("#news")).to_have_text(
        "Alarm: demo.axis1: fm is 0.018 N m s/rad (31 %) above its nominal value"
    )
    expect(page.get_by_role("table", name="Alarms").get_by_role("row")).to_have_count(2)


def test_an_alarm_is_acknowledged_shelved_and_shown_again(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto("/")
    row = page.get_by_role("table", name="Alarms").get_by_role("row").nth(1)
    expect(row).to_contain_text("unacknowledged, medium priority")
    row.get_by_role("button", name="Acknowledge").click()
    form = page.get_by_role("dialog", name="Acknowledge: demo.axis1 fm up")
    expect(form.get_by_label("Hide for")).to_be_hidden()
    form.get_by_label("Comment").fill("<b>seen</b>")
    form.get_by_role("button", name="Acknowledge").click()
    expect(row).to_contain_text("acknowledged, medium priority")
    expect(row.get_by_role("button", name="Acknowledge")).to_have_count(0)
    row.get_by_role("button", name="Shelve").click()
    form = page.get_by_role("dialog", name="Shelve: demo.axis1 fm up")
    expect(form.get_by_label("Comment")).to_be_empty()
    form.get_by_label("Hide for").select_option("3 days")
    form.get_by_label("Work order").fill("WO-17")
    form.get_by_role("button", name="Shelve").click()
    expect(row).to_contain_text("shelved until")
    expect(row).to_contain_text("work order WO-17")
    row.get_by_role("button", name="Unshelve").click()
    form = page.get_by_role("dialog", name="Unshelve: demo.axis1 fm up")
    form.get_by_role("button", name="Cancel").click()
    expect(form).to_be_hidden()
    found = [(t.event, t.comment, t.work_order) for t in stage.journal.transitions(number)]
    assert found[1:] == [("acknowledge", "<b>seen</b>", ""), ("shelve", "", "WO-17")]
    alarm = stage.journal.get(number)
    assert alarm is not None
    assert alarm.shelved_until_us == stage.now_us + 3 * 86_400_000_000


def test_what_is_refused_is_said_in_the_form(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto("/")
    row = page.get_by_role("table", name="Alarms").get_by_role("row").nth(1)
    row.get_by_role("button", name="Acknowledge").click()
    stage.journal.act(number, AlarmEvent.ACKNOWLEDGE, Note(stage.now_us, "somebody else"))
    form = page.get_by_role("dialog")
    form.get_by_role("button", name="Acknowledge").click()
    expect(form.get_by_role("alert")).to_contain_text("not possible: acknowledge; the alarm is acknowledged")


def test_an_alarm_that_is_not_yet_recorded_is_shown_without_buttons(
    page: Page, stage: Stage, fm_alarm: Alarm
) -> None:
    waiting = as_recorded(Entry("demo.axis2", "1", 1.0, fm_alarm, AlarmRules("high")))
    stage.snapshot = replace(stage.snapshot, alarms=AlarmsSnapshot(unrecorded=(waiting,), waiting=1))
    page.goto("/")
    row = page.get_by_role("table", name="Alarms").get_by_role("row").nth(1)
    expect(row).to_contain_text("active not yet recorded")
    expect(row).to_contain_text("unacknowledged, high priority")
    expect(row.get_by_role("button")).to_have_count(0)
    expect(page.get_by_text("alarms that are not yet recorded: 1")).to_be_visible()


def test_it_follows_the_estimates(page: Page, stage: Stage) -> None:
    page.goto("/")
    row = page.get_by_role("article", name="demo.axis1").get_by_role("row", name="kT")
    expect(row).to_contain_text("0.993 ± 0.018")
    kT, *others = PARAMETERS
    kT = replace(kT, estimate=0.8, standard_deviation=0.01, status=Status.ALARM)
    with_status(stage, parameters=(kT, *others))
    expect(row).to_contain_text("0.800 ± 0.010")
    expect(row).to_contain_text("−20.0 %")
    expect(page.get_by_role("article")).to_have_count(1)


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
        expect(page.get_by_role("alert")).to_be_hidden()
        for given, words in ((secret[:-1], "not known, or was revoked"), (secret, "")):
            page.get_by_label("Token").fill(given)
            page.get_by_role("button", name="Use").click()
            if words:
                expect(page.locator("#sign-in")).to_contain_text(words)
        expect(page.get_by_role("article")).to_have_count(2)
        expect(page.locator("#sign-in")).to_have_count(0)
        expect(page.get_by_role("link", name="Metrics")).to_be_hidden()
        page.get_by_role("link", name="Commissioning report").click()
        page.get_by_role("link", name="demo.axis2-calibration.html").click()
        expect(page.get_by_role("heading", name="Calibration of demo.axis2")).to_be_visible()
        page.goto("/docs")
        expect(page.get_by_text("GET /api/v1/alarms", exact=False).first).to_be_visible()
        page.goto("/")
        expect(page.get_by_role("article")).to_have_count(2)
        tokens.revoke("anna")
        expect(page.locator("#sign-in")).to_contain_text("not known, or was revoked")
        other = browser.new_page(base_url=f"http://127.0.0.1:{daemon.port}")
        other.goto("/")
        expect(other.locator("#sign-in")).to_contain_text("this needs a token")
    finally:
        daemon.stop()


def test_it_says_that_it_is_not_protected(stage: Stage, browser: Browser) -> None:
    stage.access = Access(remote=True, insecure=True)
    daemon = Daemon(stage)
    try:
        page = browser.new_page(base_url=f"http://127.0.0.1:{daemon.port}")
        page.goto("/")
        expect(page.locator("#insecure")).to_contain_text("everyone whose machine reaches this address")
    finally:
        daemon.stop()


def test_it_says_since_when_nobody_answers(page: Page, daemon: Daemon) -> None:
    page.goto("/")
    expect(page.get_by_role("article")).to_have_count(2)
    expect(page.get_by_role("alert")).to_be_hidden()
    daemon.stop()
    expect(page.get_by_role("alert")).to_contain_text("No answer since")
    expect(page.locator("#state")).to_have_text("no answer")
    expect(page.get_by_role("article")).to_have_count(2)


def test_names_are_text_and_never_html(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    name = "<img src=x onerror=alert(1)>"
    axis = replace(stage.snapshot.axes[0], id=name)
    stage.snapshot = replace(stage.snapshot, axes=(axis,), messages=(name,))
    stage.record(name, name, 0.06, fm_alarm)
    page.goto("/")
    expect(page.get_by_role("article", name=name)).to_be_visible()
    expect(page.get_by_role("table", name="Alarms")).to_contain_text(name)
    expect(page.locator("main img")).to_have_count(0)


@pytest.mark.parametrize("width", [1280, 500, 360])
def test_it_fits_the_screen(width: int, page: Page, stage: Stage, fm_alarm: Alarm) -> None:
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.set_viewport_size({"width": width, "height": 800})
    page.goto("/")
    expect(page.get_by_role("row", name="active")).to_be_visible()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    outside = page.evaluate(
        "[...document.querySelectorAll('.card')].filter((card) => card.scrollWidth > card.clientWidth).length"
    )
    assert outside == 0


def test_the_gate_that_pauses_estimation_is_shown(page: Page, stage: Stage) -> None:
    kT, *others = (replace(p, not_tested=NotTested.CONDITIONS) for p in PARAMETERS)
    with_status(stage, parameters=(kT, *others))
    axis = stage.snapshot.axes[0]
    stage.snapshot = replace(stage.snapshot, axes=(replace(axis, gated_by="temperature is not known"),))
    page.goto("/")
    expect(page.get_by_role("article").first).to_contain_text("estimation paused: temperature is not known")
    expect(page.get_by_role("row", name="kT").get_by_role("cell").last).to_have_text("not tested")
    banner = page.get_by_role("list", name="Not tested on demo.axis1")
    expect(banner).to_contain_text("operating conditions exclude the samples (temperature is not known)")
    expect(page.get_by_role("row", name="fm").get_by_role("cell").last).to_have_text("alarm")


def test_values_that_are_no_numbers_are_dashes(page: Page, stage: Stage) -> None:
    broken = replace(PARAMETERS[0], estimate=math.nan, standard_deviation=math.nan, g_up=math.inf)
    with_status(stage, parameters=(broken, replace(PARAMETERS[1], nominal=0.0, estimate=0.0)))
    page.goto("/")
    cells = page.get_by_role("row", name="kT").get_by_role("cell")
    expect(cells.nth(1)).to_have_text("–")
    expect(cells.nth(2)).to_have_text("–")
    expect(page.get_by_role("row", name="1/Ja").get_by_role("cell").nth(2)).to_contain_text("0.000")


FORMATS = [
    ("number(0.06)", "0.06000"),
    ("number(95.717)", "95.72"),
    ("number(0)", "0.000"),
    ("number(-123456)", "−1.235·10⁵"),
    ("number(0.0000123)", "1.230·10⁻⁵"),
    ("number(null)", "–"),
    ("withDeviation(0.07832, 0.00256)", "0.0783 ± 0.0026"),
    ("withDeviation(-0.203, 0.018, true)", "−0.203 ± 0.018"),
    ("withDeviation(12345, 2000)", "12345 ± 2000"),
    ("withDeviation(5.9e-6, 3e-7, true)", "(+5.90 ± 0.30)·10⁻⁶"),
    ("withDeviation(0, 0.002)", "0.0000 ± 0.0020"),
    ("withDeviation(0.5, null, true)", "+0.5000"),
    ("percent(0.305)", "+30.5 %"),
    ("percent(-0.00001)", "0.0 %"),
    ("percent(-0.2)", "−20.0 %"),
    ("percent(1.57)", "+157 %"),
    ("count(1234567)", "1\u202f234\u202f567"),
    ("unit('kg m^2')", "kg\u202fm²"),
    ("unit('1')", ""),
    ("span(0.44)", "0.4 s"),
    ("span(75)", "75 s"),
    ("span(3600 * 5)", "5 h"),
]


def test_the_documentation_needs_no_other_host_and_numbers_are_as_people_read_them(page: Page) -> None:
    page.goto("/docs")
    expressions = ",".join(f"f.{expression}" for expression, _ in FORMATS)
    written = page.evaluate(f"import('/static/format.js').then((f) => [{expressions}])")
    assert written == [text for _, text in FORMATS]
    page.goto("/docs")
    page.get_by_text("GET /api/v1/axes/{axis}/history").click()
    expect(page.get_by_text("maximum number of points; the last ones are returned")).to_be_visible()
