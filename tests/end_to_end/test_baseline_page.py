"""A repaired axis gets new nominal values on the page of a daemon: learned, from files, and back again."""

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect, sync_playwright

from service.config import load
from tests.end_to_end.processes import PATIENCE_S, daemon, demo_config
from tests.service.found_files import nominal_text
from tests.service.web.page_parts import tile

pytestmark = pytest.mark.browser
expect.set_options(timeout=PATIENCE_S * 1000)

AXIS = "demo.axis1"


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
    tmp_path: Path, need: Callable[[str], str]
) -> None:
    chromium = need("chromium")
    config = demo_config(tmp_path)
    good, wrong = tmp_path / "nominal.toml", tmp_path / "wrong.toml"
    axis = load(config, {}).axes[0].config
    good.write_text(nominal_text(axis, {"values": {"fm": 0.061}}), encoding="utf-8")
    wrong.write_text("format = 2\n", encoding="utf-8")
    with daemon(config) as d, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(base_url=d.page)
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
        browser.close()
