"""The daemon with 20 000 frames a second, all of which it needs, by SocketCAN's reader."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.bench.full_bus_robot import AXES, RATE_HZ, WATCHED_S, configured, frames
from tests.bench.measure import Say, cpu, memory_mb
from tests.end_to_end.processes import Daemon, daemon, wait_for
from tests.ports import own_port
from tests.soak.full_bus_traffic import sending, written

pytestmark = pytest.mark.bench


def test_twenty_thousand_frames_a_second(tmp_path: Path, say: Say) -> None:
    config, file = configured(tmp_path), written(tmp_path / "frames", frames(), 1.0)
    port = str(own_port())
    with daemon(config, program=(sys.executable, "-m", "tests.bench.datagram_daemon", port)) as d:
        wait_for(lambda: not d.get("api/v1/service")["messages"])  # it is compiled
        with sending(3600.0, file, port) as sender:
            measured(d, sender, say)


def measured(d: Daemon, sender: subprocess.Popen[str], say: Say) -> None:
    wait_for(lambda: d.axis()["counters"]["used"])
    time.sleep(2)
    before, sender_before, first = (cpu(d.process.pid), cpu(sender.pid), d.get("api/v1/service")["buses"][0])
    time.sleep(WATCHED_S)
    after, sender_after, last = cpu(d.process.pid), cpu(sender.pid), d.get("api/v1/service")["buses"][0]
    used = d.axis()["counters"]["used"]
    rows = [
        ("daemon, of one core", after.share_since(before), "30 %"),
        ("daemon, resident MB", memory_mb(d.process.pid), 250),
        ("frames/s", (last["frames"] - first["frames"]) / (after.at_s - before.at_s), AXES * RATE_HZ),
        ("dropped", sum(last["dropped"].values()) - sum(first["dropped"].values()), 0),
        ("samples of an axis in use", used, "-"),
        ("the sender beside it", sender_after.share_since(sender_before), "-"),
    ]
    say(f"the daemon, {AXES} axes at {RATE_HZ} Hz over {WATCHED_S:.0f} s", ("", "found", "target"), rows)
