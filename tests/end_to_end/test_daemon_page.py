"""The page of a daemon: while it is stopped; a repaired axis gets new nominal values there, and the old ones back."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from service.config import load
from tests.end_to_end.processes import PATIENCE_S, Daemon, daemon, demo_config
from tests.service.found_files import nominal_text
from tests.service.web.page_parts import tile

pytestmark = pytest.mark.browser
expect.set_options(timeout=PATIENCE_S * 1000)

AXIS = "demo.axis1"


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return demo_config(tmp_path_factory.mktemp("daemon"))


@pytest.fixture(scope="module")
def d(config: Path) -> Iterator[Daemon]:
    """One for both tests: what one changes the other does not look at."""
    with daemon(config) as found:
        yield found


@pytest.fixture
def page(d: Daemon, browser: Browser) -> Iterator[Page]:
    opened = browser.new_page(base_url=d.page)
    yield opened
    opened.close()


def test_a_stopped_daemon_is_stale_within_five_seconds_and_recovers(d: Daemon, page: Page) -> None:
    """Five seconds of the page's own clock, which is turned: a slow machine may take longer.

    SIGSTOP leaves the connections open, and nobody answers.
    """
    page.clock.install()
    page.goto("/")
    alert, tiles = page.get_by_role("alert"), page.locator("a.tile")
    expect(tiles).to_have_count(2)
    expect(page.locator("#state")).to_have_text("not ready")
    expect(alert).to_have_count(0)
    d.process.send_signal(signal.SIGSTOP)
    try:
        page.clock.pause_at(page.evaluate("Date.now()") / 1000 + 4.5)
        page.clock.run_for(500)
        expect(alert).to_contain_text("No data for")
        expect(page.locator("#state")).to_have_text("no answer")
        expect(page.locator("main")).to_have_css("filter", "grayscale(1)")
        expect(page).to_have_title("no answer – axiswatch")
        expect(tiles).to_have_count(2)  # the last values are kept, and look old
        page.clock.resume()
    finally:
        d.process.send_signal(signal.SIGCONT)
    expect(alert).to_have_count(0)
    expect(page.locator("#state")).to_have_text("not ready")
    expect(page.locator("main")).to_have_css("filter", "none")


def form_of(page: Page, button: str, comment: str) -> Locator:
    """The form that a button opens, filled and confirmed."""
    page.get_by_role("button", name=button, exact=True).first.click()
    form = page.get_by_role("dialog")
    form.get_by_label("Comment").fill(comment)
    for box in form.get_by_role("checkbox").all():
        box.check()
    return form


def send(form: Locator) -> None:
    form.locator("button[type=submit]").click()


def test_a_new_baseline_is_learned_given_by_files_and_taken_back(
    d: Daemon, page: Page, config: Path, tmp_path: Path
) -> None:
    good, wrong = tmp_path / "nominal.toml", tmp_path / "wrong.toml"
    axis = load(config, {}).axes[0].config
    good.write_text(nominal_text(axis, {"values": {"fm": 0.061}}), encoding="utf-8")
    wrong.write_text("format = 2\n", encoding="utf-8")
    page.goto(f"/#/axes/{AXIS}")
    rows = page.get_by_role("table", name="Epochs").get_by_role("row")
    expect(rows).to_have_count(2)
    form = form_of(page, "Re-baseline", "gearbox changed")
    form.get_by_label("Learn for").fill("0.5")
    form.get_by_role("checkbox").uncheck()
    send(form)
    expect(form).to_be_visible()  # not confirmed
    form.get_by_role("checkbox").check()
    send(form)
    expect(rows.nth(1)).to_contain_text("gearbox changed")
    page.goto("/")
    expect(tile(page, AXIS)).to_contain_text("learning: nothing yet of 30 min")
    page.goto(f"/#/axes/{AXIS}")
    send(form_of(page, "Cancel the learning", "another type of gearbox"))
    expect(rows.nth(1)).to_contain_text("cancelled")
    form = form_of(page, "Re-baseline", "commissioned again")
    form.get_by_label("Values from").select_option("files")
    form.get_by_label("nominal.toml").set_input_files(wrong)
    send(form)
    expect(form.get_by_role("alert")).to_contain_text("nominal.toml: format = 2")
    form.get_by_label("nominal.toml").set_input_files(good)
    send(form)
    expect(rows.nth(1)).to_contain_text("fm = 0.06100 N\u202fm\u202fs/rad (before: 0.06000")
    send(form_of(page, "Restore", "they were right"))
    expect(rows.nth(1)).to_contain_text("earlier epoch")
    found = d.get(f"api/v1/axes/{AXIS}/epochs")
    states = [(e["number"], e["state"], e["source"]) for e in found["epochs"]]
    assert states == [
        (4, "verifying", "restored"),
        (3, "rolled_back", "files"),
        (2, "cancelled", "window"),
        (1, "closed", "configuration"),
    ]
