"""The daemon on real SocketCAN devices."""

import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from service.can.bus import open_buses, send
from service.config import load
from service.ingest.samples.encode import FrameEncoder
from service.simulation.robot import Moment, Sent, SimulatedRobot, run_robot
from tests.end_to_end.processes import PATIENCE_S, Daemon, daemon, demo_config, edit, wait_for

pytestmark = pytest.mark.vcan

VCAN0 = 'interface = "socketcan"\nchannel = "vcan0"'


@contextmanager
def robot(config: Path, seed: int) -> Iterator[Callable[[], int]]:
    """The simulated robot of that configuration; what is yielded ends it, and counts the frames that it has sent."""
    read, stop, sent = load(config, {}), threading.Event(), list[Sent]()
    encoder = FrameEncoder(read, "can0")
    with open_buses(read.bus) as buses:

        def send_moment(moment: Moment) -> int:
            frames = encoder.encode(moment.readings, moment.number)
            for key, data in frames:
                send(buses["can0"], key, data)
            return len(frames)

        def end() -> int:
            stop.set()
            thread.join(PATIENCE_S)
            return sent[0].frames

        thread = threading.Thread(target=lambda: sent.append(run_robot(SimulatedRobot(read, seed), send_moment, stop)))
        thread.start()
        try:
            yield end
        finally:
            end()


def test_a_robot_is_monitored_whatever_becomes_of_its_device_and_of_the_process(
    tmp_path: Path, need: Callable[[str], str], seed: int
) -> None:
    """All that is seen on the device is what the robot sends: `run` sends nothing, not at its end either."""
    config, ip = demo_config(tmp_path, VCAN0, axes=1), need("ip")
    # A quarter of the samples: a robot of the slow virtual kernel leaves out none.
    edit(config, ("sample_interval_s = 0.005", "sample_interval_s = 0.02"))

    def link(state: str) -> None:
        subprocess.run([ip, "link", "set", "vcan0", state], check=True)

    link("down")
    with daemon(config) as d:  # starts all the same, and waits
        assert wait_for(lambda: d.get("readyz")["reasons"])[0].startswith("bus can0: down")
        link("up")
        wait_for(lambda: not down(d))
        with listening() as bus:
            time.sleep(0.5)
            assert bus.recv(0) is None, "nobody else is on this bus"
            with robot(config, seed) as end:
                wait_for(lambda: d.status("readyz") == 200)
                wait_for(lambda: d.axis()["counters"]["used"] > 0)
                nothing_is_lost_while_the_process_is_stopped(d, end)
            seen = {message.arbitration_id for message in iter(lambda: bus.recv(0.2), None)}
            assert len(seen) == 1, "the one message of the robot's axis"
        link("down")
        try:
            assert "ip link set vcan0 up" in wait_for(lambda: down(d))[0]
            assert d.status("healthz") == 200
        finally:
            link("up")
        before = d.axis()["samples"]
        with robot(config, seed):
            wait_for(lambda: d.status("readyz") == 200)
            wait_for(lambda: d.axis()["samples"] > before)
        with listening() as bus:
            assert d.stop() == 0
            assert bus.recv(0.2) is None


def down(d: Daemon) -> list[str]:
    """Why the daemon is not ready, of its bus."""
    return [reason for reason in d.get("readyz")["reasons"] if reason.startswith("bus can0: down")]


def listening() -> can.BusABC:
    return can.Bus("vcan0", interface="socketcan", receive_own_messages=True)


def nothing_is_lost_while_the_process_is_stopped(d: Daemon, end: Callable[[], int]) -> None:
    """For two seconds, as on a busy machine: frames wait in the kernel, and keep the times of their receipt."""
    before = d.axis()
    d.process.send_signal(signal.SIGSTOP)
    time.sleep(2)
    d.process.send_signal(signal.SIGCONT)
    wait_for(lambda: d.axis()["samples"] > before["samples"] + 125)
    sent = end()
    wait_for(lambda: d.axis()["samples"] == sent)
    after = d.axis()
    assert {name: count for name, count in after["dropped"].items() if count and name != "missing"} == {}
    # The robot of a slow machine may have left out samples itself.
    if after["dropped"]["missing"] == before["dropped"]["missing"]:
        assert after["counters"]["gap"] == before["counters"]["gap"]
