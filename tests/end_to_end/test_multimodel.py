"""The multi-model detector in the daemon, from outside: named, on the page's API and in the metrics, over a restart."""

import json
from pathlib import Path
from typing import Any

from tests.end_to_end.processes import Daemon, daemon, demo_config, robot, run_program, wait_for


def bank_config(folder: Path) -> Path:
    """One axis of the demo, whose alarms are those of the bank."""
    config = demo_config(folder, axes=1, service="checkpoint_interval_s = 1.0")
    text = config.read_text(encoding="utf-8")
    assert text.count("[robot.axis.detector]\n") == 1
    config.write_text(
        text.replace("[robot.axis.detector]\n", '[robot.axis.detector]\nalarm_source = "multimodel"\n'),
        encoding="utf-8",
    )
    return config


def named(d: Daemon) -> dict[str, Any] | None:
    found = d.get("api/v1/alarms?active=true")["alarms"]
    return next((alarm for alarm in found if alarm["stage"] == "named"), None)


def test_friction_is_named_and_stays_one_alarm_over_a_restart(tmp_path: Path) -> None:
    config, record = bank_config(tmp_path), tmp_path / "frames.log"
    fault = ("--fault", "fm=1.6", "--fault-after", "4")
    with robot(config, *fault):
        with daemon(config, "--record", record) as d:
            alarm = wait_for(lambda: named(d))
            assert (alarm["parameter"], alarm["direction"]) == ("fm", "up")
            assert alarm["onset_low"] <= alarm["onset"] <= alarm["onset_high"]
            assert 0.01 < alarm["size"] < 0.06
            (axis,) = d.get("api/v1/axes")["axes"]
            assert [(x["name"], x["alarms"]) for x in axis["detectors"]] == [
                ("cusum", False),
                ("multimodel", True),
            ]
            metrics = d.text("metrics")
            assert d.stop() == 0
        for line in (
            'axiswatch_alarm_active{axis="demo.axis1",direction="up",parameter="fm"} 1.0',
            'axiswatch_alarm_active{axis="demo.axis1",direction="up",parameter="torque sign"} 0.0',
            'axiswatch_detector_alarms{axis="demo.axis1",detector="multimodel"} 1.0',
        ):
            assert line in metrics
        with daemon(config) as d:
            before = d.axis()["samples"]
            wait_for(lambda: d.axis()["samples"] > before + 600)
            assert d.get("api/v1/service")["messages"] == []
            again = d.get("api/v1/alarms")
            assert d.stop() == 0
    assert [one["id"] for one in again["alarms"] if one["parameter"] == "fm"] == [alarm["id"]]
    out, page = tmp_path / "replay.json", tmp_path / "replay.html"
    result = run_program("replay", "--config", config, record, "--json", out, "--report", page)
    assert result.returncode == 0, result.stderr
    (replayed,) = json.loads(out.read_text(encoding="utf-8"))["axes"]
    assert replayed["alarms"][0]["raised"] == alarm["raised"]
    assert [d["name"] for d in replayed["detectors"] if d["alarms"]] == ["multimodel"]
    assert "fm" in page.read_text(encoding="utf-8")
