"""Recordings over REST and the command line: the alarm names its file, a request makes one, a reader may not."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from service.can.frames import Frame, FrameBlock
from service.can.log_files import CanLog
from service.commands.command_line.exit_codes import UNAVAILABLE
from service.pipeline.persistence.recording import Extracts
from service.pipeline.persistence.recording_folder import RecordingFolder
from tests.service.command_line import axiswatch, refused, shown
from tests.service.pipeline.ticking_extracts import ticking
from tests.service.web.conftest import FM_ALARM, NOON_US, Stage, serving

S = 1_000_000


@pytest.fixture
def recorded(stage: Stage, tmp_path: Path) -> Iterator[Stage]:
    """Frames of the last ten seconds, and an alarm among them; the bus has been silent since noon."""
    stage.extracts = Extracts(RecordingFolder(tmp_path / "recordings", 10**9), 8.0, 2.0, lambda: stage.now_us)
    times = range(NOON_US - 10 * S, NOON_US, S)
    stage.extracts.add("can0", FrameBlock.from_frames([Frame(t, 0x101, False, bytes(8)) for t in times]))
    yield stage
    stage.extracts.close()


def test_an_alarm_names_its_file(recorded: Stage) -> None:
    number, extracts = recorded.record("demo.axis1", "N m s/rad", 0.06, FM_ALARM), recorded.extracts
    assert extracts is not None
    client = recorded.client()
    assert client.get(f"/api/v1/alarms/{number}").json()["recording"] is None
    extracts.alarm(FM_ALARM.raised_us)
    recorded.now_us += 10 * S
    extracts.tick()
    extracts.close()
    (file,) = client.get("/api/v1/recordings").json()["recordings"]
    assert client.get(f"/api/v1/alarms/{number}").json()["recording"] == file["name"]
    (listed,) = client.get("/api/v1/alarms").json()["alarms"]
    assert listed["recording"] == file["name"]
    answer = client.get(f"/api/v1/recordings/{file['name']}")
    assert (len(answer.content), answer.headers["content-type"]) == (
        file["size_bytes"],
        "text/plain; charset=utf-8",
    )
    assert file["name"] in answer.headers["content-disposition"]
    missing = client.get("/api/v1/recordings/..%2Falarms.sqlite")
    assert missing.status_code == 404


def test_the_last_minutes_on_request(recorded: Stage, tmp_path: Path) -> None:
    extracts, copy = recorded.extracts, tmp_path / "copy.log"
    assert extracts is not None
    with serving(recorded) as url, ticking(extracts):
        text = shown("record", "--url", url, "--output", copy)
        (name,) = [file.name for file in extracts.folder.files()]
        assert "there is no recording" in refused(
            "record", f"{name}?", "--url", url, "--output", tmp_path / "none.log", code=2
        )
    assert text.endswith(f"recorded: {name}\nwritten: {copy}\n")
    (block,) = CanLog(copy).blocks()
    assert block.frames.size == 9  # of eight seconds, both ends


def test_without_room_none_is_made(stage: Stage) -> None:
    client = stage.client()
    assert client.get("/api/v1/recordings").json() == {"recordings": []}
    answer = client.post("/api/v1/recordings")
    assert answer.status_code == 503
    assert "recordings_mb in [service] is 0" in answer.json()["detail"]
    with serving(stage) as url:
        result = axiswatch("record", "--url", url)
    assert result.exit_code == UNAVAILABLE
    assert "axiswatch: recordings_mb in [service] is 0: no frames are kept" in result.stderr
