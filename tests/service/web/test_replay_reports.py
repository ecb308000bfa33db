"""The report of a replay that the daemon makes: by its own process, with the nominal values of then, one at a time."""

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from service.commands.daemon.lifecycle import REPORT_WRITER
from service.config import Config, load
from service.config.epoch_values import content_of, fingerprint_of
from service.pipeline.persistence.recording import Extracts
from service.pipeline.persistence.recording_folder import RecordingFolder
from service.pipeline.persistence.replay_reports import ReplayReports, ReportState
from service.store.epochs import EpochPlan
from service.store.tokens import Scope, TokenFile
from service.web.access import Access
from tests.end_to_end.processes import demo_config
from tests.service.pipeline.robots import blocks
from tests.service.web.conftest import FM_ALARM, Stage

PATIENCE_S = 240.0
"""The process loads its libraries, on a machine that is busy, and gives way to all others."""
NOMINAL_FM = 0.0612345
"""Of the epoch; the configuration has another one"""
S = 1_000_000


class Plant:
    """A recording of eight seconds of an axis, an alarm in it, and one after it."""

    def __init__(self, stage: Stage, folder: Path, config: Config, seed: int) -> None:
        self.stage, self.recordings = stage, RecordingFolder(folder / "recordings", 10**9)
        self.config = config
        axis = config.axes[0]
        frames = [(config.bus[0].name, block) for block in blocks(config, 8.0, seed, [])]
        self.record = self.recordings.write(frames)
        end_us = int(frames[-1][1].t_us.max())
        content = json.loads(content_of(axis))
        content["nominal"]["fm"] = NOMINAL_FM
        epoch = EpochPlan(axis.id, "configuration", json.dumps(content), fingerprint_of(axis))
        stage.journal.epochs.begin_with([epoch], end_us - 3600 * S)
        self.alarm, self.later = (
            stage.record(axis.id, "N m s/rad", 0.06, replace(FM_ALARM, raised_us=t_us, ended_us=t_us + 1))
            for t_us in (end_us - S, end_us + 60 * S)
        )
        self.reports = self.replay_reports("robot.toml")
        stage.extracts = Extracts(self.recordings, 8.0, 2.0, lambda: stage.now_us)
        stage.replays = self.reports
        self.client = stage.client()

    def replay_reports(self, named: str) -> ReplayReports:
        epochs = self.stage.journal.epochs
        return ReplayReports(self.recordings, lambda: self.config, named, epochs, REPORT_WRITER)

    def settled(self) -> dict[str, Any]:
        """What has become of the report that is being made."""
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s:
            found: dict[str, Any] = self.client.get(f"/api/v1/alarms/{self.alarm}").json()["report"]
            if found["state"] != "running":
                return found
            time.sleep(0.2)
        raise AssertionError("the report was not made in time")

    def ask(self, number: int) -> Any:
        return self.client.post(f"/api/v1/alarms/{number}/report")


@pytest.fixture
def plant(stage: Stage, tmp_path: Path, seed: int) -> Iterator[Plant]:
    config = load(demo_config(tmp_path, 'interface = "virtual"\nchannel = "replays"', axes=1), {})
    found = Plant(stage, tmp_path, config, seed)
    yield found
    found.reports.stop()
    assert stage.extracts is not None
    stage.extracts.close()


def test_the_report_is_made_on_request_and_kept_beside_the_recording(plant: Plant) -> None:
    address = f"/api/v1/alarms/{plant.alarm}"
    assert plant.client.get(address).json()["report"]["state"] == "none"
    assert plant.client.get(f"{address}/report").status_code == 404
    asked = plant.ask(plant.alarm)
    assert (asked.status_code, asked.json()["report"]["state"]) == (202, "running")
    assert plant.ask(plant.alarm).status_code == 202  # it is being made: there is nothing more to do
    assert plant.settled() == {"state": "made", "problem": None, "sentences": []}
    page = plant.client.get(f"{address}/report")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    assert page.headers["content-security-policy"].startswith("default-src 'none'")
    assert "sandbox" in page.headers["content-security-policy"]
    name = f"{plant.record.stem}-alarm{plant.alarm}.html"
    assert f'attachment; filename="{name}"' in page.headers["content-disposition"]
    assert f"Replay of {plant.record.name}" in page.text
    assert f"{NOMINAL_FM:.4g}" in page.text
    small = RecordingFolder(plant.recordings.path, 1)
    small.write([("can0", block) for block in later_frames(plant)])
    assert not plant.record.exists()
    assert plant.client.get(f"{address}/report").status_code == 404
    assert [path.suffix for path in small.path.iterdir()] == [".log"]


def later_frames(plant: Plant) -> list[Any]:
    """Of an hour later."""
    found = list(blocks(plant.config, 1.0, 0, []))
    for block in found:
        block.records["t_us"] += 3600 * S
    return found


def test_why_there_is_no_report(plant: Plant, tmp_path: Path) -> None:
    assert plant.client.get(f"/api/v1/alarms/{plant.later}").json()["report"] is None
    answer = plant.ask(plant.later)
    assert (answer.status_code, answer.json()["detail"]) == (409, "there is no recording of this alarm")
    assert plant.ask(9999).status_code == 404
    plant.record.write_text("", encoding="utf-8")
    assert plant.ask(plant.alarm).status_code == 202
    found = plant.settled()
    assert found["state"] == "failed"
    assert plant.record.name in found["problem"] or "nothing to draw" in found["problem"]
    tokens = TokenFile(tmp_path / "tokens.json")
    reader = {"Authorization": f"Bearer {tokens.new('anna', Scope.READ)}"}
    plant.stage.access = Access(tokens)
    address = f"/api/v1/alarms/{plant.alarm}/report"
    assert plant.stage.client().post(address, headers=reader).status_code == 403


def test_a_report_ends_with_the_daemon(plant: Plant) -> None:
    assert plant.ask(plant.alarm).status_code == 202
    alarm = plant.stage.journal.get(plant.alarm)
    assert alarm is not None
    plant.reports.stop()
    end_s = time.monotonic() + PATIENCE_S
    # Without a pause: no moment is left out.
    while (state := plant.reports.state(alarm)) == ReportState("running"):
        assert time.monotonic() < end_s
    assert state is not None
    assert state.state == "failed"
    found = plant.settled()
    assert (found["state"], found["sentences"][0]["kind"]) == ("failed", "replay ended")
    assert plant.ask(plant.alarm).status_code == 409
    assert [path.suffix for path in plant.recordings.path.iterdir()] == [".log"]


class SlowName(str):
    """The name of a file; when it is written for the process of the report, that process has been ended."""

    reports: ReplayReports

    def __reduce__(self) -> tuple[type[str], tuple[str]]:
        self.reports.stop()
        time.sleep(0.5)  # it is gone by now; were it not, the test would only see less
        return str, (str(self),)


def test_a_process_that_ends_before_it_has_read_its_order(plant: Plant) -> None:
    name = SlowName("robot.toml")
    plant.reports = plant.stage.replays = name.reports = plant.replay_reports(name)
    plant.client = plant.stage.client()
    assert plant.ask(plant.alarm).status_code == 202
    assert plant.settled()["sentences"][0]["kind"] == "replay ended"
