"""Axes whose samples have stopped: two lines in the log, and no parameter that seems to be tested."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from structlog.testing import capture_logs

from monitor_core.monitoring import NotTested, Status
from service.pipeline import publishing, silence
from service.pipeline.silence import SilenceWatch, silent_after_s
from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.web.app_state import is_silent, reasons_not_ready, sample_age_s
from tests.service.pipeline.robots import START_US, Waiting, blocks, demo
from tests.service.pipeline.running_core import NOW_US, StandingCore
from tests.service.web.conftest import monitored_axis, whole_snapshot

HOUR_S = 3600.0
NAMES = ("axis1", "axis2")
LOST, BACK = "axes without samples", "axes with samples again"


class Robot:
    """Two axes, a clock that can be set, and the watch; a step is a second."""

    def __init__(self, now_us: int = NOW_US) -> None:
        self.steady_s, self.now_us = 100.0, now_us
        self.watch = SilenceWatch(lambda axis_id: [f"{axis_id}.state", "All"], lambda: self.steady_s)
        self.axes = {name: monitored_axis(name) for name in NAMES}
        self.takes = True

    def step(self, *sending: str, dropped: int = 0) -> Snapshot:
        """A second in which the named axes send samples; values of the others are dropped."""
        self.steady_s += 1.0
        self.now_us += 1_000_000
        for name, axis in self.axes.items():
            if name in sending:
                axis = replace(axis, status=replace(axis.status, time_us=self.now_us))
            else:
                axis = replace(axis, dropped={"unpaired": axis.dropped.get("unpaired", 0) + dropped})
            self.axes[name] = replace(axis, silent_since_us=self._since(axis))
        snapshot = replace(whole_snapshot(), axes=tuple(self.axes.values()), taken_us=self.now_us)
        self.watch.report(snapshot, self.takes)
        return snapshot

    def _since(self, axis: AxisSnapshot) -> int | None:
        return self.watch.since(axis.id, axis.interval_s, axis.status.time_us, self.now_us)


def lines(entries: Sequence[Any]) -> list[tuple[str, str]]:
    return [(entry["event"], entry["axes"]) for entry in entries]


def test_a_silence_of_hours_is_two_lines() -> None:
    robot = Robot()
    with capture_logs() as logs:
        for _ in range(10):
            robot.step(*NAMES)
        for _ in range(2 * 3600):
            robot.step("axis2", dropped=3)
        for _ in range(60):
            robot.step(*NAMES)
    assert lines(logs) == [(LOST, "demo.axis1"), (BACK, "demo.axis1")]
    lost, back = logs
    assert lost["log_level"] == "warning"
    assert (lost["bus"], lost["bus_state"], lost["frames"]) == ("can0", "up", "demo.axis1.state, All")
    assert lost["since"] == "2025-10-09T08:55:10.000000Z"
    assert lost["dropped"] == {"unpaired": 3 * 6}  # its frames come, but become no samples
    assert back["silent_for"] == "2 hours"


def test_axes_that_fall_silent_together_are_one_line() -> None:
    robot = Robot()
    with capture_logs() as logs:
        robot.step(*NAMES)
        for _ in range(20):
            robot.step()
    assert lines(logs) == [(LOST, "demo.axis1, demo.axis2")]


def test_a_loose_contact_does_not_fill_the_log() -> None:
    robot = Robot()
    with capture_logs() as logs:
        for _ in range(240):  # minutes
            for second in range(60):
                robot.step(*(NAMES if second < 40 else ()))
    assert 2 <= len(logs) < 20
    assert {line for line, _ in lines(logs)} == {LOST, BACK}


def test_an_axis_is_not_reported_before_its_frames_can_be_taken() -> None:
    """After a restart its last sample is old, and frames wait while the kernel is compiled."""
    robot = Robot(NOW_US + 3600_000_000)
    robot.axes = {name: monitored_axis(name) for name in NAMES}
    with capture_logs() as logs:
        robot.takes = False
        for _ in range(100):
            robot.step()
        robot.takes = True
        for _ in range(5):
            robot.step()
        assert logs == []
        shown = robot.step()
        assert lines(logs) == [(LOST, "demo.axis1, demo.axis2")]
    assert all(is_silent(axis, robot.now_us) for axis in shown.axes)


@pytest.mark.parametrize("step_s", [-3 * HOUR_S, 3 * HOUR_S])
def test_the_clock_is_set_during_a_silence(step_s: float) -> None:
    robot = Robot()
    robot.step(*NAMES)
    for k in range(30):
        robot.now_us += round(1e6 * step_s) * (k == 10)
        shown = robot.step("axis2")
    silent, heard = shown.axes
    assert sample_age_s(silent, robot.now_us) == 30.0
    assert is_silent(silent, robot.now_us)
    assert not is_silent(heard, robot.now_us)
    words = [reason.words for reason in reasons_not_ready(shown, robot.now_us)]
    assert "demo.axis1: no sample for 30 s" in words


def test_a_slow_axis_may_pause_for_ten_intervals() -> None:
    assert [silent_after_s(interval_s) for interval_s in (0.001, 0.5, 2.0)] == [5.0, 5.0, 20.0]


@pytest.fixture
def bench(tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[StandingCore]:
    """A daemon for which an axis is silent after a twentieth of a second; its snapshots are always new."""
    monkeypatch.setattr(silence, "SILENT_S", 0.05)
    monkeypatch.setattr(publishing, "UNREAD_S", 0.0)
    config = demo(tmp_path, 2)
    frames = [frame for block in blocks(config, 4.0, seed) for frame in block.frames()]
    bench = StandingCore(tmp_path, config, Waiting(frames), clock_us=lambda: START_US + 4_000_000)
    bench.compile()
    yield bench
    bench.close()


def test_no_parameter_of_a_silent_axis_seems_to_be_healthy(bench: StandingCore) -> None:
    bench.worker.turn()
    states = {p.status for axis in bench.worker.snapshot.axes for p in axis.status.parameters}
    assert Status.SILENT not in states
    time.sleep(0.1)
    with capture_logs() as logs:
        bench.worker.turn()
    for axis in bench.worker.snapshot.axes:
        assert axis.silent_since_us == axis.status.time_us
        assert {(p.status, p.not_tested) for p in axis.status.parameters} == {(Status.SILENT, NotTested.NO_SAMPLE)}
    (line,) = logs
    assert (line["event"], line["frames"]) == (LOST, "Axis1State, Axis2State")
