"""The daemon as a process of its own, a simulated robot as another: CPU, memory, time to the first estimate."""

import sys
import time
from pathlib import Path

import numpy as np
import pytest

from service.can.frames import concatenate_frames
from service.config import load
from tests.bench.measure import Say, cpu, memory_mb
from tests.end_to_end.processes import Daemon, daemon, demo_config, edit, robot, wait_for
from tests.ports import own_port
from tests.service.pipeline.robots import blocks
from tests.soak.full_bus_traffic import finished, sending, written

pytestmark = pytest.mark.bench

AXES, WATCHED_S = 6, 20.0
INTERVAL = "sample_interval_s = 0.005"
SETTLING = "settling_time_s = 4.5"
LONGEST_START_S = 60.0


def samples(d: Daemon) -> int:
    return sum(int(axis["samples"]) for axis in d.get("api/v1/axes")["axes"])


@pytest.mark.parametrize(("rate", "target"), [(200, "6 %"), (1000, "15 %")])
def test_six_axes(tmp_path: Path, say: Say, rate: int, target: str) -> None:
    config = demo_config(tmp_path, axes=AXES)
    text = config.read_text(encoding="utf-8")
    assert INTERVAL in text
    config.write_text(text.replace(INTERVAL, f"sample_interval_s = {1 / rate}"), encoding="utf-8")
    with daemon(config) as d, robot(config) as simulated:
        wait_for(lambda: d.status("readyz") == 200)
        time.sleep(2)
        count, before, robot_before = samples(d), cpu(d.process.pid), cpu(simulated.pid)
        time.sleep(WATCHED_S)
        after, robot_after = cpu(d.process.pid), cpu(simulated.pid)
        found = (samples(d) - count) / (after.at_s - before.at_s)
        rows = [
            ("daemon, of one core", after.share_since(before), target),
            ("daemon, resident MB", memory_mb(d.process.pid), 250),
            ("samples/s and axis", found / AXES, rate),
            ("the robot beside it", robot_after.share_since(robot_before), "-"),
        ]
    say(f"the daemon, {AXES} axes at {rate} Hz over {WATCHED_S:.0f} s", ("", "found", "target"), rows)


@pytest.mark.parametrize("service", ["", "block_s = 0.1", "block_s = 0.01"])
def test_latency(tmp_path: Path, seed: int, say: Say, service: str) -> None:
    """From the receipt of a frame to the estimate that has used it, six axes at 1 kHz."""
    config = demo_config(tmp_path, axes=AXES, service=service)
    file, port = tmp_path / "ages.npy", str(own_port())
    edit(config, (INTERVAL, "sample_interval_s = 0.001"))
    frames = concatenate_frames(list(blocks(load(config, {}), WATCHED_S, seed)))
    sent = written(tmp_path / "frames", frames, 1.0)
    program = (sys.executable, "-m", "tests.bench.latency_daemon", str(file), port)
    with daemon(config, program=program) as d:
        wait_for(lambda: not d.get("api/v1/service")["messages"])  # it is compiled
        with sending(0.0, sent, port) as sender:
            before = cpu(d.process.pid)
            _, _, late_s = finished(sender)
            share = cpu(d.process.pid).share_since(before)
        wait_for(lambda: d.axis()["counters"]["used"])
        assert d.stop() == 0
    ages_ms = np.load(file)[frames.size // 10 :] / 1000
    median, late = np.percentile(ages_ms, [50, 99.9]).tolist()
    rows = [
        ("median", median, 25),
        ("99.9 %", late, 60),
        ("largest", float(ages_ms.max()), "-"),
        ("the sender's latest frame", 1000 * late_s, "-"),
        ("daemon, of one core", share, "15 %"),
    ]
    header = ("", "found ms", "target ms")
    blocks_of = f"blocks of {load(config, {}).block_s} s"
    say(f"from a frame to the estimate, {AXES} axes at 1 kHz, {blocks_of}", header, rows)


def test_time_to_the_first_estimate(tmp_path: Path, seed: int, say: Say, monkeypatch: pytest.MonkeyPatch) -> None:
    """The robot's frames were made before: what it computes would take a third of a processor from the compiler."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    config = demo_config(tmp_path, axes=AXES)
    # Else the predictor's settling, which is time of the robot, is what is measured.
    edit(config, (SETTLING, "settling_time_s = 0.0"))
    frames = concatenate_frames(list(blocks(load(config, {}), LONGEST_START_S, seed)))
    port, rows = str(own_port()), []
    with sending(3 * LONGEST_START_S, written(tmp_path / "frames", frames, 1.0), port) as sender:
        time.sleep(3)
        for cache, target in (("empty", 15), ("filled", 3)):
            before = cpu(sender.pid)
            found = first_estimate(config, port)
            rows.append((cache, *found, cpu(sender.pid).share_since(before), target))
    header = "compile cache", "page s", "estimate s", "resident MB", "most MB", "robot, of a core", "target s"
    say(f"from the start of the daemon to the first estimate, {AXES} axes, without settling", header, rows)


def first_estimate(config: Path, port: str) -> tuple[float, float, float, float]:
    start = time.monotonic()
    with daemon(config, program=(sys.executable, "-m", "tests.bench.datagram_daemon", port)) as d:
        page_s = time.monotonic() - start
        wait_for(lambda: d.axis()["counters"]["used"])
        found = time.monotonic() - start, memory_mb(d.process.pid), memory_mb(d.process.pid, "VmHWM")
        assert d.stop() == 0
    return page_s, *found
