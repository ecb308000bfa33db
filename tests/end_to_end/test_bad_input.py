"""What a daemon makes of values and files that are not as they should be."""

import json
import math
import socket
import struct
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from service.can.bus import open_bus, send
from service.can.frames import FrameKey
from service.config import load
from tests.end_to_end.processes import Daemon, daemon, demo_config, edit, robot, wait_for

FLOATS = """VERSION ""

NS_ :

BS_:

BU_: Controller

BO_ 385 Axis1State: 8 Controller
 SG_ Torque : 0|32@1- (1,0) [0|0] "N m" Controller
 SG_ Angle : 32|32@1- (1,0) [0|0] "rad" Controller

SIG_VALTYPE_ 385 Torque : 1;
SIG_VALTYPE_ 385 Angle : 1;
"""
KEY = FrameKey(385, False)


def test_values_that_are_none_and_frames_that_are_short_are_counted_and_change_nothing(
    tmp_path: Path,
) -> None:
    counter = ('counter_message = "Axis1State"\ncounter_signal = "Counter"\n', "")
    config = edit(demo_config(tmp_path, axes=1), counter)
    (tmp_path / "demo.dbc").write_text(FLOATS, encoding="utf-8")
    with daemon(config) as d:
        bus = open_bus(load(config, {}).bus[0])
        for k in range(20):  # a good sample first and last
            time.sleep(0.005)
            torque, angle = (math.nan, math.inf)[k % 2], 0.0
            send(bus, KEY, struct.pack("<ff", torque if 5 <= k < 15 else 0.0, angle))
            if k == 10:
                send(bus, KEY, b"\0\0\0")
        axis = wait_for(lambda: _with(d, 1))
        bus.shutdown()
        assert axis["dropped"]["not_finite"] == 20  # torque and angle of ten frames
        assert [p["estimate"] for p in axis["parameters"]] == [p["nominal"] for p in axis["parameters"]]
        assert d.get("api/v1/service")["buses"][0]["dropped"]["too_short"] == 1
        assert 'axiswatch_frames_dropped_total{bus="can0",reason="too_short"} 1.0' in d.text("metrics")
        assert 'axiswatch_values_dropped_total{axis="demo.axis1",reason="not_finite"} 20.0' in d.text(
            "metrics"
        )
        stops_in_order_with_an_open_connection(d)


def _with(d: Daemon, samples: int) -> dict[str, Any] | None:
    """The axis, once it has some good samples and all of the bad values."""
    axis = d.axis()
    return axis if axis["samples"] >= samples and axis["dropped"]["not_finite"] >= 20 else None


def stops_in_order_with_an_open_connection(d: Daemon) -> None:
    address = urlsplit(d.page)
    with socket.create_connection((str(address.hostname), int(address.port or 0))) as connection:
        connection.sendall(b"GET /api/v1/axes HTTP/1.1\r\nHost: here\r\n")  # and no end of the head
        assert d.stop() == 0
    assert [json.dumps(e) for e in d.events() if e["level"] in ("error", "critical")] == []
    assert d.events()[-1]["event"] == "stopped"


def daemon_messages(d: Daemon) -> list[str]:
    """The messages of the daemon, except that the kernel is not ready yet."""
    messages: list[str] = d.get("api/v1/service")["messages"]
    return [message for message in messages if "kernel is being compiled" not in message]


def test_damaged_files_are_said_and_kept_and_an_alarm_is_not_lost_with_the_journal(tmp_path: Path) -> None:
    config = demo_config(tmp_path, axes=1)
    state = tmp_path / "state"
    fault = ("--fault", "fm=1.6", "--fault-after", "2.5")
    with daemon(config) as d:
        with robot(config, *fault):
            wait_for(lambda: d.get("api/v1/alarms")["total"])
        raised = d.get("api/v1/alarms")["alarms"][0]["raised"]
        assert d.stop() == 0

    (state / "alarms.sqlite").write_bytes(b"no database" * 1000)
    with daemon(config) as d:  # the checkpoint still knows the alarm
        (message,) = daemon_messages(d)
        assert "alarms.sqlite is damaged" in message
        assert [a["raised"] for a in d.get("api/v1/alarms")["alarms"]] == [raised]
        assert d.axis()["parameters"][2]["status"] == "alarm"
        assert d.stop() == 0
    assert len(list(state.glob("alarms.sqlite.damaged-*"))) >= 1

    (state / "checkpoints.sqlite").write_bytes(b"no database" * 1000)
    with daemon(config) as d:  # the journal still knows the alarm
        (message,) = daemon_messages(d)
        assert "checkpoints.sqlite is damaged" in message
        axis = d.axis()
        assert (axis["samples"], axis["parameters"][2]["status"]) == (0, "alarm")
        assert d.stop() == 0
