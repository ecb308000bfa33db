"""kill -9 fifty times while alarms are raised, and as often while the daemon starts."""

from __future__ import annotations

import random
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from tests.end_to_end.processes import Daemon, daemon, demo_config, running
from tests.end_to_end.test_daemon import FAST_CHECKPOINTS, INTERVAL_S, alarms, axis, parameters, still

pytestmark = pytest.mark.soak

KILLS = 50
RATE_HZ = 200
FAULT = ("--fault", "fm=1.6", "--fault-after", "20")


def test_no_shown_alarm_is_lost(tmp_path: Path, seed: int) -> None:
    config = demo_config(tmp_path, service=FAST_CHECKPOINTS)
    chance = random.Random(seed)
    shown: dict[int, dict[str, Any]] = {}
    samples = 0
    with running("simulate", "--config", config, *FAULT, log=tmp_path / "robot.log"):
        for _ in range(KILLS):
            kill_while_starting(config, chance.uniform(0, 1.5))
            with daemon(config) as d:
                compare(d, shown, samples)
                time.sleep(chance.uniform(0, 3))
                samples, shown = axis(d)["samples"], alarms(d)
                kill(d)
    assert samples > KILLS * RATE_HZ / 2
    assert any(alarm["parameter"] == "fm" for alarm in shown.values())


def kill_while_starting(config: Path, after_s: float) -> None:
    with running("run", "--config", config, "--port", "0", log=config.parent / "start.log"):
        time.sleep(after_s)


def compare(d: Daemon, shown: dict[int, dict[str, Any]], samples: int) -> None:
    """All alarms that were shown are still there, and of the estimation at most an interval is lost."""
    now, first = alarms(d), axis(d)
    assert {k: still(shown[k]) for k in shown} == {k: still(now[k]) for k in shown}
    assert first["samples"] >= samples - 3 * INTERVAL_S * RATE_HZ
    if any(alarm["active"] and alarm["axis"] == first["id"] for alarm in now.values()):
        assert "alarm" in {p["status"] for p in parameters(first).values()}


def kill(d: Daemon) -> None:
    d.process.kill()
    assert d.process.wait() == -signal.SIGKILL
