"""``axiswatch replay`` over tables and logs."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from service.commands.main import app
from service.simulation.robot import Fault
from tests.service.robot_tables import configured, write_table


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Path:
    """A configuration, and a table of twelve seconds in which the friction grows by half after six."""
    folder = tmp_path_factory.mktemp("replay")
    fault = Fault("demo.axis1", {"fm": 1.5}, 6.0)
    write_table(folder / "a.csv", configured(folder, "replay"), seed, [fault], 12)
    return folder


def replay(folder: Path, *arguments: str) -> str:
    result = CliRunner().invoke(app, ["replay", "--config", str(folder / "robot.toml"), *arguments])
    assert result.exit_code == 0, result.output
    return result.stdout


def as_json(folder: Path, *records: str) -> dict[str, Any]:
    files = [str(folder / record) for record in records]
    found: dict[str, Any] = json.loads(replay(folder, *files, "--json", "-"))
    return found


def test_estimates_and_the_alarm_as_json(folder: Path) -> None:
    (axis,) = as_json(folder, "a.csv")["axes"]
    assert (axis["id"], axis["samples"]) == ("demo.axis1", 2401)
    assert axis["last_sample"] == "2025-10-09T08:53:32.000000Z"
    assert [p["name"] for p in axis["parameters"]] == ["kT", "1/Ja", "fm"]
    fm = axis["parameters"][2]
    assert (fm["nominal"], fm["unit"], fm["status"]) == (0.06, "N m s/rad", "alarm")
    assert fm["estimate"] == pytest.approx(0.09, abs=6 * fm["standard_deviation"])
    assert fm["standard_deviation"] ** 2 == pytest.approx(
        fm["p_diagonal"]
        * axis["parameters"][0]["standard_deviation"] ** 2
        / axis["parameters"][0]["p_diagonal"]
    )
    alarm = axis["alarms"][0]
    assert (alarm["parameter"], alarm["direction"], alarm["ended"]) == ("fm", "up", None)
    assert (
        "2025-10-09T08:53:25" <= alarm["onset"] <= alarm["raised"] <= alarm["updated"] <= axis["last_sample"]
    )
    assert alarm["crossings"] >= 1
    assert sum(axis["counters"].values()) == 2401
    assert axis["dropped"]["missing"] == 0


def test_tables_for_people(folder: Path) -> None:
    shown = replay(folder, str(folder / "a.csv"))
    assert all(words in shown for words in ("demo.axis1", "Alarms", "fm"))


def test_the_same_record_twice_is_the_same_to_the_bit(folder: Path) -> None:
    assert as_json(folder, "a.csv") == as_json(folder, "a.csv")


def test_records_one_after_the_other(folder: Path) -> None:
    head, *rows = (folder / "a.csv").read_text(encoding="utf-8").splitlines()
    (folder / "first.csv").write_text("\n".join([head, *rows[:1000]]), encoding="utf-8")
    (folder / "rest.csv").write_text("\n".join([head, *rows[1000:]]), encoding="utf-8")
    whole, parts = as_json(folder, "a.csv"), as_json(folder, "first.csv", "rest.csv")
    assert parts["axes"][0]["parameters"] == whole["axes"][0]["parameters"]
    assert parts["axes"][0]["alarms"] == whole["axes"][0]["alarms"]
