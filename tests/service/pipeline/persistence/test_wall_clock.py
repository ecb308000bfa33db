"""The clock of the machine is set: an alarm lasts as long as its cause, and no axis seems to have a fault."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from service.can.frames import Frame, FrameBlock
from service.pipeline.persistence.wall_clock import SHOWN_US, WallClock
from service.simulation.robot import SimulatedFault
from service.store.alarm_filter import AlarmFilter
from tests.service.pipeline.robots import START_US, Waiting, blocks, changed, demo
from tests.service.pipeline.running_core import StandingCore

HOUR_US = 3_600_000_000
FAULTS = [SimulatedFault("demo.axis1", {"fm": 2.0}, 6.0), SimulatedFault("demo.axis1", {"fm": 0.5}, 14.0)]
"""And it is as before"""
LENGTH_S, STEP_S = 36.0, 9.0


class Clocks:
    """Two clocks, one of which can be set."""

    def __init__(self) -> None:
        self.steady_s, self.set_by_us = 0.0, 0

    def wall_us(self) -> int:
        return START_US + round(self.steady_s * 1e6) + self.set_by_us

    def steady(self) -> float:
        return self.steady_s


def test_each_step_is_recorded_and_slow_corrections_are_none() -> None:
    clocks = Clocks()
    clock = WallClock(clocks.wall_us, clocks.steady)
    with capture_logs() as logs:
        for step_us in (0, -3 * HOUR_US, 900_000, HOUR_US, -900_000):
            clocks.set_by_us += step_us
            clocks.steady_s += 0.1
            assert clock() == clocks.wall_us()
        clocks.steady_s += 100 * 86400  # nobody asks for long
        clock()
    assert [(entry["event"], entry["by_s"]) for entry in logs] == [
        ("the clock was set", -3 * 3600),
        ("the clock was set", 3600),
    ]
    assert clock.set_by_us == -2 * HOUR_US


def test_a_step_is_a_message_for_a_week() -> None:
    """The log keeps it; on the page it would hide what is new."""
    clocks = Clocks()
    clock = WallClock(clocks.wall_us, clocks.steady)

    def message_after(seconds: float, step_us: int = 0) -> str:
        clocks.steady_s += seconds
        clocks.set_by_us += step_us
        clock()
        return clock.message or ""

    assert message_after(1) == ""
    assert "was set back by an hour, to 2025-" in message_after(86400, -HOUR_US)
    last = message_after(86400, 3 * HOUR_US)
    assert "was set forward by 3 hours, to 2025-" in last
    assert message_after(SHOWN_US / 1e6) == last
    assert message_after(1) == ""
    assert "was set forward by an hour" in message_after(1, HOUR_US)


class Stepping(Waiting):
    """The frames come as time goes on, with the times of the wall clock, which is set once."""

    def __init__(self, frames: Sequence[Frame], step_us: int, clocks: Clocks) -> None:
        super().__init__(frames)
        self._step_us, self._clocks = step_us, clocks

    def go_on(self) -> None:
        """Let a second go by."""
        self._clocks.steady_s += 1.0
        if self._clocks.steady_s > STEP_S:
            self._clocks.set_by_us = self._step_us

    def take(self, most: int = 4096) -> FrameBlock:
        end_us = START_US + round(self._clocks.steady_s * 1e6)
        count = sum(frame.t_us < end_us for frame in self.frames[:most])
        shifted = [f._replace(t_us=f.t_us + self._clocks.set_by_us) for f in self.frames[:count]]
        self.frames[:count] = shifted
        return super().take(count)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory, seed: int) -> list[Frame]:
    config = demo(tmp_path_factory.mktemp("frames"), 1)
    return [frame for block in blocks(config, LENGTH_S, seed, FAULTS) for frame in block.frames()]


@pytest.mark.parametrize("step_us", [-3 * HOUR_US, 3 * HOUR_US], ids=["back", "forward"])
def test_an_alarm_lasts_as_long_as_its_cause(tmp_path: Path, frames: list[Frame], step_us: int) -> None:
    clocks = Clocks()
    reader = Stepping(frames, step_us, clocks)
    wall = WallClock(clocks.wall_us, clocks.steady)
    bench = StandingCore(tmp_path, demo(tmp_path, 1), reader, wall=wall)
    bench.compile()
    while reader.frames:
        reader.go_on()
        bench.worker.turn()
    (alarm,) = bench.journal.query(AlarmFilter("demo.axis1"))[0]
    assert alarm.ended_us is not None
    assert alarm.raised_us < alarm.updated_us <= alarm.ended_us
    assert 14.0 < (alarm.ended_us - START_US) * 1e-6 < LENGTH_S
    assert wall.message in bench.worker.snapshot.messages
    bench.close()


@pytest.mark.parametrize("step_us", [-1_200_000, -300_000, -80_000, -60_000, 300_000])
def test_a_small_step_of_the_clock_is_no_fault_of_an_axis_without_a_counter(
    tmp_path: Path, seed: int, step_us: int
) -> None:
    """Such as that of an NTP daemon; the times of the samples are fitted to those of receipt."""
    config = changed(demo(tmp_path, 1), time={"counter_signal": None, "counter_message": None, "clock": "cyclic"})
    reader = Stepping([f for block in blocks(config, 22.0, seed) for f in block.frames()], step_us, Clocks())
    bench = StandingCore(tmp_path, config, reader)
    bench.compile()
    while reader.frames:
        reader.go_on()
        bench.worker.turn()
    assert bench.journal.query(AlarmFilter("demo.axis1"))[0] == []
    counted_on = -500_000 < step_us < 0
    events = bench.core.ingests["can0"].axes["demo.axis1"].events
    assert events == {
        "clock_reanchored": int(step_us < 0),
        "clock_set_back": int(step_us < 0 and not counted_on),
    }
    assert bench.core.monitors.by_id["demo.axis1"].status().counters["gap"] == int(not counted_on)
    bench.close()
