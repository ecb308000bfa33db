"""The daemon on real SocketCAN devices."""

import re
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from tests.end_to_end.processes import daemon, demo_config, mistakes, robot, run_program, wait_for

pytestmark = pytest.mark.vcan

VCAN0 = 'interface = "socketcan"\nchannel = "vcan0"'


def test_a_robot_on_vcan0_is_monitored_while_the_interface_goes_down_and_up(
    tmp_path: Path, need: Callable[[str], str]
) -> None:
    config = demo_config(tmp_path, VCAN0, axes=1)
    ip = need("ip")
    subprocess.run([ip, "link", "set", "vcan0", "down"], check=True)
    with daemon(config) as d:  # starts all the same, and waits
        reasons = wait_for(lambda: d.get("readyz")["reasons"])
        assert reasons[0].startswith("bus can0: down")
        subprocess.run([ip, "link", "set", "vcan0", "up"], check=True)
        with robot(config):
            wait_for(lambda: d.status("readyz") == 200)
            wait_for(lambda: d.axis()["counters"]["used"] > 0)
        subprocess.run([ip, "link", "set", "vcan0", "down"], check=True)
        try:
            reasons = wait_for(
                lambda: [r for r in d.get("readyz")["reasons"] if r.startswith("bus can0: down")]
            )
            assert "ip link set vcan0 up" in reasons[0]
            assert d.status("healthz") == 200
        finally:
            subprocess.run([ip, "link", "set", "vcan0", "up"], check=True)
        before = d.axis()["samples"]
        with robot(config):
            wait_for(lambda: d.status("readyz") == 200)
            wait_for(lambda: d.axis()["samples"] > before)
        assert d.stop() == 0


def test_an_interface_that_does_not_exist_is_said_and_ends_with_3(tmp_path: Path) -> None:
    config = demo_config(tmp_path, 'interface = "socketcan"\nchannel = "can9"', axes=1)
    code, lines = mistakes(run_program("run", "--config", config))
    assert code == 3
    assert "bus can0: there is no network interface can9" in lines[-1]
    assert "ip link add dev can9 type vcan" in lines[-1]


def test_run_sends_nothing(tmp_path: Path) -> None:
    """All that is seen on the device of the daemon is what a robot sends there."""
    config = demo_config(tmp_path, VCAN0, axes=1)
    with can.Bus("vcan0", interface="socketcan", receive_own_messages=True) as bus:
        with daemon(config) as d:
            wait_for(lambda: d.status("healthz") == 200)
            time.sleep(1)
            assert bus.recv(0) is None, "nobody else is on this bus"
            with robot(config):
                wait_for(lambda: d.axis()["counters"]["used"] > 0)
            seen = {message.arbitration_id for message in iter(lambda: bus.recv(0.2), None)}
            assert len(seen) == 1, "the one message of the robot's axis"
            assert d.stop() == 0
        assert bus.recv(0.2) is None, "not at the end either"


def test_a_process_that_is_stopped_for_two_seconds_loses_nothing(tmp_path: Path) -> None:
    """As on a machine that is busy: the frames wait in the kernel, and keep the times of their receipt."""
    config = demo_config(tmp_path, VCAN0, axes=1)
    with daemon(config) as d:
        wait_for(lambda: d.status("healthz") == 200)
        with robot(config) as simulated:
            wait_for(lambda: d.axis()["samples"] > 100)
            before = d.axis()
            d.process.send_signal(signal.SIGSTOP)
            time.sleep(2)
            d.process.send_signal(signal.SIGCONT)
            wait_for(lambda: d.axis()["samples"] > before["samples"] + 700)
            simulated.send_signal(signal.SIGINT)
            assert simulated.wait(60) == 0
        reported = re.search(
            r"^(\d+) frames sent", (tmp_path / "robot.log").read_text(encoding="utf-8"), re.MULTILINE
        )
        assert reported
        wait_for(lambda: d.axis()["samples"] == int(reported[1]))
        after = d.axis()
        assert {name: count for name, count in after["dropped"].items() if count and name != "missing"} == {}
        # The robot of a slow machine may have left out samples itself.
        if after["dropped"]["missing"] == before["dropped"]["missing"]:
            assert after["counters"]["gap"] == before["counters"]["gap"]
        assert d.stop() == 0
