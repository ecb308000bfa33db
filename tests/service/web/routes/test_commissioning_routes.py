"""How far the robot is commissioned, which reports there are, and the live check of signals."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.config.drive_sources import shipped
from service.store.tokens import Scope, TokenFile
from service.web.access import Access
from service.web.report_pages import ReportPages
from service.web.robot_setup import NoLookError, SignalCheck
from tests.service.pipeline.robots import with_axes
from tests.service.web.conftest import SIGNAL_CHECK, Stage, robot_setup


@pytest.fixture
def commissioned(stage: Stage, tmp_path: Path) -> TestClient:
    """The demo, of which one axis was not calibrated, with two records and a planned motion."""
    folder = tmp_path / "made"
    shutil.copytree(shipped("demo/axiswatch.toml").parent, folder)
    (folder / "demo.axis2-calibration.html").unlink()
    (folder / "records").mkdir()
    (folder / "motion").mkdir()
    for name in ("records/1.log", "records/2.log", "motion/demo.axis2.csv"):
        (folder / name).touch()
    setup = robot_setup()
    first, second, *_ = setup.config().robot[0].axis
    lacking = second.model_copy(update={"model": second.model.model_copy(update={"thresholds_file": None})})
    config = with_axes(setup.config(), (first, lacking))
    stage.setup = replace(setup, config=lambda: config, file=folder / "axiswatch.toml")
    stage.reports = ReportPages(folder, ["demo.axis1", "demo.axis2"])
    return stage.client()


def test_the_steps_have_their_state_and_their_commands(commissioned: TestClient, stage: Stage) -> None:
    """The second axis of the stage is silent."""
    found = commissioned.get("/api/v1/commissioning").json()
    assert [(s["name"], s["done"], s["total"]) for s in found["steps"]] == [
        ("configure", 2, 2),
        ("signals", 1, 2),
        ("record", 2, None),
        ("identify", 2, 2),
        ("calibrate", 1, 2),
        ("run", 2, 2),
    ]
    assert found["next"] == "signals"
    stage.healthy()
    found = commissioned.get("/api/v1/commissioning").json()
    assert found["next"] == "calibrate"
    (command,) = {s["command"] for s in found["steps"] if s["name"] == found["next"]}
    assert command == "axiswatch commission --config axiswatch.toml --minutes 10 --output ."


def test_the_reports_that_are_there_are_named_and_served(commissioned: TestClient) -> None:
    found = commissioned.get("/api/v1/commissioning").json()
    first, second = found["axes"]
    assert found["report"] == "/reports/report.html"
    assert (first["identified"], first["calibrated"], first["motion"]) == (True, True, None)
    assert (second["calibrated"], second["calibration"]) == (False, None)
    assert second["motion"] == "motion/demo.axis2.csv"
    for address in (first["identification"], first["calibration"], second["identification"]):
        answer = commissioned.get(address)
        assert answer.status_code == 200
        assert "sandbox" in answer.headers["content-security-policy"]


def test_a_robot_that_was_never_commissioned_is_told_where_to_write(stage: Stage, tmp_path: Path) -> None:
    stage.setup = replace(robot_setup(), file=tmp_path / "my robot.toml")
    found = stage.client().get("/api/v1/commissioning").json()
    assert found["folder"] == str(tmp_path)
    assert found["report"] is None
    assert found["steps"][3]["command"].endswith("--config 'my robot.toml' --minutes 10 --output commissioned")


@pytest.mark.parametrize("scope", list(Scope))
def test_only_an_admin_sees_the_folder(stage: Stage, tmp_path: Path, scope: Scope) -> None:
    tokens = TokenFile(tmp_path / "tokens.json")
    secret = tokens.new("anna", scope)
    stage.setup = replace(robot_setup(), file=tmp_path / "robot.toml")
    stage.access = Access(tokens)
    answer = stage.client().get("/api/v1/commissioning", headers={"Authorization": f"Bearer {secret}"})
    assert answer.status_code == 200
    assert answer.json()["folder"] == (str(tmp_path) if scope is Scope.ADMIN else None)
    assert (str(tmp_path) in answer.text) == (scope is Scope.ADMIN)


def test_the_signals_of_an_axis_are_looked_at(stage: Stage) -> None:
    asked = list[str]()

    def look(axis_id: str) -> SignalCheck:
        asked.append(axis_id)
        return SIGNAL_CHECK

    stage.setup = robot_setup(look)
    client = stage.client()
    answer = client.get("/api/v1/commissioning/demo.axis1/signals")
    assert answer.json() == SIGNAL_CHECK.model_dump()
    missing = client.get("/api/v1/commissioning/demo.axis9/signals")
    assert (missing.status_code, missing.json()["known"]) == (404, ["demo.axis1", "demo.axis2"])
    assert asked == ["demo.axis1"]


def test_why_they_cannot_be_looked_at_is_said(stage: Stage) -> None:
    def look(_: str) -> SignalCheck:
        raise NoLookError("no frames are kept")

    stage.setup = robot_setup(look)
    answer = stage.client().get("/api/v1/commissioning/demo.axis1/signals")
    assert (answer.status_code, answer.json()["detail"]) == (503, "no frames are kept")
