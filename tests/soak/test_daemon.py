"""The daemon over minutes, killed many times, and from an empty kernel cache."""

import os
import sys
import time
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from service.pipeline.kernel_cache import VARIABLE, CacheFiller, KernelShape
from tests.bench.measure import memory_mb
from tests.end_to_end.killed_daemons import killed
from tests.end_to_end.played_robot import played_robot
from tests.end_to_end.processes import daemon, demo_config, wait_for

pytestmark = pytest.mark.soak

MINUTES = 5
KILLS = int(os.environ.get("AXISWATCH_KILLS", "200"))
MOST_GROWTH_MB = 15
"""Frames of the last two minutes, which are kept for an alarm"""


def test_memory_does_not_grow(tmp_path: Path, seed: int) -> None:
    config = demo_config(tmp_path, axes=6)
    with daemon(config) as d, played_robot(config, 60 * MINUTES, seed):
        wait_for(lambda: d.status("readyz") == 200)
        used_mb = []
        for _ in range(MINUTES):
            end = time.monotonic() + 60
            while time.monotonic() < end:
                assert d.text("metrics")
                assert d.get("api/v1/axes/demo.axis1/history")["parameters"]
                time.sleep(1)
            used_mb.append(memory_mb(d.process.pid))
        print(f"resident MB after each minute: {used_mb}")
        expected = 0.95 * MINUTES * 60 * 6 * 200
        wait_for(lambda: sum(axis["samples"] for axis in d.get("api/v1/axes")["axes"]) > expected)
        assert d.stop() == 0
    assert used_mb[-1] - used_mb[0] < MOST_GROWTH_MB


def test_another_process_fills_the_kernel_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    with capture_logs() as logs:
        assert CacheFiller().fill(list(KernelShape))
        monkeypatch.setattr(sys, "executable", "/no/such/program")
        assert CacheFiller().fill(list(KernelShape))
    assert logs == []


def test_the_second_process_compiles_what_the_first_then_uses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiled for other types than those of the kernel, a part would be there twice, and no second saved."""
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    assert CacheFiller().fill([KernelShape.FEW_AXES])
    for part in ("update_estimates", "update_tests"):
        assert len(list(tmp_path.rglob(f"update.{part}-*.nbc"))) == 1


def test_no_shown_alarm_is_lost(tmp_path: Path, seed: int) -> None:
    """kill -9 so many times during alarms and what is done about them, and as often while the daemon starts."""
    shown = killed(tmp_path, seed, kills=KILLS, while_starting=True)
    assert any(alarm["parameter"] == "fm" for alarm in shown.values())
