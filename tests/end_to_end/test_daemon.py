"""The daemon from outside: frames on a real bus between processes in, answers and files out."""

from __future__ import annotations

import json
import random
import signal
import time
from pathlib import Path
from typing import Any

from monitor_core.monitoring import AxisMonitor
from service.config import load
from service.pipeline.axis_monitors import AxisMonitors
from service.store.checkpoints import Checkpoint, Checkpoints
from tests.end_to_end.processes import Daemon, daemon, demo_config, run_program, running, wait_for

INTERVAL_S = 1.0
FAST_CHECKPOINTS = f"checkpoint_interval_s = {INTERVAL_S}\nhistory_interval_s = 0.5"


def axis(daemon: Daemon, number: int = 1) -> dict[str, Any]:
    found: dict[str, Any] = daemon.get(f"api/v1/axes/demo.axis{number}")
    return found


def parameters(answer: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {p["name"]: p for p in answer["parameters"]}


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


def test_estimates_alarm_and_metrics_come_out_and_a_replay_of_the_record_gives_the_same_bits(
    tmp_path: Path,
) -> None:
    config = demo_config(tmp_path)
    record = tmp_path / "frames.log"
    fault = ("--fault", "fm=1.5", "--fault-axis", "axis2", "--fault-after", "4")
    with daemon(config, "--record", record) as d:
        assert d.status("readyz") == 503
        with running("simulate", "--config", config, *fault, log=tmp_path / "robot.log") as robot:
            wait_for(lambda: d.status("readyz") == 200)
            alarm = wait_for(lambda: next(iter(alarms(d).values()), None))
            assert (alarm["axis"], alarm["parameter"], alarm["direction"]) == ("demo.axis2", "fm", "up")
            wait_for(lambda: axis(d)["counters"]["used"] > 1500)
            robot.send_signal(signal.SIGINT)
            assert robot.wait(20) == 0
        last = wait_until_silent(d)
        assert parameters(last[1])["fm"]["status"] == "alarm"
        with_metrics = d.text("metrics")
        assert d.get("api/v1/axes/demo.axis1/history")["time"]
        assert d.stop() == 0
    assert 'axiswatch_alarm_active{axis="demo.axis2",direction="up",parameter="fm"} 1.0' in with_metrics

    out = tmp_path / "replay.json"
    result = run_program("replay", "--config", config, record, "--json", out)
    assert result.returncode == 0, result.stderr
    replayed = json.loads(out.read_text(encoding="utf-8"))["axes"]
    for found, shown, monitor in zip(replayed, last, saved(config).values(), strict=True):
        status = monitor.status()
        assert found["samples"] == shown["samples"] == status.samples
        assert found["last_sample"] == shown["last_sample"]
        for p, rest, kept in zip(found["parameters"], shown["parameters"], status.parameters, strict=True):
            for name in ("estimate", "standard_deviation", "p_diagonal"):
                assert p[name] == rest[name] == getattr(kept, name)
    assert [a["parameter"] for a in replayed[1]["alarms"]][:1] == ["fm"]
    assert replayed[1]["alarms"][0]["raised"] == alarm["raised"]


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
    config = demo_config(tmp_path, service=FAST_CHECKPOINTS)
    chance = random.Random(seed)
    fault = ("--fault", "fm=1.6", "--fault-after", "5")
    shown: dict[int, dict[str, Any]] = {}
    samples_shown = 0
    with running("simulate", "--config", config, *fault, log=tmp_path / "robot.log"):
        for _ in range(3):
            with daemon(config) as d:
                first = axis(d)
                assert first["samples"] >= samples_shown - 3 * INTERVAL_S * 200
                now = alarms(d)
                assert {k: still(shown[k]) for k in shown} == {k: still(now[k]) for k in shown}
                if any(a["active"] and a["parameter"] == "fm" for a in now.values()):
                    assert parameters(first)["fm"]["status"] == "alarm"
                wait_for(lambda: alarms(d) and d.get("api/v1/service")["checkpoint"])
                time.sleep(chance.uniform(0, 2.5))
                samples_shown = axis(d)["samples"]
                shown = alarms(d)
                d.process.kill()
                assert d.process.wait() == -signal.SIGKILL
    assert len(shown) >= 1


def still(alarm: dict[str, Any]) -> tuple[Any, ...]:
    """What never changes of an alarm; it may get another name, and with it another onset."""
    first = [*alarm["past"], alarm][0]
    return alarm["axis"], alarm["raised"], first["parameter"], first["direction"]
