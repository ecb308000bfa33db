"""A daemon that stands still: a snapshot of two axes, a journal, a clock that only moves when told."""

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, cast

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from monitor_core.detection import Alarm, Cause, FormerName, Reach
from monitor_core.monitoring import (
    AxisStatus,
    NotTested,
    Observation,
    ParameterStatus,
    ParameterTrend,
    Status,
)
from monitor_core.monitoring.axis_status import DetectorStatus
from monitor_core.trend.entries import HistoryEntry
from monitor_core.trend.trend import trend_of
from service.can.bus_reader import BusSnapshot
from service.config import Config, load
from service.config.certificates import Expiry
from service.config.drive_sources import shipped
from service.ingest.samples.timestamp_jitter import NOT_KNOWN, Stamps
from service.pipeline.axes.axis_pipeline import Heat
from service.pipeline.axes.live_signals import LiveSignals
from service.pipeline.persistence.history_recording import HistoryRecording
from service.pipeline.persistence.recording import Extracts
from service.pipeline.persistence.replay_reports import ReplayReports
from service.pipeline.snapshot import AxisSnapshot, Histogram, LinkSnapshot, Snapshot
from service.store.alarm_entries import AlarmEntry as JournalEntry
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import Note
from service.store.history_store import RESOLUTIONS, Bounds, HistoryPoint, HistorySeries, HistoryStore
from service.store.journal import Journal
from service.web.access import Access
from service.web.app import create_app
from service.web.app_state import AppState, CachedAnswer
from service.web.report_pages import ReportPages
from service.web.robot_setup import RobotSetup, SignalCheck, SignalRange
from service.web.server import Certificate, serve
from tests.end_to_end.processes import PATIENCE_S
from tests.ports import own_port
from tests.service.pipeline.robots import with_axes

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

NOON_US = 1_772_366_400_000_000
"""2026-03-01T12:00:00Z"""

FM_ALARM = Alarm(
    "fm", "up", NOON_US - 9_000_000, NOON_US - 7_000_000, NOON_US - 500_000, None, 0.01832, 0.0021, crossings=4,
    stage="named", kind="step", causes=(Cause("fm", 0.97), Cause("kT", 0.03)),
    onset_low_us=NOON_US - 9_600_000, onset_high_us=NOON_US - 8_800_000,
    past=(FormerName(NOON_US - 4_000_000, "changed", "kT", "up"),),
)  # fmt: skip

PARAMETERS = (
    ParameterStatus(
        name="kT", unit="1", meaning="torque constant, relative to the one the controller uses",
        nominal=1.0, estimate=0.99317, standard_deviation=0.0179, p_diagonal=6.4e-4,
        g_up=0.0, g_down=3.25, h=20.0, nu=0.0759, status=Status.TRACKING, observation=Observation.OBSERVED,
        tested_s=594.0,
    ),
    ParameterStatus(
        name="1/Ja", unit="1/(kg m^2)", meaning="reciprocal of: inertia of the arm",
        nominal=0.0104474, estimate=0.0105012, standard_deviation=6.9e-5, p_diagonal=9.6e-9,
        g_up=0.0, g_down=0.0, h=0.208948, nu=0.000294, status=Status.UNSEEN, observation=Observation.UNSEEN,
        not_tested=NotTested.NOT_OBSERVED, tested_s=421.5,
    ),
    ParameterStatus(
        name="fm", unit="N m s/rad", meaning="viscous friction of the motor",
        nominal=0.06, estimate=0.07832, standard_deviation=0.00256, p_diagonal=1.31e-5,
        g_up=0.87, g_down=0.0, h=1.2, nu=0.01087, status=Status.ALARM, observation=Observation.WEAK,
        tested_s=594.0,
    ),
)  # fmt: skip

HOUR_US = 3_600_000_000
STARTS_US = range(NOON_US - 200 * HOUR_US, NOON_US, HOUR_US)
MEANS = [0.06 + 1e-4 * k + 3e-4 * math.sin(k) for k in range(200)]
ENTRIES = tuple(
    HistoryEntry(at_us, at_us + HOUR_US, at_us + HOUR_US // 2, mean, 4e-8, 3600.0)
    for at_us, mean in zip(STARTS_US, MEANS, strict=True)
)
"""Two hundred hours in which fm grows by a third."""


@cache
def slow_courses() -> tuple[ParameterTrend, ...]:
    """That of fm is known, with numbers that are the same on every processor; of the others there is too little."""
    found = trend_of(ENTRIES, 0.06, 3600.0)
    assert found is not None
    probability = {"steady": 0.0, "drift": 0.97, "step": 0.0, "both": 0.03}
    drift = found._replace(
        probability=probability, level=0.08, level_sd=2e-4, slope=2.75e-8, slope_sd=1.5e-9, scatter=3e-4
    )
    ends_us = NOON_US + 12 * 86_400_000_000, NOON_US + 20 * 86_400_000_000
    reached = Reach("fm", "N m s/rad", 0.09, True, "ahead", *ends_us)
    unknown = [ParameterTrend(p.name, p.unit, p.nominal, 3600.0) for p in PARAMETERS[:2]]
    return (*unknown, ParameterTrend("fm", "N m s/rad", 0.06, 3600.0, ENTRIES, drift, (reached,)))


COUNTERS = {
    "used": 118_804, "seeding": 2000, "settling": 400, "starved": 5120, "gated": 1200,
    "not_finite": 3, "not_increasing": 1, "gap": 2, "diverged": 0, "projected": 7,
}  # fmt: skip

DETECTORS = (
    DetectorStatus("cusum", True, "fm", 0.725),
    DetectorStatus("multimodel", False, "torque sign", 1.5),
)

NOMINAL = {"Jm": (5.896e-3, "kg m^2"), "Ja": (95.717, "kg m^2"), "fm": (0.06, "N m s/rad"), "kT": (1.0, "1")}


INTERVAL_S = 10


@contextmanager
def stored_history(folder: Path) -> Iterator[HistoryRecording]:
    """A hundred points of all parameters of the first axis until noon; five minutes lack before the last ten."""
    bounds = Bounds(dict.fromkeys(RESOLUTIONS, 1e12), 1e9)
    recording = HistoryRecording(lambda: HistoryStore(folder / "history.sqlite", bounds), INTERVAL_S)
    recording.write()
    assert recording.store is not None
    series = [HistorySeries("demo.axis1", p.name, p.unit) for p in PARAMETERS]
    recording.store.add([HistoryPoint(s, t, point_values(k)) for k, t in enumerate(HISTORY_TIMES) for s in series])
    yield recording
    recording.stop()


@pytest.fixture
def history(tmp_path: Path) -> Iterator[HistoryRecording]:
    with stored_history(tmp_path) as recording:
        yield recording


HISTORY_TIMES = [NOON_US // 1_000_000 - 10 * (99 - k) - (300 if k < 90 else 0) for k in range(100)]


def point_values(k: int) -> tuple[float, ...]:
    """Of point k: estimate to observability."""
    return 0.06 + k / 1024, k / 1024, 0.125, float(k), 0.0, 1.25, 0.5


def monitored_axis(name: str = "axis1") -> AxisSnapshot:
    """An axis with an open alarm on fm."""
    facts = AxisStatus(NOON_US - 400_000, PARAMETERS, 1.37e-6, ("1/Ja is not observed",), COUNTERS, DETECTORS)
    dropped = {"no_partner": 5, "late": 0}
    return AxisSnapshot(
        id=f"demo.{name}",
        robot="demo",
        name=name,
        bus="can0",
        drive="three-mass",
        output="angle",
        interval_s=0.005,
        nominal=NOMINAL,
        status=facts,
        causes=tuple(p.name for p in PARAMETERS),
        open_alarms=(FM_ALARM,),
        dropped=dropped,
        clock={"clock_reanchored": 3},
        stamps=Stamps("cyclic", 0.00041, 0.0050002),
        trends=slow_courses(),
        heat=Heat(12.5, 0.25, known=True),
    )


def waiting_axis(name: str = "axis2") -> AxisSnapshot:
    """An axis that has had no sample."""
    parameters = tuple(
        replace(
            p,
            estimate=p.nominal,
            g_up=0.0,
            g_down=0.0,
            status=Status.WAITING,
            not_tested=NotTested.NO_SAMPLE,
            tested_s=0.0,
        )
        for p in PARAMETERS
    )
    silent = tuple(replace(d, leading="", evidence=0.0) for d in DETECTORS)
    facts = AxisStatus(None, parameters, 1e-6, (), dict.fromkeys(COUNTERS, 0), silent)
    axis = replace(monitored_axis(name), bus="can1", status=facts, open_alarms=())
    unknown = tuple(ParameterTrend(p.name, p.unit, p.nominal, 3600.0) for p in PARAMETERS)
    return replace(axis, dropped=dict.fromkeys(axis.dropped, 0), stamps=NOT_KNOWN, trends=unknown, histories_lost=1)


def whole_snapshot() -> Snapshot:
    return Snapshot(
        taken_us=NOON_US,
        started_us=NOON_US - 600_000_000,
        axes=(monitored_axis(), waiting_axis()),
        buses=(
            BusSnapshot("can0", "up", 242_420, {"queue_full": 12, "socket": 0}),
            BusSnapshot("can1", "down: Network is down", 0, {"queue_full": 0, "socket": 0}),
        ),
        processing=Histogram((0.001, 0.01, 0.1), (100, 20, 3, 1), 1.25),
        checkpoint_us=NOON_US - 30_000_000,
        messages=("demo.axis1: its checkpoint is not used and kept aside: it is damaged",),
        certificates=(Expiry("web", Path("cell.crt"), NOON_US + 86_400_000_000),),
    )


NO_REPORTS = ReportPages(Path("nowhere"), ())


@dataclass
class Stage:
    """The daemon that the tests move by hand."""

    journal: Journal
    snapshot: Snapshot = field(default_factory=whole_snapshot)
    now_us: int = NOON_US + 250_000
    reports: ReportPages = NO_REPORTS
    access: Access | None = None
    extracts: Extracts | None = None
    history: HistoryRecording | None = None
    setup: RobotSetup = field(default_factory=lambda: robot_setup())
    replays: ReplayReports | None = None
    acknowledge: Callable[[int, Note], RecordedAlarm | None] = lambda _id, _note: None
    stopping: bool = False
    live: LiveSignals = field(default_factory=lambda: LiveSignals(lambda: 0.0))  # its clock stands still
    links: tuple[LinkSnapshot, ...] = (
        LinkSnapshot("orders", "webhook", False, "HTTP status 503", 3, 41, {"age": 2, "refused": 1}),
    )

    def app(self) -> FastAPI:
        state = AppState(
            lambda: self.snapshot,
            self.journal,
            self.setup,
            self.reports,
            self.access or Access(),
            lambda: self.now_us,
            self.extracts,
            self.history,
            lambda: self.links,
            acknowledge=lambda alarm_id, note: self.acknowledge(alarm_id, note),
            stopping=lambda: self.stopping,
            live=self.live,
            replays=self.replays,
        )
        return create_app(state)

    def client(self) -> TestClient:
        """Of an application of its own where that is made otherwise for this stage."""
        if self.access or self.reports is not NO_REPORTS or self.extracts:
            return TestClient(self.app(), base_url="http://localhost")
        _SHARED.stage = self
        return TestClient(shared_app(), base_url="http://localhost")

    def record(self, axis: str, unit: str, nominal: float, alarm: Alarm) -> int:
        """The number of this alarm in the journal."""
        (number,) = self.journal.record([JournalEntry(axis, unit, nominal, alarm)])
        return number

    def healthy(self) -> None:
        """All buses up, all axes with samples, no link down."""
        axes = (monitored_axis(), monitored_axis("axis2"))
        self.snapshot = replace(self.snapshot, axes=axes, buses=self.snapshot.buses[:1], messages=())
        self.links = ()


class _SharedState:
    """In place of AppState: what the stage has that a client was made of last."""

    stage: Stage
    access, reports, extracts, replays = Access(), NO_REPORTS, None, None
    prepared: ClassVar[list[CachedAnswer]] = []
    axis, recording_of = AppState.axis, AppState.recording_of

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stage, name)

    def snapshot(self) -> Snapshot:
        return self.stage.snapshot

    def now_us(self) -> int:
        return self.stage.now_us

    def links(self) -> tuple[LinkSnapshot, ...]:
        return self.stage.links


_SHARED = _SharedState()


@cache
def shared_app() -> FastAPI:
    """To make one for each test, and its description, takes longer than most of the tests."""
    return create_app(cast(AppState, _SHARED))


class Served(Protocol):
    """What a web server can be started for."""

    stopping: bool

    def app(self) -> FastAPI: ...


class Daemon:
    """The web server of a stage, or of a core that runs, in a thread of its own."""

    def __init__(self, stage: Served, port: int = 0, certificate: Certificate | None = None) -> None:
        self._stop, self._ready = threading.Event(), threading.Event()
        self.port, self._stage = 0, stage
        stage.stopping = False
        arguments = (stage.app(), "127.0.0.1", port, self._started, self._stop, certificate)
        self._thread = threading.Thread(target=serve, args=arguments)
        self._thread.start()
        assert self._ready.wait(PATIENCE_S)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def _started(self, port: int) -> None:
        self.port = port
        self._ready.set()

    def stop(self) -> None:
        self._stage.stopping = True  # streams of events end
        self._stop.set()
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()


@contextmanager
def serving(stage: Served, certificate: Certificate | None = None) -> Iterator[str]:
    """The address at which a stage is served."""
    daemon = Daemon(stage, certificate=certificate)
    try:
        yield daemon.url
    finally:
        daemon.stop()


@pytest.fixture
def stage(tmp_path: Path, history: HistoryRecording) -> Iterator[Stage]:
    journal = Journal(tmp_path / "alarms.sqlite")
    yield Stage(journal, history=history)
    journal.close()


@pytest.fixture
def client(stage: Stage) -> Iterator[TestClient]:
    with stage.client() as opened:
        yield opened


@pytest.fixture
def fm_alarm() -> Alarm:
    return FM_ALARM


def with_status(stage: Stage, **changes: Any) -> None:
    """The first axis alone, with another status."""
    axis = stage.snapshot.axes[0]
    stage.snapshot = replace(stage.snapshot, axes=(replace(axis, status=replace(axis.status, **changes)),))


def with_axis(stage: Stage, **changes: Any) -> None:
    """The first axis with other values, and the others as they are."""
    first, *others = stage.snapshot.axes
    stage.snapshot = replace(stage.snapshot, axes=(replace(first, **changes), *others))


SIGNAL_CHECK = SignalCheck(
    axis="demo.axis1", seconds=10.0, samples=2000, rate_hz=200.0, scatter_s=0.00041, missing=0.005, moves=True,
    signals=[
        SignalRange(signal="Axis1State.Torque", unit="N m", low=-1.5, high=1.25),
        SignalRange(signal="Axis1State.Angle", unit="rad", low=0.5, high=2.0),
    ],
    problems=["the torque <b>is stuck</b>"],
    proposals=["the units look like degrees. -> angle.factor = 0.0174533"],
    doubts=[],
    sentences=[],
)  # fmt: skip


@cache
def _demo(file: Path) -> Config:
    full = load(file, {})
    return with_axes(full, full.robot[0].axis[:2])


def robot_setup(look: Callable[[str], SignalCheck] = lambda _: SIGNAL_CHECK) -> RobotSetup:
    """That of the demo, as it was commissioned, with its first two axes; it is read once it is asked for."""
    file = shipped("demo/axiswatch.toml")
    return RobotSetup(lambda: _demo(file), file, look, lambda: {"alarms.sqlite": None})


@pytest.fixture
def configured(stage: Stage) -> Stage:
    """With the configuration of the demo."""
    stage.setup = robot_setup()
    stage.reports = ReportPages(stage.setup.file.parent, [axis.id for axis in stage.snapshot.axes])
    return stage


# --- The page in a real browser ---------------------------------------------------------------------------------------


@pytest.fixture
def daemon(stage: Stage) -> Iterator[Daemon]:
    started = Daemon(stage, own_port())  # it can be had again
    yield started
    started.stop()


@pytest.fixture
def page(browser: "Browser", daemon: Daemon) -> Iterator["Page"]:
    with quiet_page(browser, daemon.port) as opened:
        yield opened


@contextmanager
def quiet_page(browser: "Browser", port: int) -> Iterator["Page"]:
    """A page that must not complain, nor ask any other host."""
    complaints: list[str] = []
    own = f"http://127.0.0.1:{port}"
    opened = browser.new_page(base_url=own)
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on("request", lambda r: None if r.url.startswith(own) else complaints.append(r.url))
    # The browser itself reports each request that was refused, or that nobody answered.
    expected = "Failed to load resource"
    opened.on(
        "console",
        lambda m: complaints.append(m.text) if m.type == "error" and not m.text.startswith(expected) else None,
    )
    yield opened
    opened.close()
    assert complaints == []
