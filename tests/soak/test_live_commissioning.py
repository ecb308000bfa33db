"""From a real SocketCAN device to a running daemon: ``init``, ``commission`` and ``run``, nothing edited.

tools/with-vcan.sh .venv/bin/python -m pytest -s -m "soak and vcan" tests/soak
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from service.commands import commission
from service.config import load
from tests.end_to_end.processes import daemon, edit, wait_for
from tests.service.command_line import axiswatch
from tests.service.commands.commissioning.two_mass_tables import FEW
from tests.service.commands.live_robots import configured, moving
from tests.service.commands.moving_axes import VALUES, moves

pytestmark = [pytest.mark.soak, pytest.mark.vcan]

DRIVE = "one-mass"
SLOW_S = 600.0
"""A virtual kernel is."""
DBC = """VERSION ""

NS_ :

BS_:

BU_: Controller Monitor

BO_ 385 Joint1: 8 Controller
 SG_ Joint1_Torque_Act : 0|24@1- (1E-005,0) [-83|83] "Nm" Monitor
 SG_ Joint1_Pos_Act : 24|32@1- (1E-006,0) [-2147|2147] "rad" Monitor
 SG_ Joint1_Counter : 56|8@1+ (1,0) [0|255] "" Monitor
"""
"""With a sample counter: frames wait for the one processor of a virtual kernel."""


@contextmanager
def timed(what: str) -> Iterator[None]:
    began = time.monotonic()
    yield
    print(f"{what}: {time.monotonic() - began:.0f} s")


def test_from_a_device_to_a_running_daemon(tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """One axis, recorded for half a minute."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(commission, "options_for", lambda _budget_s: FEW)
    found = moves(DRIVE, seed, 150.0)
    rows = tmp_path / "rows.csv"
    np.savetxt(rows, np.column_stack(found[:3]), "%.10g", ",", header="t,u,y", comments="")
    file, made = tmp_path / "robot.dbc", tmp_path / "commissioned" / "axiswatch.toml"
    file.write_text(DBC, encoding="utf-8")
    robot = edit(
        configured(tmp_path / "robot.toml", file, 1, "vcan0"),
        ('name = "a1"', 'name = "a1"\ntime = { counter_signal = "Joint1_Counter" }'),
    )
    with moving(rows, robot):
        with timed("init"):
            done = axiswatch("init", file, "--bus", "socketcan:vcan0", "--seconds", 5)
        assert done.exit_code == 0, done.output
        words = ("--config", "axis.toml", "--minutes", 0.55, "--budget", "2min", "--yes")
        with timed("commission"):
            done = axiswatch("commission", *words)
    print(done.output)
    assert done.exit_code == 0, done.output
    (axis,) = load(made).axes
    assert {"kT", "fc"} <= set(axis.config.model.monitor)
    nominal = axis.config.model.nominal_file
    assert nominal is not None
    assert nominal.values["J"] == pytest.approx(VALUES[DRIVE]["J"], rel=0.1)
    assert nominal.values["fc"] == pytest.approx(VALUES[DRIVE]["fc"], rel=0.2)
    with moving(rows, robot), timed("run"), daemon(made) as d:
        wait_for(lambda: d.get(f"api/v1/axes/{axis.id}")["counters"]["used"] > 200, patience_s=SLOW_S)
        assert d.get("api/v1/alarms")["alarms"] == []
        assert d.stop() == 0
