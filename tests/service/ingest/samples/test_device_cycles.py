"""A SocketCAN device that goes and comes while a robot sends: the estimates go on, without an alarm."""

from __future__ import annotations

import os
import random
import resource
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from service.can.bus import open_bus, send
from service.can.bus_reader import CanReader
from service.can.user_errors import BusError
from service.config import load
from service.config.schema import Config
from service.ingest.samples.encode import FrameEncoder
from service.pipeline.axes.axis_monitors import FramePipeline
from service.simulation.robot import Moment, SimulatedRobot, run_robot
from tests.end_to_end.processes import demo_config, edit
from tests.service.can.network_devices import ip

pytestmark = pytest.mark.vcan

DEVICE = "vcan8"
CYCLES = 100 if "AXISWATCH_SOAK" in os.environ else 5
PATIENCE_S, GROWN_KB = 60.0, 20_000


@pytest.fixture
def config(tmp_path: Path) -> Iterator[Config]:
    file = demo_config(tmp_path, f'interface = "socketcan"\nchannel = "{DEVICE}"', axes=1)
    # A quarter of the samples: a robot of the slow virtual kernel leaves out none.
    edit(file, ("sample_interval_s = 0.005", "sample_interval_s = 0.02"))
    add()
    yield load(file, {})
    if Path("/sys/class/net", DEVICE).exists():
        ip("link", "del", DEVICE)


def add() -> None:
    ip("link", "add", "dev", DEVICE, "type", "vcan")
    ip("link", "set", DEVICE, "up")


@contextmanager
def sending(config: Config, seed: int) -> Iterator[None]:
    """A robot that goes on whatever becomes of its device."""
    encoder, stop, (described,) = FrameEncoder(config, "can0"), threading.Event(), config.bus
    buses = [open_bus(described, ())]

    def send_moment(moment: Moment) -> int:
        try:
            if not buses:
                buses.append(open_bus(described, ()))
            for key, data in encoder.encode(moment.readings, moment.number):
                send(buses[0], key, data)
        except BusError:
            while buses:
                buses.pop().shutdown()
        return 1

    robot = threading.Thread(target=run_robot, args=(SimulatedRobot(config, seed), send_moment, stop))
    robot.start()
    try:
        yield
    finally:
        stop.set()
        robot.join(PATIENCE_S)
        while buses:
            buses.pop().shutdown()


def test_random_cycles(config: Config, seed: int) -> None:
    chance, pipeline, alarms = random.Random(seed), FramePipeline(config), list[object]()
    reader = CanReader(config.bus[0], pipeline.ingests["can0"].filter)
    monitor, axis = pipeline.monitors.by_id["demo.axis1"], pipeline.ingests["can0"].axes["demo.axis1"]

    def counted(*what: str) -> int:
        """Samples so far, after those that have come since."""
        pipeline.take("can0", reader.take())
        alarms.extend(pipeline.update())
        return sum(int(monitor.status().counters[name]) for name in what)

    def go_on(*what: str) -> None:
        """Until there are more of these samples."""
        before, end = counted(*what), time.monotonic() + PATIENCE_S
        while counted(*what) < before + 20:
            counters = dict(monitor.status().counters)
            found = f"{reader.stats()}, samples {counters}, dropped {dict(axis.dropped)}, {dict(axis.events)}"
            assert time.monotonic() < end, found
            time.sleep(0.02)

    reader.open()
    reader.start()
    memory_kb = 0
    try:
        with sending(config, seed):
            for cycle in range(CYCLES):
                go_on("settling", "used")
                gone = chance.random() < 0.5 if cycle > 1 else cycle == 1
                ip("link", "del", DEVICE) if gone else ip("link", "set", DEVICE, "down")
                time.sleep(chance.uniform(0.0, 0.6))
                counted("used")
                add() if gone else ip("link", "set", DEVICE, "up")
                if cycle == CYCLES // 3:
                    memory_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            go_on("used")
            assert reader.stats().up
    finally:
        reader.close()
    assert alarms == []
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory_kb < GROWN_KB
    assert [thread.name for thread in threading.enumerate() if thread.name.startswith("reader")] == []
