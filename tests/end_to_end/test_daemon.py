"""The daemon from outside: frames on a real bus between processes in, answers and files out."""

import json
import random
import signal
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx

from monitor_core.monitoring import AxisMonitor
from service.config import load
from service.pipeline.axis_monitors import AxisMonitors
from service.store.checkpoints import Checkpoint, Checkpoints
from tests.end_to_end.processes import (
    Daemon,
    daemon,
    demo_config,
    robot,
    running,
    wait_for,
)
from tests.service.command_line import axiswatch

INTERVAL_S, RATE_HZ = 1.0, 200
FAST_CHECKPOINTS = f"checkpoint_interval_s = {INTERVAL_S}\nhistory_interval_s = 0.5"


def alarms(daemon: Daemon) -> dict[int, dict[str, Any]]:
    return {alarm["id"]: alarm for alarm in daemon.get("api/v1/alarms?limit=1000")["alarms"]}


def saved(config_file: Path) -> dict[str, AxisMonitor]:
    """The monitors as the daemon has left them."""
    config = load(config_file, {})
    monitors = AxisMonitors(config.axes).by_id
    checkpoints = Checkpoints(config.service.state_dir / "checkpoints.sqlite")
    for axis_id, monitor in monitors.items():
        found = checkpoints.load(axis_id, monitor.key, 0)
        assert isinstance(found, Checkpoint)
        monitor.from_arrays(found.arrays)
    checkpoints.close()
    return dict(monitors)


DETECTORS = ("cusum", "multimodel")
"""What raises the alarms of the first axis, and of the second."""


def test_estimates_alarm_and_metrics_come_out_and_a_replay_of_the_record_gives_the_same_bits(
    tmp_path: Path,
) -> None:
    config = demo_config(tmp_path, service="history_interval_s = 1")
    first, second = config.read_text(encoding="utf-8").rsplit("[robot.axis.detector]\n", 1)
    own = f'[robot.axis.detector]\nalarm_source = "{DETECTORS[1]}"\n'
    config.write_text(first + own + second, encoding="utf-8")
    record = tmp_path / "frames.log"
    words = ("--fault", "fm=1.6", "--fault-axis", "axis2", "--fault-after", "4")
    with daemon(config, "--record", record) as d:
        assert d.status("readyz") == 503
        with robot(config, *words) as process:
            wait_for(lambda: d.status("readyz") == 200)
            alarm = wait_for(lambda: next((a for a in alarms(d).values() if a["stage"] == "named"), None))
            assert (alarm["axis"], alarm["parameter"], alarm["direction"]) == ("demo.axis2", "fm", "up")
            wait_for(lambda: d.axis()["counters"]["used"] > 700)
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
        last = wait_until_silent(d)
        assert {p["name"]: p["status"] for p in last[1]["parameters"]}["fm"] == "alarm"
        assert alarm_sources(last) == DETECTORS
        metrics = d.text("metrics")
        standing = sorted(a["raised"] for a in alarms(d).values() if a["active"])
        assert wait_for(lambda: d.get("api/v1/axes/demo.axis1/history")["time"])
        assert d.stop() == 0
    for value in (
        'alarm_active{axis="demo.axis2",direction="up",parameter="fm"} 1.0',
        'alarm_active{axis="demo.axis2",direction="up",parameter="torque sign"} 0.0',
        'detector_alarms{axis="demo.axis1",detector="cusum"} 1.0',
        'detector_alarms{axis="demo.axis2",detector="multimodel"} 1.0',
    ):
        assert f"axiswatch_{value}" in metrics
    assert alarm["onset_low"] <= alarm["onset"] <= alarm["onset_high"]
    assert 0.01 < alarm["size"] < 0.06

    out, page = tmp_path / "replay.json", tmp_path / "replay.html"
    result = axiswatch("replay", "--config", config, record, "--json", out, "--report", page)
    assert result.exit_code == 0, result.output
    assert "fm" in page.read_text(encoding="utf-8")
    replayed = json.loads(out.read_text(encoding="utf-8"))["axes"]
    assert alarm_sources(replayed) == DETECTORS
    for found, shown, monitor in zip(replayed, last, saved(config).values(), strict=True):
        status = monitor.status()
        assert found["samples"] == shown["samples"] == status.samples
        assert found["last_sample"] == shown["last_sample"]
        for p, rest, kept in zip(found["parameters"], shown["parameters"], status.parameters, strict=True):
            for name in ("estimate", "standard_deviation", "p_diagonal"):
                assert p[name] == rest[name] == getattr(kept, name)
    assert [a["parameter"] for a in replayed[1]["alarms"]][:1] == ["fm"]
    assert replayed[1]["alarms"][0]["raised"] == alarm["raised"]
    they_outlive_damaged_files(config, standing)


def they_outlive_damaged_files(config: Path, standing: list[str]) -> None:
    """Alarms, by the times at which they were raised: checkpoints and journal both know them."""
    state = config.parent / "state"
    (state / "alarms.sqlite").write_bytes(b"no database" * 1000)
    with daemon(config) as d:
        (message,) = daemon_messages(d)
        assert "alarms.sqlite is damaged" in message
        assert sorted(a["raised"] for a in alarms(d).values()) == standing
        assert d.axis(2)["parameters"][2]["status"] == "alarm"
        assert d.stop() == 0
    assert len(list(state.glob("alarms.sqlite.damaged-*"))) >= 1

    (state / "checkpoints.sqlite").write_bytes(b"no database" * 1000)
    with daemon(config) as d:
        (message,) = daemon_messages(d)
        assert "checkpoints.sqlite is damaged" in message
        axis = d.axis(2)
        assert (axis["samples"], axis["parameters"][2]["status"]) == (0, "alarm")
        assert d.stop() == 0


def daemon_messages(d: Daemon) -> list[str]:
    """The messages of the daemon, except that the kernel is not ready yet."""
    messages: list[str] = d.get("api/v1/service")["messages"]
    return [message for message in messages if "kernel is being compiled" not in message]


def alarm_sources(axes: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    return tuple(x["name"] for axis in axes for x in axis["detectors"] if x["alarms"])


def wait_until_silent(d: Daemon) -> list[dict[str, Any]]:
    """The axes when all that was sent has been processed."""
    counts = [-1]

    def settled() -> list[dict[str, Any]] | None:
        axes: list[dict[str, Any]] = d.get("api/v1/axes")["axes"]
        before, now = counts[-1], sum(a["samples"] for a in axes)
        counts.append(now)
        time.sleep(0.5)
        return axes if before == now else None

    return wait_for(settled)


def test_kill_9_at_any_moment_loses_no_shown_alarm_and_at_most_an_interval_of_estimation(
    tmp_path: Path, seed: int
) -> None:
    assert killed(tmp_path, seed, kills=2, fault_after_s=5, while_starting=False)


def killed(
    folder: Path, seed: int, *, kills: int, fault_after_s: int, while_starting: bool
) -> dict[int, dict[str, Any]]:
    """The alarms shown last.  All shown before are still there each time, and of the estimation an interval is lost.

    Each daemon waits for an alarm and a checkpoint; or it is killed at any moment, and another one while it starts.
    Meanwhile an operator acknowledges alarms and comments on them.
    """
    config, chance = demo_config(folder, service=FAST_CHECKPOINTS), random.Random(seed)
    shown, samples, operator = dict[int, dict[str, Any]](), 0, Operator()
    with robot(config, "--fault", "fm=1.6", "--fault-after", str(fault_after_s)):
        for _ in range(kills):
            if while_starting:
                with running("run", "--config", config, "--port", "0", log=folder / "start.log"):
                    time.sleep(chance.uniform(0, 1.5))
            with daemon(config) as d:
                now, first = alarms(d), d.axis()
                assert {k: still(shown[k]) for k in shown} == {k: still(now[k]) for k in shown}
                assert list(overlaps(now.values())) == []
                operator.check(d)
                assert first["samples"] >= samples - 3 * INTERVAL_S * RATE_HZ
                if any(alarm["active"] and alarm["axis"] == first["id"] for alarm in now.values()):
                    assert "alarm" in {p["status"] for p in first["parameters"]}
                if not while_starting:
                    wait_for(lambda d=d: alarms(d) and d.get("api/v1/service")["checkpoint"])  # type: ignore[misc]
                with operator.working(d):
                    time.sleep(chance.uniform(0, 2.5))
                    samples, shown = d.axis()["samples"], alarms(d)
                    d.process.kill()
                assert d.process.wait() == -signal.SIGKILL
    assert samples > kills * RATE_HZ / 2
    assert operator.answered
    return shown


class Operator:
    """Acknowledges the alarms of a daemon and comments on them, until it is killed; knows what was answered."""

    def __init__(self) -> None:
        self.answered: list[tuple[int, str]] = []
        """Alarm and comment of each write that the daemon has answered"""

    @contextmanager
    def working(self, d: Daemon) -> Iterator[None]:
        """It works until the end of the block, in which the daemon is killed."""
        thread = threading.Thread(target=self._work, args=(d.page + "api/v1/alarms",))
        thread.start()
        try:
            yield
        finally:
            thread.join(60)
            assert not thread.is_alive()

    def check(self, d: Daemon) -> None:
        """All that was answered is in the journal."""
        found = {(k, t["comment"]) for k in alarms(d) for t in d.get(f"api/v1/alarms/{k}")["transitions"]}
        assert set(self.answered) <= found

    def _work(self, url: str) -> None:
        with suppress(httpx.TransportError), httpx.Client() as client:
            while True:
                for alarm in client.get(url).json()["alarms"]:
                    comment = f"number {len(self.answered)}"
                    todo = "acknowledge" if alarm["state"] in ("unacknowledged", "returned") else "comment"
                    done = client.post(f"{url}/{alarm['id']}/{todo}", json={"comment": comment})
                    if done.status_code == 200:
                        self.answered.append((alarm["id"], comment))
                    else:  # it was raised again, or has ended, in the meantime
                        assert done.status_code == 409, done.text
                time.sleep(0.02)


def overlaps(found: Iterable[dict[str, Any]]) -> Iterator[tuple[int, int]]:
    """The ids of alarms of one axis, parameter and direction of which one begins before the other has ended."""
    last: dict[tuple[str, str, str, bool], dict[str, Any]] = {}
    for alarm in sorted(found, key=lambda a: (a["raised"], a["id"])):
        name = alarm["axis"], alarm["parameter"], alarm["direction"], alarm["kind"] == "forecast"
        if (before := last.get(name)) and (before["ended"] is None or before["ended"] > alarm["raised"]):
            yield before["id"], alarm["id"]
        last[name] = alarm


def still(alarm: dict[str, Any]) -> tuple[Any, ...]:
    """What never changes of an alarm; it may get another name, and with it another onset."""
    first = [*alarm["past"], alarm][0]
    return alarm["axis"], alarm["raised"], first["parameter"], first["direction"]
