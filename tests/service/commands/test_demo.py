"""``axiswatch demo``: commissioned as it comes, or before the user's eyes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.commands import commission
from service.commands.commissioning.axis import axis_processes
from service.config import Config, load
from service.config.drive_sources import shipped
from service.pipeline.axes.axis_monitors import FramePipeline
from service.simulation.robot import SimulatedFault, columns_of, table_lines
from tests.conftest import ROOT
from tests.service.command_line import axiswatch
from tests.service.commands.commissioned_demo import COMMISSIONED, as_shipped
from tests.service.commands.commissioning.two_mass_tables import FEW
from tests.service.pipeline.robots import START_US, blocks, demo, live

pytestmark = pytest.mark.usefixtures("without_pictures")


class Daemon:
    """In place of the daemon: what it would have run with."""

    def __init__(self) -> None:
        self.config: Config | None = None
        self.file: Path | None = None

    def run(self, config: Config, file: Path, record: Path | None = None, **words: Any) -> None:
        assert record is None
        assert not words.get("insecure")
        self.config, self.file = config, file
        if "stop" in words:  # as `demo` calls it
            words["events"].complete()
            words["events"].ready("http://127.0.0.1:1/")
            words["stop"].set()


@pytest.fixture
def daemon(monkeypatch: pytest.MonkeyPatch) -> Daemon:
    found = Daemon()
    monkeypatch.setattr("service.commands.daemon.lifecycle.run_daemon", found.run)
    return found


def signals(config: Config) -> list[tuple[Any, ...]]:
    """Where the samples of each axis come from."""
    rows = []
    for axis in config.axes:
        c = axis.config
        sources = [(s.message, s.signal, s.factor, s.offset) for s in (c.torque, c.motion)]
        rows.append((axis.id, c.sample_interval_s, c.time.counter_signal, *sources))
    return rows


# --- as it comes ------------------------------------------------------------------------------------------------------


def test_it_comes_commissioned(daemon: Daemon, monkeypatch: pytest.MonkeyPatch) -> None:
    """For this machine only, whatever the environment says: it has no tokens."""
    monkeypatch.setenv("AXISWATCH_WEB__HOST", "0.0.0.0")
    result = axiswatch("demo", "--axes", "2", "--port", "0")
    assert result.exit_code == 0, result.output
    assert daemon.config is not None
    assert daemon.file == COMMISSIONED
    assert (daemon.config.web.host, daemon.config.web.port) == ("127.0.0.1", 0)
    assert [axis.id for axis in daemon.config.axes] == ["demo.axis1", "demo.axis2"]
    assert all(axis.config.model.thresholds_file is not None for axis in daemon.config.axes)


def test_run_takes_it_as_it_is_and_serves_its_report(daemon: Daemon) -> None:
    result = axiswatch("run", "--config", COMMISSIONED)
    assert result.exit_code == 0, result.output
    assert daemon.config == load(COMMISSIONED, {})
    assert daemon.file == COMMISSIONED


def test_what_is_shipped_belongs_to_the_robot() -> None:
    """Same axes and signals, nominal values that are its own; thresholds of another monitor would be refused."""
    own, robot = load(COMMISSIONED, {}), load(shipped("demo.toml"), {})
    assert signals(own) == signals(robot)
    checked = axiswatch("check", "--config", COMMISSIONED)
    assert checked.exit_code == 0, checked.output
    status = FramePipeline(own).monitors.by_id
    for axis, true in zip(own.axes, robot.axes, strict=True):
        nominal, thresholds = axis.config.model.nominal_file, axis.config.model.thresholds_file
        assert nominal is not None
        assert thresholds is not None
        assert thresholds.hypothesis != ()
        truth = true.config.model.nominal
        for name in ("Jm", "fm", "fc", "tau0", "kT"):
            assert nominal.values[name] == pytest.approx(truth[name], rel=0.05), (axis.id, name)
        (alarms,) = [d.name for d in status[axis.id].status().detectors if d.alarms]
        assert alarms == "multimodel"


def test_the_command_that_made_what_is_shipped_is_documented() -> None:
    texts = [path.read_text(encoding="utf-8") for path in COMMISSIONED.parent.glob("demo.*.toml")]
    (command,) = {re.findall(r'^command = "(.*)"', text, re.M)[0] for text in texts}
    assert command.removesuffix(" --port 0") in (ROOT / "docs" / "development.md").read_text(encoding="utf-8")


# --- the whole way ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("identified", [False, pytest.param(True, marks=pytest.mark.soak)])
def test_the_whole_way_ends_in_a_monitor_that_names_the_fault(
    identified: bool, tmp_path: Path, seed: int, daemon: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the axis is identified: called again nothing is computed again."""
    monkeypatch.setattr(commission, "options_for", lambda _budget_s: FEW)
    if not identified:
        monkeypatch.setattr(axis_processes, "commission_axis", as_shipped)
    words = ("demo", "--commission", "--axes", "1", "--minutes", "0.5", "--output", tmp_path / "made")
    result = axiswatch(*words)
    assert result.exit_code == 0, result.output
    finds = (
        "4 s, either way: kT from 30 %, 1/Ja from 30 %, fm from 30 %"
        if identified
        else "30 s, either way: kT from 10 %"
    )
    for step in (
        "1. Record",
        "2. Describe it",
        "3. Commission it",
        f"[1/1] demo.axis1: Found within {finds}.",
        "4. Add",
    ):
        assert step in result.stdout
    assert daemon.config is not None
    assert daemon.file == tmp_path / "made" / "axiswatch.toml"
    assert "1 of 1 axis ready." in (tmp_path / "made" / "report.html").read_text(encoding="utf-8")
    assert signals(daemon.config) == signals(demo(tmp_path, 1))

    fault = SimulatedFault("demo.axis1", {"fm": 1.3}, 12.0)
    found = live(FramePipeline(daemon.config), blocks(demo(tmp_path, 1), 20.0, seed, [fault]))
    assert {(c.alarm.parameter, c.alarm.direction) for c in found if c.alarm.stage == "named"} == {("fm", "up")}
    assert min(c.alarm.raised_us for c in found) > START_US + 12e6

    if identified:
        assert re.findall(r"^demo.axis1: (\w+) \.\.\.$", result.stderr, re.M) == ["identify", "calibrate"]
        made = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "made").glob("demo.*")}
        assert axiswatch(*words).exit_code == 0
        assert {path.name: path.stat().st_mtime_ns for path in (tmp_path / "made").glob("demo.*")} == made


def test_the_same_seed_gives_the_same_table(tmp_path: Path, seed: int) -> None:
    config = demo(tmp_path, 2)
    first, again, other = ("".join(table_lines(config, 2.0, s)) for s in (seed, seed, seed + 1))
    assert first == again != other
    assert columns_of(config) == ["t", "axis1_torque", "axis1_angle", "axis2_torque", "axis2_angle"]
    values = np.array([line.split(",") for line in first.splitlines()[1:]], float)
    assert values.shape == (400, 5)
    assert np.diff(values[:, 0]) == pytest.approx(0.005)
    assert np.all(np.ptp(values[:, 1:], axis=0) > 0.1)
