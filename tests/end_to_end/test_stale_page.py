"""The page of a daemon that is stopped and goes on: old values are never taken for the present ones."""

import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import expect, sync_playwright

from tests.end_to_end.processes import PATIENCE_S, daemon, demo_config

pytestmark = pytest.mark.browser
expect.set_options(timeout=PATIENCE_S * 1000)


def test_a_stopped_daemon_is_stale_within_five_seconds_and_recovers(
    tmp_path: Path, need: Callable[[str], str]
) -> None:
    """Five seconds of the page's own clock, which is turned: a slow machine may take longer.

    SIGSTOP leaves the connections open, and nobody answers.
    """
    chromium = need("chromium")
    with daemon(demo_config(tmp_path)) as d, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(base_url=d.page)
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
        browser.close()
