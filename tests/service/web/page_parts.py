"""Parts of the page that several tests look at."""

from pathlib import Path

from playwright.sync_api import Locator, Page

from service.web.app import STATIC

ADDRESSES = ("#/", "#/axes/demo.axis1", "#/alarms", "#/alarms/1", "#/system", "#/system/commissioning")
"""Of all pages"""
AXE: Path = STATIC.with_name("dashboard") / "node_modules" / "axe-core" / "axe.min.js"
"""Finds what people who do not see the page, or have no mouse, cannot use"""


def tile(page: Page, axis: str) -> Locator:
    """That of an axis in the overview."""
    return page.locator("a.tile").filter(has_text=axis)


def parameter(page: Page, axis: str, name: str) -> Locator:
    """A row of a tile: name, estimate, deviation, bar, state."""
    return tile(page, axis).locator(".row").filter(has=page.locator(".parameter", has_text=name))


def alarm_row(page: Page, number: int = 1) -> Locator:
    """A row of the table of alarms; 0 is its head."""
    return page.get_by_role("table", name="Alarms").get_by_role("row").nth(number)


def serious_faults(page: Page) -> list[tuple[str, list[str]]]:
    """What axe finds on the page as it is: rules, and the elements that break them."""
    page.evaluate(AXE.read_text(encoding="utf-8"))
    found = page.evaluate("axe.run({ resultTypes: ['violations'] })")["violations"]
    return [
        (v["id"], [node["html"][:120] for node in v["nodes"]]) for v in found if v["impact"] in ("serious", "critical")
    ]


def unfold(page: Page) -> None:
    """All that a page shows only on demand."""
    for place in (
        *page.locator("main summary").all(),
        *page.get_by_role("button", name="Check all axes").all(),
    ):
        place.click()
