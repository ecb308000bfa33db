"""What the web answers for a thousand axes: of a new snapshot, of one that was asked for before, by a busy daemon."""

import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median

import httpx
import numpy as np
import pytest

from service.pipeline.snapshot import AxisSnapshot
from service.store.journal import Journal
from tests.bench.full_bus_robot import configured, frames
from tests.bench.measure import Say, cpu
from tests.end_to_end.processes import daemon, wait_for
from tests.ports import own_port
from tests.service.web.conftest import Stage, monitored_axis
from tests.soak.full_bus_traffic import sending, written

pytestmark = pytest.mark.bench

AXES, ROUNDS = 1000, 15
TARGETS_S = {"/metrics": 0.05, "/api/v1/axes": 0.1}


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    journal = Journal(tmp_path / "alarms.sqlite")
    held = Stage(journal)
    axes = tuple(monitored_axis(f"axis{number}") for number in range(AXES))
    held.snapshot = replace(held.snapshot, axes=axes)
    yield held
    journal.close()


def moved(axis: AxisSnapshot, by: float) -> AxisSnapshot:
    """After some more samples: every number that follows them is another one."""
    status = axis.status
    parameters = tuple(
        replace(
            p, estimate=p.estimate * (1 + by / 7), standard_deviation=p.standard_deviation * (1 + by / 9),
            p_diagonal=p.p_diagonal * (1 + by / 11), g_up=by / 13, tested_s=p.tested_s + by,
        )
        for p in status.parameters
    )  # fmt: skip
    detectors = tuple(replace(d, evidence=by / 17) for d in status.detectors)
    counters = {**status.counters, "used": round(1e6 * by)}
    status = replace(status, parameters=parameters, detectors=detectors, counters=counters, innovation_variance=by)
    return replace(axis, status=status)


def test_a_thousand_axes(stage: Stage, seed: int, say: Say) -> None:
    client = stage.client()
    random = np.random.default_rng(seed)
    rows = []
    for path, target in TARGETS_S.items():
        client.get(path)
        found: dict[str, list[float]] = {"new": [], "asked for before": []}
        for _ in range(ROUNDS):
            axes = stage.snapshot.axes
            axes = tuple(map(moved, axes, random.random(AXES).tolist()))
            stage.snapshot = replace(stage.snapshot, axes=axes)
            for seconds in found.values():
                start = time.perf_counter()
                body = client.get(path).content
                seconds.append(time.perf_counter() - start)
        rows += [(path, snapshot, len(body) / 1e6, median(seconds), target) for snapshot, seconds in found.items()]
    header = ("", "snapshot", "MB", "s", "target s")
    say(f"answers for {AXES} axes, medians of {ROUNDS}", header, rows)


RATE_HZ, BITS, WATCHED_S = 20, 8, 60.0
# Without the multi-model detectors in shadow mode: their hypotheses take 0.1 s for each axis, at its first sample.
THREE = '["kT", "fm", "fc"]', "{ J = 0.01, fm = 0.02, fc = 0.05, tau0 = 0.0, kT = 1 }", "false"


def test_a_thousand_axes_at_work(tmp_path: Path, say: Say) -> None:
    """A daemon that gets twenty thousand samples a second, asked for all each second; how late its event loop is."""
    config, late = configured(tmp_path, AXES, RATE_HZ, BITS, *THREE), tmp_path / "late.npy"
    healthy = frames(AXES, RATE_HZ, BITS, coulomb=0.05)
    file, port = written(tmp_path / "frames", healthy, 1.0), str(own_port())
    program = (sys.executable, "-m", "tests.bench.loop_daemon", str(late), port)
    with daemon(config, program=program) as d, httpx.Client(base_url=d.page, timeout=30) as client:
        wait_for(lambda: not d.get("api/v1/service")["messages"])  # it is compiled
        with sending(3600.0, file, port):
            wait_for(lambda: d.axis()["samples"] > 10 * RATE_HZ)
            late.with_suffix(".on").touch()
            before, end_s = cpu(d.process.pid), time.monotonic() + WATCHED_S
            found: dict[str, list[float]] = {path: [] for path in TARGETS_S}
            while time.monotonic() < end_s:
                for path, seconds in found.items():
                    start = time.perf_counter()
                    assert client.get(path).status_code == 200
                    seconds.append(time.perf_counter() - start)
                time.sleep(1.0)
            share = cpu(d.process.pid).share_since(before)
            late.with_suffix(".on").unlink()
            bus = d.get("api/v1/service")["buses"][0]
            assert not d.get("api/v1/alarms")["alarms"]
        assert d.stop() == 0
    late_s, own_s = np.load(late).T
    rows = [(path, median(seconds), max(seconds), TARGETS_S[path]) for path, seconds in found.items()]
    rows.append(("event loop late, 99.9 %", *np.quantile(late_s, [0.999, 1.0]).tolist(), 0.05))
    rows.append(("not for want of a processor", *np.quantile(own_s, [0.999, 1.0]).tolist(), 0.05))
    lost = f"{sum(bus['dropped'].values())} of {bus['frames']} frames dropped"
    title = f"{AXES} axes at {RATE_HZ} Hz, {share} of a core, {lost}"
    say(title, ("", "s", "most s", "target s"), rows)
