"""A torque that acts late: watched by the configuration's word, named as what it is, all the way to the user."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.config import ConfigErrors, load
from service.config.drives import axis_model
from service.simulation.robot import SimulatedFault
from tests.service.axis_with_columns import WATCHED, replayed, written
from tests.service.robot_tables import write_table

pytestmark = pytest.mark.usefixtures("without_pictures")

H, FAULT_S, END_S = 0.005, 14.0, 24.0
INERTIAS = 'monitor = ["1/Jm", "1/Ja", "fm", "delay"]'


def record(folder: Path, config: Path, seed: int, late_s: float) -> Path:
    """A record in which the torque acts that late from FAULT_S on."""
    faults = [SimulatedFault("demo.axis1", {"delay": late_s}, FAULT_S)]
    return write_table(folder / "late.csv", config, seed, faults, END_S)


def alarms(file: Path, late: Path) -> list[dict[str, Any]]:
    (axis,) = json.loads(replayed(file, str(late), "--json", "-"))["axes"]
    found: list[dict[str, Any]] = axis["alarms"]
    return found


@pytest.mark.parametrize("monitor", [WATCHED, INERTIAS], ids=["kT", "Jm"])
def test_a_torque_half_a_millisecond_late_is_named_and_is_no_inertia(monitor: str, tmp_path: Path, seed: int) -> None:
    file = written(tmp_path, monitor=monitor)
    late = record(tmp_path, file, seed, 0.0005)
    (alarm,) = alarms(file, late)
    assert (alarm["parameter"], alarm["direction"], alarm["ended"]) == ("delay", "up", None)
    assert alarm["size"] == pytest.approx(0.0005, rel=0.25)  # over 60 records its standard deviation is 2 %
    # Where no single cause explains all, that is said first.
    assert alarm["words"].rpartition("nearest is delay: ")[2].startswith("the torque frame is 0.")
    assert " ms late: the torque acts that much after its sample" in alarm["words"]
    assert alarm["raised"] >= "2025-10-09T08:53:34"  # START_S + FAULT_S


def test_nominal_value_scale_and_bounds(tmp_path: Path) -> None:
    plain = axis_model(load(written(tmp_path), {}).axes[0].config)
    assert (plain.nominal["delay"], plain.scale[3]) == (0.0, H / 2)
    np.testing.assert_array_equal(plain.limits[:, 3], [-H, H])
    late = ("sample_interval_s = 0.005", "sample_interval_s = 0.005\ntorque_delay_s = 0.001")
    assert axis_model(load(written(tmp_path, late), {}).axes[0].config).theta0[3] == 0.001
    own = (WATCHED, f"{WATCHED}\nscales = {{ delay = 0.001 }}\nbounds = {{ delay = [-0.002, 0.003] }}")
    given = axis_model(load(written(tmp_path, own), {}).axes[0].config)
    assert given.scale[3] == 0.001
    np.testing.assert_array_equal(given.limits[:, 3], [-0.002, 0.003])


def test_a_drive_with_such_a_parameter_of_its_own(tmp_path: Path) -> None:
    own = Path(__file__).resolve().parents[4] / "config" / "drives" / "three_mass.mo"
    text = own.read_text(encoding="utf-8").replace("fm", "delay")
    (tmp_path / "own.mo").write_text(text, encoding="utf-8")
    file = written(tmp_path, ('drive = "three-mass"', 'drive = "own.mo"'))
    with pytest.raises(ConfigErrors) as caught:
        load(file, {})
    assert "the drive has a parameter of that name: rename that one" in str(caught.value.problems)
