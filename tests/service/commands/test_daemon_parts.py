"""The daemon as a whole, inside this process."""

import subprocess
import sys
import threading
from collections.abc import Collection
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

import httpx
import pytest
import structlog

from service.commands.daemon.daemon_parts import DaemonParts, needs_cyclic_clock
from service.config import load
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.kernel_cache import CacheFiller, KernelShape
from service.pipeline.persistence.history_recording import HistoryState
from service.pipeline.worker import Worker
from service.store.alarm_entries import AlarmEntry
from service.store.journal import Journal
from tests.conftest import ROOT
from tests.end_to_end.processes import PATIENCE_S, demo_config, edit
from tests.service.daemon_thread import daemon_thread
from tests.service.pipeline.robots import changed, demo
from tests.service.web.conftest import FM_ALARM


def test_the_kernel_of_the_estimates_is_compiled_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The multi-model detector may come later; both begin once the page is served and the buses are read."""
    fill, compiled, order = CacheFiller.fill, AxisMonitors.compile, list[str]()
    served, last = threading.Event(), threading.Event()

    def slowly(self: CacheFiller, shapes: Collection[KernelShape]) -> bool:
        if KernelShape.MULTIMODEL in shapes:
            order.append("multi-model detector")
            last.set()
        else:
            assert served.wait(PATIENCE_S)
            order.append("estimates")
        return fill(self, shapes)

    def recorded(self: AxisMonitors) -> None:
        compiled(self)
        order.append("compiled")

    monkeypatch.setattr(CacheFiller, "fill", slowly)
    monkeypatch.setattr(AxisMonitors, "compile", recorded)
    with daemon_thread(demo(tmp_path, 1)):
        served.set()
        assert last.wait(PATIENCE_S)
    assert order == ["estimates", "compiled", "multi-model detector"]


def test_the_option_lets_other_machines_in_which_is_logged_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A daemon in a test before may have bound the logger to settings that are no longer in force.
    monkeypatch.setattr("service.commands.daemon.lifecycle.log", structlog.get_logger())
    config = demo(tmp_path, 1)
    config = config.model_copy(update={"web": config.web.model_copy(update={"host": "0.0.0.0"})})
    with structlog.testing.capture_logs() as logs, daemon_thread(config, insecure=True) as page:
        assert httpx.get(f"{page}healthz", timeout=PATIENCE_S).json()["insecure"] is True
        danger = httpx.get(f"{page}api/v1/service", timeout=PATIENCE_S).json()["insecure"]
    assert "may read and operate, without a token" in danger
    assert [(e["log_level"], e["message"]) for e in logs if e["event"] == "access"] == [("warning", danger)]


def test_an_alarm_whose_frames_are_there_can_have_its_report(tmp_path: Path) -> None:
    with closing(Journal(tmp_path / "alarms.sqlite")) as journal:
        ended = replace(FM_ALARM, ended_us=FM_ALARM.updated_us)
        (number,) = journal.record([AlarmEntry("demo.axis1", "N m s/rad", 0.06, ended)])
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "frames-20260301T115900Z-20260301T120000Z.log").touch()
    with daemon_thread(demo(tmp_path, 1)) as page:
        alarm = httpx.get(f"{page}api/v1/alarms/{number}", timeout=PATIENCE_S).json()
    assert alarm["report"]["state"] == "none"


def test_the_parts_of_a_daemon_know_the_groups_and_why_files_are_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = changed(demo(tmp_path, 2), only="axis1", alarms={"group": "line"})
    with ExitStack() as stack:
        parts = DaemonParts(config, None, threading.Event(), stack)
        parts.state.journal.record([AlarmEntry(axis.id, "N m s/rad", 0.06, FM_ALARM) for axis in config.axes])
        assert [alarm.follows for alarm in parts.state.journal.standing()] == [None, None]
        assert set(parts.problems().values()) == {None}
        full = replace(parts.worker.snapshot, history=HistoryState(problem="no space"))
        monkeypatch.setattr(Worker, "snapshot", full)
        assert parts.problems() == {
            "alarms.sqlite": None, "checkpoints.sqlite": None, "history.sqlite": "no space"
        }  # fmt: skip


def test_the_cyclic_clock_is_compiled_where_an_axis_has_one(tmp_path: Path) -> None:
    file = demo_config(tmp_path, axes=2)
    assert not needs_cyclic_clock(load(file, {}))
    edit(file, ('counter_message = "Axis2State"\ncounter_signal = "Counter"', 'clock = "cyclic"'))
    assert needs_cyclic_clock(load(file, {}))


STARTS = [
    (
        "import service.commands.run, service.commands.demo, service.commands.daemon.lifecycle, service.web.app",
        "scipy.stats scipy.optimize scipy.signal sympy matplotlib pymoca pyarrow scipy.io aiomqtt paho smtplib httpx"
        " asyncua",
    ),
    (
        "from importlib import import_module; from service.commands.main import COMMANDS;"
        "[import_module(f'service.commands.{name}') for name in COMMANDS]",
        "scipy.stats scipy.signal scipy.optimize sympy matplotlib",
    ),
    (
        "from service.config import load; from service.config.drive_sources import shipped;"
        "from service.pipeline.axes.axis_monitors import AxisMonitors;"
        "AxisMonitors(load(shipped('demo/axiswatch.toml'), {}).axes)",
        "sympy pymoca antlr4",
    ),
]


@pytest.mark.parametrize(("program", "slow"), STARTS, ids=["daemon", "help", "drive of the library"])
def test_a_start_does_not_wait_for_what_is_never_used(program: str, slow: str) -> None:
    """They take longer to import than all the rest."""
    command = [sys.executable, "-c", f"{program}; import sys; print(*sys.modules, sep='\\n')"]
    modules = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert set(slow.split()) & set(modules.splitlines()) == set()
