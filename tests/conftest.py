"""What every test may use: a seed, the measured records, programs from outside, compiled kernels kept."""

from __future__ import annotations

import asyncio
import gc
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import pytest
from hypothesis import settings

from service.pipeline.kernel_cache import choose

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# What an assertion of a helper module compares is shown, too.
pytest.register_assert_rewrite(
    "tests.bench",
    "tests.core",
    "tests.end_to_end",
    "tests.golden",
    "tests.real",
    "tests.service",
    "tests.soak",
)

ROOT = Path(__file__).resolve().parent.parent
CI = os.environ.get("CI") == "true"

# Before anything imports numpy or numba, which read these once.
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / ".cache" / "numba"))
choose(os.environ)

SEED = int(os.environ.get("AXISWATCH_SEED") or 2439)
"""Fixed, so that every run gives the same result; `make soak` sets AXISWATCH_SEED to a fresh number."""
os.environ["AXISWATCH_SEED"] = str(SEED)  # the same one in every process of this run
_REPEAT = f"axiswatch seed: {SEED} (AXISWATCH_SEED={SEED} repeats this run)"

# No assertion on time, as machines are shared; the same examples in every run, and other and more in `make soak`.
SOAK = "AXISWATCH_SOAK" in os.environ
settings.register_profile("axiswatch", deadline=None, derandomize=not SOAK, max_examples=100 if SOAK else 25)
settings.load_profile("axiswatch")

DEBIAN_PACKAGE = {
    "promtool": "prometheus",
    "prometheus": "prometheus",
    "amtool": "prometheus-alertmanager",
    "chromium": "chromium",
    "ip": "iproute2",
    "systemd-analyze": "systemd",
    "git": "git",
    "mosquitto": "mosquitto",
}


# What stays for the whole run, some million objects of libraries and tests, is no garbage to look for: without this a
# fifth of the time goes into it.
gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.set_threshold(10_000, 10, 10)
    gc.enable()


def pytest_report_header() -> str:
    return _REPEAT


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if hasattr(terminalreporter.config, "workerinput"):  # one of several processes: it has seen a part only
        return
    if terminalreporter.stats.get("failed") or terminalreporter.stats.get("error"):
        terminalreporter.write_line(_REPEAT)


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("vcan") and not Path("/sys/class/net/vcan0").exists():
        _unavailable("no SocketCAN device vcan0: run inside tools/with-vcan.sh")


def _unavailable(reason: str) -> None:
    """Skips the test on a developer's machine; in CI everything must really run."""
    if CI:
        pytest.fail(f"CI=true, but {reason}", pytrace=False)
    pytest.skip(reason)


@pytest.fixture(scope="session")
def seed() -> int:
    """The seed of this run, printed in the header."""
    return SEED


@pytest.fixture(scope="session")
def records_dir() -> Path:
    """The folder of measured records, beside the repository unless AXISWATCH_DATA says otherwise."""
    folder = Path(os.environ.get("AXISWATCH_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        _unavailable(f"the measured records are missing: no folder {folder} (set AXISWATCH_DATA)")
    return folder


@pytest.fixture(scope="session")
def need() -> Callable[[str], str]:
    """need("promtool") is the path of that program, or the end of the test where it is missing."""

    def path_of(tool: str) -> str:
        # Some packages are only unpacked, see tools/install-test-packages.sh; a user's PATH may lack sbin.
        places = [
            str(ROOT / ".cache" / "test-packages" / "bin"),
            os.environ.get("PATH", ""),
            "/usr/sbin",
            "/sbin",
        ]
        found = shutil.which(tool, path=os.pathsep.join(places))
        if found is None:
            _unavailable(f"{tool} is missing: install Debian package {DEBIAN_PACKAGE.get(tool, tool)}")
        assert found is not None
        return found

    return path_of


@pytest.fixture(scope="session")
def chromium(need: Callable[[str], str]) -> Iterator[tuple[Browser, asyncio.AbstractEventLoop]]:
    """One browser for all tests of a process, as it takes seconds to start, and the event loop that serves it."""
    from playwright.sync_api import sync_playwright

    path = need("chromium")
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        loop = asyncio.get_running_loop()
        yield opened, loop
        asyncio._set_running_loop(loop)
        opened.close()


@pytest.fixture(scope="module")
def browser(chromium: tuple[Browser, asyncio.AbstractEventLoop]) -> Iterator[Browser]:
    """The same, whose loop is marked as running in this thread for tests of pages alone: others run their own."""
    opened, loop = chromium
    asyncio._set_running_loop(loop)
    yield opened
    asyncio._set_running_loop(None)


@contextmanager
def no_pictures() -> Iterator[None]:
    """Reports without their pictures: to draw them takes seconds.

    Tests of reports (tests/service/commands/identify/test_reports.py, tests/service/reports) draw them.
    """
    from matplotlib.figure import Figure

    def savefig(_figure: Figure, out: TextIO, **_: Any) -> None:
        out.write("<svg></svg>")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", savefig)
        yield


@pytest.fixture(scope="module")
def without_pictures() -> Iterator[None]:
    """The reports of a module without their pictures: its tests look at numbers."""
    with no_pictures():
        yield
