"""``axiswatch init`` on the real records: the columns of torque and motion, though most have no names."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.config import load
from tests.service.command_line import shown
from tests.shares import soaked

pytestmark = pytest.mark.records

BLOCKS = [(str(12 + joint), str(joint)) for joint in range(1, 7)]
"""Measured currents and angles of the UR10e, beside speeds, wanted currents and wanted torques."""


RECORDS = {
    "irb/robot_arm.mat": [("torque", "speed")],
    "emps/DATA_EMPS.mat": [("vir", "qm")],
    "ur10e/ur-20_01_22-joint_1.csv": BLOCKS[:1],
    "ur10e/ur-20_01_22-joint_2.csv": BLOCKS[1:2],
    "ur10e/ur-20_02_19_14harm50sec.csv": BLOCKS,
    "ur10e/ur-19_09_27-11_32_02.csv": BLOCKS,
}


@pytest.mark.parametrize(
    "record", soaked(RECORDS, "irb/robot_arm.mat", "emps/DATA_EMPS.mat", "ur10e/ur-20_01_22-joint_2.csv")
)
def test_columns(record: str, records_dir: Path, tmp_path: Path) -> None:
    shown("init", records_dir / record, "-o", tmp_path / "axis.toml")
    axes = load(tmp_path / "axis.toml", {}).axes
    assert [(a.config.torque.column, a.config.motion.column) for a in axes] == RECORDS[record]
