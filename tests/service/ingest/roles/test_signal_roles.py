"""Which signals of a bus are of which axis, by their names alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monitor_core.arrays import Floats
from service.can.message_files import read_messages
from service.ingest.roles.column_roles import roles
from service.ingest.roles.signal_roles import axes_in


def drive(ident: int, axis: str, pdo: str = "TPDO", what: str = "Torque", unit: str = "%") -> str:
    """Torque and position of a drive in two messages."""
    return (
        f"BO_ {ident} {axis}_{pdo}1: 4 Drive\n"
        f' SG_ {axis}_{what}Actual : 0|16@1- (0.1,0) [-300|300] "{unit}" Master\n'
        f"BO_ {ident + 256} {axis}_{pdo}2: 4 Drive\n"
        f' SG_ {axis}_PositionActual : 0|32@1- (0.001,0) [0|0] "mm" Master\n'
    )


HEAD = 'VERSION ""\nBU_: Drive Master\n'


@pytest.mark.parametrize(
    ("named", "axes"),
    [
        (["X", "Y", "Z"], ["axisX", "axisY", "axisZ"]),
        (["Carriage", "Hoist"], ["carriage", "hoist"]),
        (["Drive2", "Drive1"], ["axis1", "axis2"]),
        (["Main"], ["axis"]),
    ],
)
def test_torque_and_motion_of_one_drive_belong_together(named: list[str], axes: list[str], tmp_path: Path) -> None:
    """Whatever the drives are called: the number of a PDO is none of an axis."""
    path = tmp_path / "plant.dbc"
    path.write_text(HEAD + "".join(drive(0x181 + k, name) for k, name in enumerate(named)), encoding="utf-8")
    found = axes_in(read_messages(path).messages)
    assert [axis.name for axis in found] == axes
    for axis in found:
        assert axis.torque.signal.split("_")[0] == axis.motion.signal.split("_")[0]


@pytest.mark.parametrize(("unit", "factor"), [("A", 1.0), ("mA", 1e-3), ("Arms", 1.0), ("V", None)])
def test_a_current_in_any_unit_is_the_torque(unit: str, factor: float | None, tmp_path: Path) -> None:
    """A voltage is none, whatever it is called."""
    path = tmp_path / "plant.dbc"
    path.write_text(HEAD + drive(0x181, "Drive1", what="Current", unit=unit), encoding="utf-8")
    found = axes_in(read_messages(path).messages)
    assert [(axis.torque.current, axis.torque.factor) for axis in found] == [(True, factor)] * (factor is not None)


def test_what_is_changed_every_few_minutes_may_be_carried() -> None:
    """The first minutes need not show it."""
    t: Floats = 0.008 * np.arange(60_000, dtype=np.float64)
    angle = np.sin(0.7 * t) + 0.3 * np.sin(1.9 * t)
    torque = np.gradient(np.gradient(angle, 0.008), 0.008) + np.tanh(np.gradient(angle, 0.008) / 0.05)
    part: Floats = np.floor(t / 112.0) % 2
    found = roles({"t": t, "Tilt torque": torque, "Tilt angle": angle, "Part": part, "Spare": np.zeros(t.size)})
    assert found.switches == ("Part",)
    assert found.unused == ("Spare",)
