"""Frames around alarms: the ring, the files, and that a replay of such a file raises the alarm again."""

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from structlog.testing import capture_logs

from service.can.frames import Frame, FrameBlock
from service.can.log_files import CanLog
from service.can.user_errors import RecordError
from service.pipeline.axes.axis_monitors import FramePipeline
from service.pipeline.persistence import recording as recording_module
from service.pipeline.persistence.recording import Extracts, FrameRing, Recording
from service.pipeline.persistence.recording_folder import RecordingFolder
from service.simulation.robot import SimulatedFault
from service.texts.instants import microseconds
from tests.end_to_end.processes import PATIENCE_S, demo_config, wait_for
from tests.service.pipeline.robots import START_US, blocks, demo, replayed

S = 1_000_000


def frames_at(*times_s: float, data_bytes: int = 8) -> FrameBlock:
    return FrameBlock.from_frames([Frame(START_US + round(t * S), 0x101, False, bytes(data_bytes)) for t in times_s])


def times_s(found: Sequence[tuple[str, FrameBlock]]) -> list[float]:
    return [(t - START_US) / S for _, block in found for t in block.t_us.tolist()]


def test_the_ring_forgets_what_is_older_than_its_length() -> None:
    ring = FrameRing(10)
    for t in range(30):
        ring.add("can0", frames_at(t, t + 0.5))
    assert times_s(ring.between(START_US, START_US + 100 * S))[0] == 19
    assert times_s(ring.between(START_US + 21 * S, START_US + 22 * S)) == [21, 21.5, 22]


def test_the_ring_is_bounded_in_memory() -> None:
    block_bytes = frames_at(*range(10)).records.nbytes
    ring = FrameRing(1e6, most_bytes=3 * block_bytes)
    for _ in range(7):
        ring.add("can0", frames_at(*range(10)))
    assert len(times_s(ring.between(START_US, START_US + 100 * S))) == 30


def test_the_ring_keeps_frames_not_the_array_they_are_a_part_of() -> None:
    ring, block = FrameRing(10), frames_at(0, 1, 2)
    ring.add("can0", block.select(slice(1, 2)))
    block.records["t_us"] = 0
    assert times_s(ring.between(START_US, START_US + 100 * S)) == [1]


def test_a_clock_that_is_set_back_empties_the_ring_and_it_goes_on() -> None:
    ring = FrameRing(10)
    ring.add("can0", frames_at(7200))
    for t in range(30):
        ring.add("can0", frames_at(t))
    assert times_s(ring.between(START_US, START_US + 8000 * S)) == list(range(19, 30))


def extracts(folder: Path, before_s: float = 5, after_s: float = 2, most_bytes: int = 10**9) -> Extracts:
    return Extracts(RecordingFolder(folder, most_bytes), before_s, after_s, lambda: START_US)


def feed(extracts: Extracts, *times_s: float) -> None:
    for t in times_s:
        extracts.add("can0", frames_at(t))
        extracts.tick()


def recorded_s(path: Path) -> list[float]:
    return [(t - START_US) / S for block in CanLog(path).blocks() for t in block.frames.t_us.tolist()]


def test_alarms_close_together_share_one_file_and_a_later_one_has_its_own(tmp_path: Path) -> None:
    found = extracts(tmp_path)
    feed(found, *np.arange(0, 10.5, 0.5))
    found.alarm(START_US + 10 * S)
    found.alarm(START_US + 10 * S)
    feed(found, 10.5, 11)
    found.alarm(START_US + 11 * S)  # is inside
    feed(found, *np.arange(11.5, 16, 0.5))
    found.alarm(START_US + 11 * S)  # its size has changed
    feed(found, *np.arange(16, 30, 0.5))
    found.alarm(START_US + 29 * S)
    found.close()
    first, second = found.folder.files()
    assert recorded_s(first) == list(np.arange(5, 12.5, 0.5))
    assert recorded_s(second) == list(np.arange(24, 30, 0.5))  # the daemon stopped
    assert found.folder.holding(START_US + 11 * S) == first.name
    assert found.folder.holding(START_US + 29 * S) == second.name
    assert found.folder.holding(START_US + 20 * S) is None


def test_an_alarm_of_before_the_start_has_no_frames(tmp_path: Path) -> None:
    found = extracts(tmp_path)
    found.alarm(START_US)
    feed(found, 100, 101)
    found.alarm(START_US + 50 * S)
    found.close()
    assert found.folder.files() == []


def test_a_silent_bus_does_not_keep_the_extract_waiting(tmp_path: Path) -> None:
    now_us = [START_US]
    found = Extracts(RecordingFolder(tmp_path, 10**9), 5, 2, lambda: now_us[0])
    feed(found, 0, 1)
    found.alarm(START_US + S)
    now_us[0] += 9 * S
    found.tick()
    asked = found.request()
    found.tick()
    assert recorded_s(asked.result(PATIENCE_S)) == [0, 1]
    found.close()


def test_a_request_without_frames_says_so(tmp_path: Path) -> None:
    found = extracts(tmp_path)
    asked = found.request()
    with capture_logs():
        found.tick()
        with pytest.raises(RecordError, match="no frames"):
            asked.result(PATIENCE_S)
    late = found.request()
    found.close()
    with pytest.raises(RecordError, match="stopped"):
        late.result(0)


def test_the_oldest_files_are_removed(tmp_path: Path) -> None:
    found = extracts(tmp_path, 1, 1, most_bytes=500)
    for t in (0, 100, 200):
        feed(found, *np.arange(t, t + 2, 0.5))
        found.alarm(START_US + (t + 1) * S)
        feed(found, t + 10)
    found.close()
    names = [found.folder.holding(START_US + (t + 1) * S) for t in (0, 100, 200)]
    assert names[0] is None
    assert None not in names[1:]


def test_only_files_of_the_folder_can_be_asked_for(tmp_path: Path) -> None:
    (tmp_path / "secret.log").write_text("")
    folder = RecordingFolder(tmp_path / "recordings", 10**9)
    assert folder.files() == []
    assert folder.file("../secret.log") is None
    assert folder.file("frames-20260101T000000Z-20260101T000000Z.log") is None


def test_a_folder_that_cannot_be_written_is_reported_and_monitoring_goes_on(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    found = extracts(tmp_path / "file")
    recording = Recording(extracts=found)
    recording.write("can0", frames_at(0, 1))
    found.alarm(START_US + S)
    with capture_logs() as logs:
        recording.close()
    assert [entry["event"] for entry in logs] == ["frames around an alarm are not recorded"]
    assert "cannot write" in recording.problems[0]


def test_a_state_directory_that_was_moved_away_is_not_made_anew(tmp_path: Path) -> None:
    """Then it could not be moved back."""
    found = extracts(tmp_path / "state" / "recordings")
    feed(found, 0, 1)
    found.alarm(START_US + S)
    with capture_logs():
        found.close()
    assert "No such file or directory" in str(found.problem)
    assert not (tmp_path / "state").exists()


def test_frames_wait_for_space_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_module, "RETRY_S", 0.05)
    folder = tmp_path / "recordings"
    folder.write_text("in the way")
    found = extracts(folder)
    feed(found, 0, 1)
    found.alarm(START_US + S)
    with capture_logs() as logs:
        feed(found, 2, 3, 4)
        wait_for(lambda: found.problem is not None)
        asked = found.request()
        found.tick()
        with pytest.raises(RecordError, match="cannot write"):
            asked.result(PATIENCE_S)
        assert found.problem is not None
        folder.unlink()
        wait_for(lambda: found.problem is None)
        found.close()
    (file,) = found.folder.files()
    assert recorded_s(file) == [0, 1, 2, 3]
    assert [entry["event"] for entry in logs] == [
        "frames around an alarm are not recorded",
        "frames recorded",
    ]


def test_the_replay_of_a_recording_raises_its_alarm_again(tmp_path: Path, seed: int) -> None:
    """Friction doubles after 50 s; the recordings hold 30 s before the alarm and 5 s after it, in both formats."""
    config = demo(tmp_path, 1)
    core = FramePipeline(config)
    folders = RecordingFolder(tmp_path / "log", 10**9), RecordingFolder(tmp_path / "blf", 10**9, {"can0": 0})
    recordings = [Recording(extracts=Extracts(folder, 30, 5, lambda: START_US)) for folder in folders]
    raised = []
    for block in blocks(config, 65, seed, [SimulatedFault("demo.axis1", {"fm": 2.0}, 50.0)]):
        core.take("can0", block)
        changes = core.update()
        for recording in recordings:
            recording.write("can0", block)
            recording.follow(changes)
            recording.tick()
        raised += [change.alarm for change in changes]
    for recording in recordings:
        recording.close()
    ((file,), (blf,)) = (folder.files() for folder in folders)
    assert folders[1].holding(raised[0].raised_us) == blf.name == f"{file.stem}.blf"
    found = replayed(demo_config(tmp_path, axes=1), file)["alarms"]
    assert replayed(tmp_path / "robot.toml", blf)["alarms"] == found  # to the last bit
    assert raised
    assert [alarm["parameter"] for alarm in found] == [raised[-1].parameter]
    again_us = microseconds(datetime.fromisoformat(found[0]["raised"]))
    assert again_us is not None
    assert abs(again_us - raised[0].raised_us) < S
