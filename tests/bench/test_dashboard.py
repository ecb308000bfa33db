"""What the dashboard costs a browser with 300 axes at 10 Hz: processor, heap, tasks, first paint."""

import json
import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from playwright.sync_api import Page, sync_playwright

from monitor_core.monitoring import Status
from service.pipeline.snapshot import AxisSnapshot
from service.store.journal import Journal
from tests.bench.measure import Say
from tests.service.web.conftest import PARAMETERS, Stage, monitored_axis, serving

pytestmark = [pytest.mark.bench, pytest.mark.browser]

AXES, RATE_HZ, LIVE_S = 300, 10, 60.0
MOST_TASK_MS = 50
"""What a task of the page may take, so that it answers to keys at once (RAIL)."""
HELD_S = 120.0
"""As long as a page keeps the last values of the axes (LENGTH_S of live_buffer.ts); then its heap stays."""
PAGES = {"overview": "#/", "system": "#/system", "an axis": "#/axes/demo.axis7"}
_READY = {"overview": "a.tile", "system": "table", "an axis": "canvas"}


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    """Ten times a second every axis has other estimates and a newer sample."""
    journal = Journal(tmp_path / "alarms.sqlite")
    held, end = Stage(journal), threading.Event()
    axes = [monitored_axis(f"axis{number}") for number in range(AXES)]
    held.snapshot = replace(held.snapshot, axes=tuple(axes), buses=held.snapshot.buses[:1], messages=())

    def move() -> None:
        while not end.wait(1 / RATE_HZ):
            held.now_us += 1_000_000 // RATE_HZ
            held.snapshot = replace(
                held.snapshot,
                taken_us=held.now_us,
                axes=tuple(moved(axis, k, held.now_us) for k, axis in enumerate(axes)),
            )

    thread = threading.Thread(target=move)
    thread.start()
    yield held
    end.set()
    thread.join()
    journal.close()


def moved(axis: AxisSnapshot, number: int, now_us: int) -> AxisSnapshot:
    """Another estimate; the tests of most stay low, those of some wander, and their tiles with them."""
    share = 0.9 if number % 20 == 0 else 0.2
    parameters = tuple(
        replace(
            p,
            estimate=p.nominal * (1 + 0.1 * math.sin(now_us * 1e-6 + number)),
            g_up=share * abs(math.sin(now_us * 1e-7 + number)) * p.h,
            status=Status.TRACKING,
            not_tested=None,
        )
        for p in PARAMETERS
    )
    return replace(axis, status=replace(axis.status, time_us=now_us - 100_000, parameters=parameters))


def test_three_hundred_axes_in_a_browser(stage: Stage, say: Say, need: Callable[[str], str], tmp_path: Path) -> None:
    chromium = need("chromium")
    rows = []
    with serving(stage) as url, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for name, address in PAGES.items():
            page = browser.new_page(viewport={"width": 1920, "height": 1080})
            trace = tmp_path / "trace.json"
            browser.start_tracing(page=page, path=trace, categories=["toplevel", "__metadata"])
            page.goto(f"{url}/{address}")
            page.wait_for_selector(_READY[name], timeout=120_000)
            first_s = page.evaluate("performance.now()") / 1000
            paint_s = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime") / 1000
            page.wait_for_timeout(3000)
            first_mb = heap_mb(page)
            page.wait_for_timeout(1000 * LIVE_S + 500)
            browser.stop_tracing()
            last_mb = heap_mb(page)
            tasks = tasks_of(json.loads(trace.read_bytes())["traceEvents"])
            live = [task for task in tasks if task.at_s > tasks[-1].at_s - LIVE_S]
            rows.append(
                (
                    name,
                    100 * sum(task.cpu_ms for task in live) / (1000 * LIVE_S),
                    first_mb,
                    last_mb,
                    max(task.wall_ms for task in live),
                    max(task.cpu_ms for task in live),
                    sum(task.cpu_ms > MOST_TASK_MS for task in live),
                    max(task.cpu_ms for task in tasks),
                    paint_s,
                    first_s,
                )
            )
            if name == "overview":
                heaps = [("3 s", first_mb), (f"{LIVE_S + 3.5:g} s", last_mb), *heaps_when_full(page)]
            page.close()
        browser.close()
    header = (
        "", "% of a core", "heap MB", f"{LIVE_S:g} s later", "longest task ms", "its processor ms",
        f"above {MOST_TASK_MS} ms", "at the start ms", "first paint s", "first values s",
    )  # fmt: skip
    say(f"{AXES} axes at {RATE_HZ} Hz, {LIVE_S:g} s live, main thread of the page", header, rows)
    say(f"heap of the overview; it holds {HELD_S:g} s of each axis", ("after", "heap MB"), heaps)


def heaps_when_full(page: Page) -> Iterator[tuple[str, float]]:
    """What the page holds at several times, from when its buffers are full."""
    for _ in range(4):
        page.wait_for_timeout(1000 * HELD_S / 2)
        yield f"{page.evaluate('performance.now()') / 1000:.0f} s", heap_mb(page)


def heap_mb(page: Page) -> float:
    """What the page holds [MB], without what is garbage."""
    tools = page.context.new_cdp_session(page)
    tools.send("HeapProfiler.collectGarbage")
    used = float(tools.send("Runtime.getHeapUsage")["usedSize"])
    tools.detach()
    return used / 1e6


class Task(NamedTuple):
    """A task of the main thread: when it began, how long its thread had the processor, how long it lasted."""

    at_s: float
    cpu_ms: float
    wall_ms: float


def tasks_of(events: list[dict[str, Any]]) -> list[Task]:
    """The tasks of the busiest main thread, in the order of time."""
    mains = {
        (e["pid"], e["tid"]) for e in events if e["name"] == "thread_name" and e["args"]["name"] == "CrRendererMain"
    }
    tasks: dict[tuple[int, int], list[Task]] = {}
    for e in events:
        where = e["pid"], e["tid"]
        if where in mains and e["name"].endswith("RunTask") and "dur" in e:
            task = Task(e["ts"] / 1e6, e.get("tdur", 0) / 1000, e["dur"] / 1000)
            tasks.setdefault(where, []).append(task)
    return sorted(max(tasks.values(), key=lambda found: sum(task.cpu_ms for task in found)))
