"""The record of the real robot axis."""

from __future__ import annotations

from pathlib import Path

import pytest

from monitor_core.samples import SampleBlock
from tests.real.irb import read


@pytest.fixture(scope="session")
def irb_path(records_dir: Path) -> Path:
    return records_dir / "irb" / "robot_arm.mat"


@pytest.fixture(scope="session")
def irb_record(irb_path: Path) -> SampleBlock:
    return read(irb_path)
