"""The page in German: what the daemon says is German there too, by its kind and values."""

from dataclasses import replace

import pytest
from playwright.sync_api import Page, expect

from monitor_core.detection import TORQUE_SIGN, Alarm, Cause
from monitor_core.monitoring import AlarmEvent
from monitor_core.wording import sentence
from service.can.bus_reader import BusSnapshot
from service.links.delivery import answers
from service.pipeline.snapshot import Snapshot
from service.store.alarm_transitions import Note
from service.web.models import sentence_bodies
from tests.end_to_end.processes import PATIENCE_S
from tests.service.web.conftest import SIGNAL_CHECK, Stage, robot_setup
from tests.service.web.page_parts import unfold

pytestmark = pytest.mark.browser
expect.set_options(timeout=PATIENCE_S * 1000)


def troubled(snapshot: Snapshot) -> Snapshot:
    """A bus that is down, a message, an axis whose parameters cannot be told apart and whose estimation pauses."""
    first, *others = snapshot.axes
    alike = sentence("alike", "{first} and {last} cannot be distinguished", first="fm", last="kT")
    gate = sentence("not known", "{name} is not known", name="temperature")
    outside = sentence(
        "not calibrated",
        "{name} = {value}, calibrated from {low} to {high}",
        name="load",
        value="41.5",
        low="20",
        high="35",
    )
    status = replace(first.status, confounded=(alike,))
    first = replace(first, status=status, gated_by=gate, outside_calibration=(outside,))
    down = sentence("down", "down: {why}", why=sentence("no CAN", "this kernel has no CAN (modprobe can-raw)"))
    buses = snapshot.buses[0], BusSnapshot("can1", down, 0, {"queue_full": 7}, "python-can")
    message = sentence("not saved", "the state of the monitors cannot be saved: {why}", why="disk full")
    return replace(snapshot, axes=(first, *others), buses=buses, messages=(message,))


def test_nothing_that_the_daemon_says_is_english_there(configured: Stage, page: Page, fm_alarm: Alarm) -> None:
    configured.snapshot = troubled(configured.snapshot)
    problem = answers("orders.example", "503 Service Unavailable")
    configured.links = (replace(configured.links[0], problem=problem),)
    sign = replace(fm_alarm, parameter=TORQUE_SIGN, causes=(Cause(TORQUE_SIGN, 0.97),))
    configured.record("demo.axis1", "1", 1.0, sign)
    page.goto("/")
    page.get_by_role("button", name="Deutsch").click()
    messages = page.locator("#messages")
    expect(messages).to_contain_text("Der Zustand der Überwachung kann nicht gespeichert werden: disk full")
    expect(messages).to_contain_text("Verbindung orders: orders.example antwortet 503 Service Unavailable")
    expect(page.locator("#reasons")).to_contain_text("Bus can1: gestört: dieser Kernel hat kein CAN")
    shown = {
        "#/": "Vorzeichen des Moments",
        "#/axes/demo.axis1": "fm und kT sind nicht zu unterscheiden",
        "#/alarms": "Vorzeichen des Moments",
        "#/alarms/1": "Die Achse auf diese Ursache prüfen: Vorzeichen des Moments.",
        "#/system": "gestört: dieser Kernel hat kein CAN (modprobe can-raw)",
    }
    for address, words in shown.items():
        page.evaluate("(address) => { location.hash = address; }", address)
        expect(page.locator("main")).to_contain_text(words)
        unfold(page)
        assert page.locator("main [lang=en], header bdi[lang=en]").all_inner_texts() == [], address
    expect(page.get_by_role("table", name="Busse")).to_contain_text("Warteschlange voll 7")
    expect(page.get_by_role("table", name="Anlagenverbindungen")).to_contain_text("orders.example antwortet 503")
    page.evaluate("() => { location.hash = '#/axes/demo.axis1'; }")
    banner = page.get_by_role("list", name="nicht geprüft: demo.axis1")
    expect(banner).to_contain_text("Schätzung pausiert: temperature ist nicht bekannt")
    expect(banner).to_contain_text("außerhalb der Kalibrierung: load = 41,5, kalibriert von 20 bis 35")


@pytest.fixture
def standing(configured: Stage) -> Stage:
    """A live check finds that the axes do not move."""
    stands = sentence("axis stands", "it does not move: {still}", still=sentence("move it", "let it move"))
    unit = sentence("in unit", "the {quantity} is {unit}", quantity="angle", unit="in degrees")
    reason = sentence("then times", "then {times}: {what}", shows="7.5", what=unit, times="1.25")
    change = sentence("proposal", "{reason} {change}", reason=reason, change="angle.factor = 0.0174533")
    counted = sentence("torque counted", "the torque is in whole numbers")
    found = [stands, change, counted]
    check = {
        "problems": [stands], "proposals": [change], "doubts": [counted], "sentences": sentence_bodies(found),
    }  # fmt: skip
    configured.setup = robot_setup(lambda _: SIGNAL_CHECK.model_copy(update=check))
    return configured


@pytest.mark.usefixtures("standing")
def test_what_a_live_check_of_signals_finds_is_german(page: Page) -> None:
    page.goto("/#/system/commissioning")
    page.get_by_role("button", name="Deutsch").click()
    page.get_by_role("button", name="Alle Achsen prüfen").click()
    found = page.get_by_role("table", name="Signale jetzt")
    expect(found.get_by_role("row")).to_have_count(3)
    expect(found).to_contain_text("Problem Sie bewegt sich nicht: den Roboter arbeiten lassen, oder")
    words = "7,5: der Winkel ist in Grad; dann ist es das 1,25-fache → angle.factor = 0.0174533"
    expect(found).to_contain_text(f"Änderung {words}")
    expect(found).to_contain_text("offen Das Moment ist ganzzahlig, wie in Promille")
    assert found.locator("[lang=en]").count() == 0


def test_what_is_refused_is_said_in_german(stage: Stage, page: Page, fm_alarm: Alarm) -> None:
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    page.goto(f"/#/alarms/{number}")
    page.get_by_role("button", name="Deutsch").click()
    page.get_by_role("button", name="Quittieren").click()
    stage.journal.act(number, AlarmEvent.ACKNOWLEDGE, Note(stage.now_us, "somebody else"))
    form = page.get_by_role("dialog")
    form.get_by_role("button", name="Quittieren").click()
    expect(form.get_by_role("alert")).to_have_text("Nicht möglich („quittiert“): der Alarm ist jetzt „quittiert“")
    form.get_by_role("button", name="Abbrechen").click()
    page.evaluate("() => { location.hash = '#/system'; }")
    page.get_by_role("button", name="Die letzten Minuten aufzeichnen").click()
    expect(page.get_by_role("alert")).to_contain_text("es werden keine Rohdaten aufbewahrt")


def test_a_value_that_the_daemon_refuses_is_explained_in_german(page: Page) -> None:
    page.goto("/#/axes/demo.axis1")
    page.get_by_role("button", name="Deutsch").click()
    page.get_by_role("button", name="Neu einlernen").click()
    form = page.get_by_role("dialog")
    form.get_by_label("Einlernen für").fill("99999")
    form.get_by_label("Kommentar").fill("Getriebe")
    form.get_by_label("Die Achse wurde repariert").check()
    form.get_by_role("button", name="Neu einlernen").click()
    expect(form.get_by_role("alert")).to_have_text("hours: muss ≤ 8784 sein")
