"""Takes the pictures of the dashboard that the documents show: of the demo, some minutes after its fault."""

import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from playwright.sync_api import APIRequestContext, Browser, Error, sync_playwright

TARGET = Path(__file__).with_name("pictures")
CHROMIUM = "/usr/bin/chromium"
PORT = 8099
FAULT_AFTER_S = 60
PATIENCE_S = 900
"""At the first start all numeric code is compiled."""
COURSE_S = 60
"""After the alarm has its name: a course to be seen."""


@dataclass(frozen=True)
class Picture:
    """One picture: its page, the size of the window [px], colours and language."""

    name: str
    page: str
    width: int = 1280
    height: int = 800
    scheme: Literal["light", "dark"] = "light"
    language: str = "en"


def pictures_of(alarm: dict[str, Any]) -> tuple[Picture, ...]:
    """Every page, light, dark or on a phone, of the robot with this alarm."""
    axis = f"#/axes/{alarm['axis']}"
    return (
        Picture("overview", "", height=590),
        Picture("overview-dark", "", height=590, scheme="dark"),
        Picture("overview-phone", "", 360, 740, language="de"),
        Picture("axis", axis, height=840),
        Picture("axis-dark", axis, height=600, scheme="dark"),
        Picture("axis-phone", axis, 360, 740),
        Picture("alarms", "#/alarms", height=420),
        Picture("alarm", f"#/alarms/{alarm['id']}", height=640),
        Picture("alarm-dark", f"#/alarms/{alarm['id']}", height=640, scheme="dark", language="de"),
        Picture("system", "#/system"),
    )


def write_pictures() -> None:
    """Start the demo, wait for its alarm, write docs/pictures/*.png.

    Raises:
        TimeoutError: the alarm has not come.
    """
    command = [sys.executable, "-m", "service.commands.main", "demo", "--port", str(PORT)]
    demo = subprocess.Popen([*command, "--fault-after", str(FAULT_AFTER_S)])
    try:
        with sync_playwright() as playwright:
            base = f"http://127.0.0.1:{PORT}"
            asked = playwright.request.new_context(base_url=base)
            alarm = _named_alarm(asked)
            time.sleep(COURSE_S)
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-lcd-text"])
            for picture in pictures_of(alarm):
                _await_ready(asked)
                _take(browser, base, picture)
    finally:
        demo.terminate()
        demo.wait()


def _named_alarm(asked: APIRequestContext) -> dict[str, Any]:
    """The first alarm that has its name."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        time.sleep(2)
        try:
            alarms = asked.get("/api/v1/alarms?active=true").json()["alarms"]
        except Error:  # not started yet
            continue
        for alarm in alarms:
            if alarm["stage"] == "named" and alarm["recording"] is not None:
                return dict(alarm)
    raise TimeoutError(f"no alarm within {PATIENCE_S} s")


def _await_ready(asked: APIRequestContext) -> None:
    """Until all axes have samples: a busy machine may be late."""
    deadline = time.monotonic() + PATIENCE_S
    while not asked.get("/readyz").ok:
        if time.monotonic() > deadline:
            raise TimeoutError("the daemon is not ready")
        time.sleep(1)


def _take(browser: Browser, base: str, picture: Picture) -> None:
    page = browser.new_page(
        viewport={"width": picture.width, "height": picture.height},
        color_scheme=picture.scheme,
        locale=picture.language,
    )
    page.goto(f"{base}/{picture.page}")
    page.locator("main").get_by_text("demo.").first.wait_for()
    page.wait_for_timeout(3000)  # plots
    path = TARGET / f"{picture.name}.png"
    page.screenshot(path=path)
    page.close()
    print(f"pictures/{path.name}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    write_pictures()
