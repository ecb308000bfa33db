"""The daemon as a process where the machine, or the program itself, is at fault."""

import json
import resource
import subprocess
import sys
from pathlib import Path

from tests.end_to_end.processes import ROOT, Daemon, daemon, demo_config, robot, wait_for

UNRECORDED = "cannot be recorded yet, is tried again"
UNSAVED = "the state of the monitors cannot be saved"

BROKEN = """
from service.commands.main import main
from service.pipeline.axis_monitors import FramePipeline

def update(_):
    raise ZeroDivisionError("division by a fault")

FramePipeline.update = update
main()
"""


def test_an_alarm_waits_for_a_full_disk_and_is_recorded_once_there_is_space(tmp_path: Path) -> None:
    config = demo_config(tmp_path, axes=1, service="checkpoint_interval_s = 1.0")
    with daemon(config) as d:
        limit_files(d, 1)
        fault = ("--fault", "fm=1.6", "--fault-after", "2")
        with robot(config, *fault):
            wait_for(lambda: any(UNRECORDED in message and " fm up" in message for message in messages(d)))
            wait_for(lambda: any(UNSAVED in message for message in messages(d)))
            before = d.axis()["last_sample"]
            waiting = d.get("api/v1/alarms?parameter=fm")["alarms"]
            assert [(alarm["id"], alarm["recorded"]) for alarm in waiting] == [(None, False)], "shown at once"
            assert "alarm" in [p["status"] for p in d.axis()["parameters"]]
            assert (d.status("healthz"), d.status("readyz")) == (200, 503)
            limit_files(d, resource.RLIM_INFINITY)
            wait_for(lambda: all(a["recorded"] for a in d.get("api/v1/alarms?parameter=fm")["alarms"]))
            wait_for(lambda: not messages(d))
        alarms = d.get("api/v1/alarms?parameter=fm")["alarms"]
        assert min(alarm["raised"] for alarm in alarms) <= before
        assert len({(alarm["direction"], alarm["raised"]) for alarm in alarms}) == len(alarms), (
            "recorded once"
        )
        assert d.get("api/v1/service")["checkpoint"] is not None
        assert d.stop() == 0


def limit_files(d: Daemon, octets: int) -> None:
    """No file of the daemon may be written beyond that size: its disk is full."""
    _, most = resource.prlimit(d.process.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(d.process.pid, resource.RLIMIT_FSIZE, (most if octets < 0 else octets, most))


def messages(d: Daemon) -> list[str]:
    found: list[str] = d.get("api/v1/service")["messages"]
    return found


def test_a_fault_of_the_program_ends_the_process_with_1_and_a_clear_log(tmp_path: Path) -> None:
    config = demo_config(tmp_path, axes=1)
    command = [sys.executable, "-c", BROKEN, "run", "--config", str(config), "--port", "0"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    *log, last = done.stderr.splitlines()
    assert last == "axiswatch: a fault in the worker has stopped the daemon; the log says what"
    (failure,) = [event for event in map(json.loads, log) if event["level"] == "critical"]
    assert failure["event"] == "the worker has failed; the daemon stops"
    (exception,) = failure["exception"]
    assert (exception["exc_type"], exception["exc_value"]) == ("ZeroDivisionError", "division by a fault")
    assert exception["frames"][-1]["name"] == "update"
