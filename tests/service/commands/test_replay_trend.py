"""A drift of months, compressed: an entry each three seconds, from the record to the forecast."""

import json
from html import escape
from typing import Any

import pytest
from typer.testing import CliRunner

from service.commands.main import app
from service.simulation.robot import Fault
from tests.service.robot_tables import configured, write_table

LENGTH_S = 400.0
PER_S = 0.0006
"""Part of its nominal value by which fm grows in a second: by half after 833 s."""
OWN = (
    '\n[robot.axis.model.limits]\nfm = 0.09\n\n[robot.axis.trend]\ninterval_s = 3.0\nlead_time = "10 min"\n\n'
)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory, seed: int) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("drift")
    file = configured(folder, "drift", ("[robot.axis.estimator]", f"{OWN}[robot.axis.estimator]"))
    # A fault is a factor of what is there by then.
    drift = [
        Fault("demo.axis1", {"fm": 1 + PER_S / (1 + PER_S * k)}, k + 0.5) for k in range(round(LENGTH_S))
    ]
    write_table(folder / "a.csv", file, seed, drift, LENGTH_S)
    command = ["replay", "--config", str(file), str(folder / "a.csv"), "--report", str(folder)]
    result = CliRunner().invoke(app, [*command, "--json", str(folder / "a.json")])
    assert result.exit_code == 0, result.output
    (axis,) = json.loads((folder / "a.json").read_text(encoding="utf-8"))["axes"]
    page = (folder / "replay.html").read_text(encoding="utf-8")
    return {**axis, "shown": result.stdout, "page": page}


def test_the_drift_has_its_slope(found: dict[str, Any]) -> None:
    fm = found["trends"][2]
    assert fm["entries"] > 90
    assert fm["probability"]["drift"] + fm["probability"]["both"] > 0.9
    slope = 0.06 * PER_S * 86400
    assert fm["slope_per_day"] == pytest.approx(slope, abs=6 * fm["slope_per_day_sd"])
    assert fm["slope_per_day_sd"] < 0.3 * slope


def test_the_others_do_not_drift(found: dict[str, Any]) -> None:
    for parameter in found["trends"][:2]:
        assert abs(parameter["slope_per_day"]) < 6 * parameter["slope_per_day_sd"]


def test_the_limit_is_foretold_in_an_interval(found: dict[str, Any]) -> None:
    (limit,) = found["trends"][2]["limits"]
    assert limit["state"] in ("ahead", "open")
    assert limit["words"].startswith("fm reaches 0.09 N m s/rad in ")
    assert "Trend: demo.axis1: fm " in found["shown"]
    assert "fm reaches 0.09 N m s/rad in " in found["shown"].replace("\n", " ")


def test_an_alarm_of_its_own_kind_is_raised_beside_that_of_the_change(found: dict[str, Any]) -> None:
    kinds = [alarm["kind"] for alarm in found["alarms"] if alarm["parameter"] == "fm"]
    assert kinds.count("forecast") == 1
    assert len(kinds) >= 2


def test_the_page_draws_the_course_and_says_what_the_json_says(found: dict[str, Any]) -> None:
    page = found["page"]
    assert "Long-term trend, and when limits are reached" in page
    for parameter in found["trends"]:
        assert escape("; ".join([parameter["words"], *(of["words"] for of in parameter["limits"])])) in page
    for words in ("entry of the history ± sd", "holds it with 90 %", "limit", "reached in this interval"):
        assert f">{words}</text>" in page, words
    assert page.count(">change [%]</text>") == 2 * 3
