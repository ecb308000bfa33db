"""The dashboard in a real browser: what it shows, that it follows, and that it says when nobody answers."""

import math
import re
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

import pytest
from playwright.sync_api import Browser, Page, expect

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmEvent, NotTested, Status
from service.can.frames import Frame, FrameBlock
from service.pipeline.persistence.recording import Extracts
from service.pipeline.persistence.recording_folder import RecordingFolder
from service.pipeline.snapshot import AxisSnapshot
from service.store.alarm_transitions import Note
from service.store.tokens import Scope, TokenFile
from service.web.access import Access
from service.web.robot_setup import RobotSetup, SignalCheck
from tests.end_to_end.processes import PATIENCE_S
from tests.service.web.conftest import (
    NOON_US,
    PARAMETERS,
    SIGNAL_CHECK,
    Daemon,
    Stage,
    monitored_axis,
    quiet_page,
    robot_setup,
    waiting_axis,
    with_axis,
    with_status,
)
from tests.service.web.page_parts import ADDRESSES, parameter, serious_faults, tile, unfold
from tests.shares import soaked

pytestmark = pytest.mark.browser
expect.set_options(timeout=PATIENCE_S * 1000)


def test_the_overview_shows_axes_with_estimates_and_follows_them(page: Page, stage: Stage) -> None:
    page.goto("/")
    row = parameter(page, "demo.axis1", "fm")
    for words in ("fm", "0.0783 ± 0.0042", "+30.5 %", "alarm"):
        expect(row).to_contain_text(words)
    expect(tile(page, "demo.axis2")).to_contain_text("no sample yet")
    expect(parameter(page, "demo.axis2", "fm")).to_contain_text("–")
    expect(page.locator("#state")).to_have_text("not ready")
    expect(page.get_by_text("Commissioning report")).to_have_count(0)
    expect(page.get_by_text("bus can1: down: Network is down")).to_be_visible()
    expect(page.get_by_text("its checkpoint is not used")).to_be_visible()
    row = parameter(page, "demo.axis1", "kT")
    expect(row).to_contain_text("0.993 ± 0.029")
    page.get_by_role("button", name="Deutsch").click()
    expect(page.locator("html")).to_have_attribute("lang", "de")
    expect(page.locator("#state")).to_have_text("nicht bereit")
    expect(row).to_contain_text("0,993 ± 0,029")
    expect(page.locator("#reasons")).to_contain_text("demo.axis2: noch kein Messwert")
    page.reload()
    expect(page.get_by_role("link", name="Übersicht")).to_be_visible()
    stage.healthy()
    expect(page.locator("#state")).to_have_text("bereit")
    for hidden in ("#reasons", "#insecure", "#sign-in"):
        expect(page.locator(hidden)).to_have_count(0)
    kT, *others = PARAMETERS
    kT = replace(kT, estimate=0.8, standard_deviation=0.01, status=Status.ALARM)
    with_status(stage, parameters=(kT, *others))
    expect(row).to_contain_text("0,800 ± 0,016")
    expect(row).to_contain_text("−20,0 %")


def test_the_axes_are_searched_filtered_and_reached_by_keys(page: Page, stage: Stage, fm_alarm: Alarm) -> None:
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
    page.keyboard.press("Enter")  # there is nothing to go to
    expect(page.get_by_label("Search axis or parameter")).to_be_focused()
    for key in ("Enter", "ArrowDown"):
        page.get_by_label("Search axis or parameter").fill("")
        page.keyboard.press(key)
        expect(tile(page, "demo.axis1")).to_be_focused()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", name="demo.axis2")).to_be_visible()


@pytest.mark.parametrize(("width", "height"), [(1920, 1080), (3840, 2160)])
def test_three_hundred_axes_are_on_one_screen(
    width: int, height: int, page: Page, stage: Stage, fm_alarm: Alarm
) -> None:
    """Below three alarms and two axes without data."""
    axes = [
        *(monitored_axis(f"axis{k}") for k in range(298)),
        *(waiting_axis(f"axis{k}") for k in (298, 299)),
    ]
    stage.snapshot = replace(stage.snapshot, axes=tuple(axes), buses=stage.snapshot.buses[:1], messages=())
    stage.links = ()
    for k in range(5):
        stage.record(f"demo.axis{k}", "N m s/rad", 0.06, replace(fm_alarm, raised_us=fm_alarm.raised_us + k))
    page.set_viewport_size({"width": width, "height": height})
    page.goto("/")
    expect(page.locator("a.tile")).to_have_count(300)
    label = re.compile(
        r"demo.axis7: .*kT 0\.993 ± 0\.029, −0\.7\s%, tracking; 1/Ja .*not tested; fm .*, \+30\.5\s%, alarm"
    )
    expect(page.get_by_title("demo.axis7", exact=True)).to_have_attribute("aria-label", label)
    expect(page.get_by_text("2 more")).to_be_visible()
    expect(page.locator("a.tile .bar")).to_have_count(900)  # tiles are drawn in turns
    bottoms = "[...document.querySelectorAll('a.tile')].map((t) => t.getBoundingClientRect().bottom)"
    assert max(page.evaluate(bottoms)) <= height
    right = "getBoundingClientRect().right"
    cut = f"[...document.querySelectorAll('a.tile')].filter((t) => t.querySelector('.name bdi').{right} > t.{right})"
    assert page.evaluate(f"{cut}.map((t) => t.title)") == []
    expect(page.get_by_title("demo.axis123", exact=True)).to_contain_text("123")


def test_it_asks_for_a_token_where_the_daemon_wants_one(
    configured: Stage, tmp_path: Path, browser: Browser, fm_alarm: Alarm
) -> None:
    """A wrong one is refused; the right one is kept by the tab alone; reports and recordings open by their links."""
    stage, tokens = configured, TokenFile(tmp_path / "tokens.json")
    secret = tokens.new("anna", Scope.READ)
    stage.access = Access(tokens, remote=True, insecure=True)
    folder = RecordingFolder(tmp_path / "recordings", 10**9)
    stage.extracts = Extracts(folder, 8.0, 2.0, lambda: stage.now_us)
    stage.extracts.add("can0", FrameBlock.from_frames([Frame(fm_alarm.raised_us, 0x101, False, bytes(8))]))
    written = stage.extracts.request()
    stage.extracts.tick()
    name = written.result(PATIENCE_S).name
    daemon = Daemon(stage)
    try:
        with quiet_page(browser, daemon.port) as page:
            signs_in(page, secret)
            expect(page.locator("#insecure")).to_contain_text("insecure: what is sent, tokens too")
            reads_the_reports(page)
            # It is made when it is first asked for; the page of a busy machine would not wait for it.
            made = page.request.get("/openapi.json", headers={"Authorization": f"Bearer {secret}"})
            assert made.ok
            reads_the_documentation(page)
            page.goto("/#/system")
            with page.expect_download() as saved:
                page.get_by_role("link", name=name).click()
            assert saved.value.path().read_bytes() == (tmp_path / "recordings" / name).read_bytes()
            page.get_by_text("Configuration", exact=True).click()
            expect(page.get_by_text("this needs a token with the scope admin")).to_be_visible()
            tokens.revoke("anna")
            expect(page.locator("#sign-in")).to_contain_text("not known, or was revoked")
        with quiet_page(browser, daemon.port) as other:
            other.goto("/")
            expect(other.locator("#sign-in")).to_contain_text("this needs a token")
    finally:
        daemon.stop()
        stage.extracts.close()


def signs_in(page: Page, secret: str) -> None:
    """First with a wrong token; the pages that need none have asked for one."""
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


def reads_the_reports(page: Page) -> None:
    """That of the commissioning with its styles, as the browser applies them, and from there that of an axis."""
    page.get_by_role("link", name="Commissioning report").click()
    expect(page.get_by_role("heading", name="Commissioned robot")).to_be_visible()
    expect(page.locator(".banner").first).to_have_css("border-left-style", "solid")
    section = page.locator("section").filter(has=page.get_by_role("heading", name="demo.axis2"))
    section.get_by_role("link", name="calibration").click()
    expect(page.get_by_role("heading", name="Calibration of demo.axis2")).to_be_visible()
    assert page.locator("svg").count() >= 3


def reads_the_documentation(page: Page) -> None:
    page.goto("/docs")
    page.get_by_text("GET /api/v1/axes/{axis}/trend").click()
    expect(page.get_by_text("maximum number of entries; neighbours are merged")).to_be_visible()


def test_it_says_for_how_long_nobody_has_answered_and_comes_back(page: Page, daemon: Daemon, stage: Stage) -> None:
    """Its clock is turned; tests/end_to_end/test_daemon_page.py has a daemon that keeps its connections."""
    page.clock.install()
    page.goto("/")
    expect(page.locator("a.tile")).to_have_count(2)
    expect(page.get_by_role("alert")).to_have_count(0)
    daemon.stop()
    page.clock.run_for(5000)
    expect(page.get_by_role("alert")).to_contain_text("No data for")
    expect(page.locator("#state")).to_have_text("no answer")
    expect(page.locator("main")).to_have_css("filter", "grayscale(1)")
    expect(page.locator("a.tile")).to_have_count(2)
    again = Daemon(stage, daemon.port)
    try:
        page.clock.run_for(5000)
        expect(page.get_by_role("alert")).to_have_count(0)
        expect(page.locator("#state")).to_have_text("not ready")
    finally:
        page.goto("about:blank")
        again.stop()


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
        return SIGNAL_CHECK.model_copy(update={"signals": [signal] * 2, "problems": [axis_id], "doubts": [axis_id]})

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


MESSAGES_AT_FIRST_CONTENT = """
    new MutationObserver((_, observer) => {
        if (document.querySelector("main h1") === null) return;
        window.messagesAtFirst = document.getElementById("messages") !== null;
        observer.disconnect();
    }).observe(document, { childList: true, subtree: true });
"""


def test_messages_do_not_move_what_is_about_to_be_clicked(page: Page, stage: Stage) -> None:
    """They stand above the content, so it is not shown before them."""
    page.clock.set_fixed_time(stage.now_us / 1e6)  # time without an answer would show the content
    page.add_init_script(MESSAGES_AT_FIRST_CONTENT)
    page.goto("/#/alarms")
    expect(page.get_by_role("heading", name="Alarms")).to_be_visible()
    assert page.evaluate("messagesAtFirst") is True


def test_of_a_robot_with_a_long_name_each_tile_names_its_axis(page: Page, stage: Stage) -> None:
    robot = "Welding-cell-South_Handling-04_Station-7"
    axes = [replace(stage.snapshot.axes[0], id=f"{robot}.J{k}", robot=robot, name=f"J{k}") for k in range(1, 4)]
    stage.snapshot = replace(stage.snapshot, axes=tuple(axes))
    page.goto("/")
    names = page.locator("a.tile.untested .name bdi:last-child")
    expect(names).to_have_text([".J1", ".J2", ".J3"])
    for name in names.all():
        inside = "n => n.getBoundingClientRect().right <= n.closest('.head').getBoundingClientRect().right"
        assert name.evaluate(f"n => n.scrollWidth <= n.clientWidth && ({inside})(n)")
    page.set_viewport_size({"width": 560, "height": 800})  # narrow tiles: the numbers give way to the names
    for name in page.locator(".row .parameter").all():
        assert name.evaluate("n => n.scrollWidth <= n.clientWidth")


@pytest.mark.parametrize("width", soaked([3840, 1280, 360], 360))
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


def test_values_that_are_no_numbers_and_the_gate_that_pauses_estimation(page: Page, stage: Stage) -> None:
    broken = replace(PARAMETERS[0], estimate=math.nan, standard_deviation=math.nan, g_up=math.inf)
    with_status(stage, parameters=(broken, replace(PARAMETERS[1], nominal=0.0, estimate=0.0)))
    page.goto("/")
    row = parameter(page, "demo.axis1", "kT")
    expect(row.locator(".value")).to_have_text("–")
    expect(row.locator(".share")).to_have_text("–")
    row = parameter(page, "demo.axis1", "1/Ja")
    expect(row.locator(".value")).to_contain_text(" 1/(kg m²)")  # which is the unit of the deviation, too
    expect(row.locator(".share")).to_have_text("0")
    kT, *others = (replace(p, not_tested=NotTested.CONDITIONS) for p in PARAMETERS)
    with_status(stage, parameters=(kT, *others))
    with_axis(stage, gated_by="temperature is not known")
    expect(parameter(page, "demo.axis1", "kT")).to_contain_text("not tested")
    expect(parameter(page, "demo.axis1", "fm")).to_contain_text("alarm")
    tile(page, "demo.axis1").click()
    banner = page.get_by_role("list", name="not tested: demo.axis1")
    expect(banner).to_contain_text("operating conditions exclude the samples (temperature is not known)")
    expect(banner).to_contain_text("estimation paused: temperature is not known")


def test_an_axis_whose_samples_stop_is_no_longer_normal(page: Page, stage: Stage) -> None:
    """The page follows the events, which have only axes that change."""
    with_status(stage, parameters=[replace(p, status=Status.TRACKING, not_tested=None) for p in PARAMETERS])
    page.goto("/")
    expect(tile(page, "demo.axis1").locator(".head")).to_contain_text("normal")
    stopped = [replace(p, status=Status.SILENT, not_tested=NotTested.NO_SAMPLE) for p in PARAMETERS]
    with_status(stage, parameters=stopped)
    with_axis(stage, silent_since_us=NOON_US - 60_000_000)
    expect(tile(page, "demo.axis1").locator(".head")).to_contain_text("no data")
    expect(parameter(page, "demo.axis1", "kT")).to_contain_text("not tested")
    tile(page, "demo.axis1").click()
    panel = page.get_by_role("region", name="kT")
    expect(panel).to_contain_text("not tested")
    expect(panel).not_to_contain_text("as at commissioning")


def test_axe_finds_no_serious_fault(configured: Stage, page: Page, fm_alarm: Alarm) -> None:
    configured.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto("/")
    for address in ADDRESSES:
        page.evaluate("(address) => { location.hash = address; }", address)
        expect(page.locator("main")).to_contain_text("demo.axis1")
        unfold(page)
        if address.endswith("commissioning"):
            expect(page.get_by_role("table", name="Signals now").get_by_role("row")).to_have_count(3)
        page.emulate_media(color_scheme="light")
        assert serious_faults(page) == [], address
        page.emulate_media(color_scheme="dark")
        assert serious_faults(page) == [], address


def test_the_deviation_on_a_tile_is_not_cut(page: Page, stage: Stage) -> None:
    fm = PARAMETERS[2]
    with_status(stage, parameters=(*PARAMETERS[:2], replace(fm, estimate=1.308 * fm.nominal)))
    page.goto("/")
    shares = parameter(page, "demo.axis1", "fm").locator(".share")
    expect(shares).to_have_text("+30.8 %")
    assert shares.evaluate("e => e.scrollWidth <= e.clientWidth")
