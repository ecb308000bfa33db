"""``axiswatch replay`` over tables and logs, and over a drift of months, compressed."""

import json
import re
from html import escape
from pathlib import Path
from typing import Any

import pytest

from service.config.loading import load
from service.ingest.records.record_ranges import RecordRange
from service.ingest.tables.csv_tables import ROWS
from service.simulation.robot import SimulatedFault
from tests.service.command_line import axiswatch, refused, shown
from tests.service.robot_tables import configured, write_table

pytestmark = pytest.mark.usefixtures("without_pictures")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Path:
    """A configuration, and a table of twelve seconds in which the friction grows by half after six."""
    folder = tmp_path_factory.mktemp("replay")
    fault = SimulatedFault("demo.axis1", {"fm": 1.5}, 6.0)
    write_table(folder / "a.csv", configured(folder, "replay"), seed, [fault], 12)
    return folder


def replay(folder: Path, *arguments: str) -> str:
    return shown("replay", "--config", folder / "robot.toml", *arguments)


def as_json(folder: Path, *records: str) -> dict[str, Any]:
    files = [str(folder / record) for record in records]
    found: dict[str, Any] = json.loads(replay(folder, *files, "--json", "-"))
    return found


def test_estimates_and_the_alarm_as_json_and_the_same_again_and_tables_for_people(folder: Path) -> None:
    (axis,) = as_json(folder, "a.csv")["axes"]
    assert (axis["id"], axis["samples"]) == ("demo.axis1", 2401)
    assert axis["last_sample"] == "2025-10-09T08:53:32.000000Z"
    assert [p["name"] for p in axis["parameters"]] == ["kT", "1/Ja", "fm"]
    fm = axis["parameters"][2]
    assert (fm["nominal"], fm["unit"], fm["status"]) == (0.06, "N m s/rad", "alarm")
    assert fm["estimate"] == pytest.approx(0.09, abs=6 * fm["standard_deviation"])
    assert fm["standard_deviation"] ** 2 == pytest.approx(
        fm["p_diagonal"] * axis["parameters"][0]["standard_deviation"] ** 2 / axis["parameters"][0]["p_diagonal"]
    )
    alarm = axis["alarms"][0]
    assert (alarm["parameter"], alarm["direction"], alarm["ended"]) == ("fm", "up", None)
    assert "2025-10-09T08:53:25" <= alarm["onset"] <= alarm["raised"] <= alarm["updated"] <= axis["last_sample"]
    assert alarm["crossings"] >= 1
    assert sum(axis["counters"].values()) == 2401
    assert axis["dropped"]["missing"] == 0
    assert as_json(folder, "a.csv") == as_json(folder, "a.csv")
    shown = replay(folder, str(folder / "a.csv"))
    assert all(words in shown for words in ("demo.axis1", "Alarms", "fm"))


def test_parts_of_a_record_give_the_same_as_all_of_it(folder: Path) -> None:
    """The friction grows after six seconds, so the first part has no alarm."""
    config, record = folder / "robot.toml", folder / "a.csv"
    (first,) = json.loads(shown("replay", "--config", config, f"{record}@:5.995", "--json", "-", code=5))["axes"]
    assert (first["samples"], first["alarms"]) == (1200, [])
    both, full = as_json(folder, "a.csv@:5.995", "a.csv@6:"), as_json(folder, "a.csv")
    assert both["axes"] == full["axes"]
    text = refused("replay", "--config", config, f"{record}@20:")
    assert "a.csv: no sample after 20 s; the record is 12 s long" in text


def test_a_part_is_read_no_further_than_its_end(folder: Path, tmp_path: Path) -> None:
    """A large record goes on for hours."""
    head, *rows = (folder / "a.csv").read_text(encoding="utf-8").splitlines()
    time, _, rest = rows[0].partition(",")
    later = [f"{float(time) + 0.005 * k},{rest}" for k in range(3 * ROWS)]
    (tmp_path / "b.csv").write_text("\n".join([head, *later]) + "\n", encoding="utf-8")
    config = load(folder / "robot.toml", {})
    part, full = ([*RecordRange(f"{tmp_path / 'b.csv'}{at}", config).steps()] for at in ("@2:3", ""))
    assert sum(step.samples["demo.axis1"].size for step in part) == 201
    assert len(part) < len(full)


# --- what was not tested --------------------------------------------------------------------------------------------


def replayed(folder: Path, *changes: tuple[str, str]) -> tuple[int, str, dict[str, Any]]:
    """Exit code, text and the axis as JSON, of the table with these changes of the configuration."""
    name = f"untested{len(list(folder.iterdir()))}"
    (folder / name).mkdir()
    file = configured(folder / name, name, *changes)
    found, page = folder / name / "a.json", folder / name / "a.html"
    result = axiswatch("replay", "--config", file, folder / "a.csv", "--json", found, "--report", page)
    (axis,) = json.loads(found.read_text(encoding="utf-8"))["axes"]
    return result.exit_code, result.stdout, {**axis, "page": page.read_text(encoding="utf-8")}


def test_what_is_left_out_of_a_record_is_named(folder: Path) -> None:
    lines = (folder / "a.csv").read_text(encoding="utf-8").splitlines()
    lines[700] = lines[700] + ",1"
    (folder / "damaged.csv").write_text("\n".join([*lines, ""]), encoding="utf-8")
    result = axiswatch("replay", "--config", folder / "robot.toml", folder / "damaged.csv")
    assert "damaged.csv, line 701: " in result.stderr
    assert result.stderr.rstrip().endswith(": left out")


def test_a_record_too_short_for_P0_is_not_healthy_and_the_memory_that_is_named_gets_it_tested(
    folder: Path,
) -> None:
    P0 = 'initial_p = { kT = 206.0, "1/Ja" = 0.0065, fm = 30.6 }', ""
    code, text, axis = replayed(folder, P0)
    assert code == 5
    first = text.splitlines()[0]
    assert first.startswith("Not tested: demo.axis1: kT, 1/Ja and fm are not tested: too little motion to begin with,")
    assert "No alarms: nothing was tested." in text
    assert "none yet" in text
    assert axis["not_tested_in_records"] == dict.fromkeys(("kT", "1/Ja", "fm"), "seeding")
    assert [(p["tested"], p["not_tested_reason"]) for p in axis["parameters"]] == 3 * [(False, "seeding")]
    assert escape(first.removeprefix("Not tested: ")) in axis["page"]
    assert "Not tested" in axis["page"]
    advised = re.search(r"memory_s = ([\d.]+) and joint_state = true", first)
    assert advised, first
    memory = "memory_s = 1.0", f"memory_s = {advised[1]}\njoint_state = true"
    code, text, axis = replayed(folder, P0, memory)
    assert code == 0
    assert "ot tested" not in text
    assert axis["not_tested_in_records"] == {}
    assert [alarm["parameter"] for alarm in axis["alarms"]][:1] == ["fm"]


def test_a_gate_that_was_closed_all_along(folder: Path) -> None:
    slow = "sample_interval_s = 0.005", "sample_interval_s = 0.005\nmin_speed = 1000.0"
    code, text, axis = replayed(folder, slow)
    assert code == 5
    assert "operating conditions exclude the samples (slower than 1000 rad/s)" in text.splitlines()[0]
    assert set(axis["not_tested_in_records"].values()) == {"operating conditions"}


# --- a drift: an entry each three seconds -------------------------------------------------------------------


LENGTH_S = 400.0
PER_S = 0.0006
"""Part of its nominal value by which fm grows in a second: by half after 833 s."""
OWN = '\n[robot.axis.model.limits]\nfm = 0.09\n\n[robot.axis.trend]\ninterval_s = 3.0\nlead_time = "10 min"\n\n'


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory, seed: int) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("drift")
    file = configured(folder, "drift", ("[robot.axis.estimator]", f"{OWN}[robot.axis.estimator]"))
    # A fault is a factor of what is there by then.
    drift = [SimulatedFault("demo.axis1", {"fm": 1 + PER_S / (1 + PER_S * k)}, k + 0.5) for k in range(round(LENGTH_S))]
    write_table(folder / "a.csv", file, seed, drift, LENGTH_S)
    text = shown(
        "replay",
        "--config",
        file,
        folder / "a.csv",
        "--report",
        folder / "replay.html",
        "--json",
        folder / "a.json",
    )
    (axis,) = json.loads((folder / "a.json").read_text(encoding="utf-8"))["axes"]
    page = (folder / "replay.html").read_text(encoding="utf-8")
    return {**axis, "shown": text, "page": page}


def test_the_drift_has_its_slope_and_the_limit_is_foretold(found: dict[str, Any]) -> None:
    fm, drift = found["trends"][2], found["trends"][2]["drift"]
    assert len(fm["time"]) == len(fm["mean"]) > 90
    assert drift["drift"] + drift["both"] > 0.9
    slope = 0.06 * PER_S * 86400
    assert drift["slope_per_day"] == pytest.approx(slope, abs=6 * drift["slope_per_day_sd"])
    assert drift["slope_per_day_sd"] < 0.3 * slope
    for other in (parameter["drift"] for parameter in found["trends"][:2]):
        assert abs(other["slope_per_day"]) < 6 * other["slope_per_day_sd"]
    (limit,) = found["trends"][2]["limits"]
    assert limit["state"] in ("ahead", "open")
    assert limit["words"].startswith("fm reaches 0.09 N m s/rad in ")
    assert "Trend: demo.axis1: fm " in found["shown"]
    assert "fm reaches 0.09 N m s/rad in " in found["shown"].replace("\n", " ")
    kinds = [alarm["kind"] for alarm in found["alarms"] if alarm["parameter"] == "fm"]
    assert kinds.count("forecast") == 1
    assert len(kinds) >= 2


def test_the_page_has_the_trends_of_the_json(found: dict[str, Any]) -> None:
    assert "Long-term trend, and when limits are reached" in found["page"]
    for parameter in found["trends"]:
        words = "; ".join([parameter["words"], *(limit["words"] for limit in parameter["limits"])])
        assert escape(words) in found["page"]
