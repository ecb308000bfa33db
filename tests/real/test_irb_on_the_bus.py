"""The record of a real robot axis as CAN frames over a real bus into the daemon; its recording replayed."""

import json
import re
import shutil
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import can
import numpy as np
import pytest

from service.commands.play import TOO_SLOW, play_record
from service.config import load
from service.ingest.records.record_files import read_record
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.store.checkpoints import Checkpoint, Checkpoints
from tests.end_to_end.processes import Daemon, daemon, run_program, wait_for
from tests.real.irb import AXIS, CONFIG
from tests.service.command_line import shown

pytestmark = [pytest.mark.records, pytest.mark.vcan]
SAMPLES = 19838
ATTEMPTS = 4
PATIENCE_S = 300.0
"""Compiling the kernel inside a virtual machine takes minutes, the first time."""
FIRST = ("nice", "-n", "-10")
"""Frames that the daemon is too late for wait in the kernel, with their times; those that are sent late have others."""
VALUES = ("estimate", "standard_deviation", "p_diagonal")


class Played(NamedTuple):
    """What is left of a daemon that has seen the whole record."""

    config: Path
    recording: Path
    axis: Any
    metrics: str
    status: int


@pytest.fixture(scope="module")
def frames(irb_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The record as a CAN log: to encode frames while they are sent is more than slow machines can do in time."""
    path = tmp_path_factory.mktemp("frames") / "irb.log"
    writer = can.CanutilsLogWriter(path)
    config = load(CONFIG, {})
    for frame in play_record(read_record(irb_path, config), config):
        writer.on_message_received(
            can.Message(
                timestamp=1e9 + frame.offset_s,
                arbitration_id=frame.key.can_id,
                is_extended_id=frame.key.extended,
                data=frame.data,
                channel="vcan0",
            )
        )
    writer.stop()
    return path


@pytest.fixture(scope="module")
def played(frames: Path, tmp_path_factory: pytest.TempPathFactory) -> Played:
    """Once more where the machine could not send the frames in time: their times were wrong, not the daemon."""
    for _ in range(ATTEMPTS):
        folder = tmp_path_factory.mktemp("irb")
        config, recording = folder / "irb.toml", folder / "received.log"
        for file in (CONFIG, CONFIG.with_suffix(".dbc")):
            shutil.copy(file, folder)
        with daemon(config, "--record", recording) as running:
            in_time = TOO_SLOW not in must_succeed("play", "--config", config, frames, under=FIRST)
            axis = when_all_is_in(running)
            metrics, status = running.text("metrics"), running.stop()
        if in_time:
            return Played(config, recording, axis, metrics, status)
    raise AssertionError(f"{ATTEMPTS} times, {TOO_SLOW}")


def must_succeed(*arguments: str | Path, under: Sequence[str] = ()) -> str:
    done = run_program(*arguments, patience_s=PATIENCE_S, under=under)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def when_all_is_in(running: Daemon) -> Any:
    """What the daemon says of the axis once it has seen all samples, or for half a minute no further one."""
    counts: list[int] = []

    def look() -> Any:
        axis = running.get(f"api/v1/axes/{AXIS}")
        counts.append(axis["samples"])
        if counts[-1] >= SAMPLES or (counts[-1] and counts[-30:] == counts[-1:] * 30):
            return axis
        time.sleep(1)  # the worker publishes about every second
        return None

    return wait_for(look, patience_s=PATIENCE_S)


def replayed(played: Played, record: Path) -> Any:
    """The axis after ``axiswatch replay`` of a record."""
    found = played.config.with_name(f"{record.name}.json")
    shown("replay", "--config", played.config, "--json", found, record)
    return json.loads(found.read_text(encoding="utf-8"))["axes"][0]


def test_no_frame_is_lost(played: Played) -> None:
    assert len(played.recording.read_text().splitlines()) == SAMPLES
    lost = {name: value for name, value in _counters(played.metrics) if "dropped" in name and value}
    assert lost == {}
    assert dict(_counters(played.metrics))['axiswatch_frames_total{bus="can0"}'] == SAMPLES
    fates = {fate: count for fate, count in played.axis["counters"].items() if count}
    assert fates == {"started": 1, "settling": 999, "used": SAMPLES - 1000}
    assert played.status == 0


def test_estimates_come_out_of_rest_and_of_the_metrics(played: Played) -> None:
    metrics = dict(_counters(played.metrics))
    assert [p["name"] for p in played.axis["parameters"]] == ["kT", "1/Ja", "fm"]
    for p in played.axis["parameters"]:
        labels = f'{{axis="{AXIS}",parameter="{p["name"]}"}}'
        assert p["status"] == "tracking"
        for value in VALUES:
            assert metrics[f"axiswatch_parameter_{value}{labels}"] == p[value]
        assert p["estimate"] == pytest.approx(p["nominal"], abs=3 * p["standard_deviation"])


def test_replay_of_the_recorded_frames_gives_the_same_state(played: Played) -> None:
    """All of it: theta, the whole P, g, the predictor; and what the command says."""
    assert _values(replayed(played, played.recording)) == _values(played.axis)
    config = load(played.config, {})
    monitors = AxisMonitors(config.axes)
    for step in read_record(played.recording, config).steps():
        monitors.update(step.samples)
    monitor = monitors.by_id[AXIS]
    saved = _saved(config.service.state_dir / "checkpoints.sqlite", monitor.key)
    for name, array in monitor.to_arrays().items():
        np.testing.assert_array_equal(saved.arrays[name], array, err_msg=name)


def test_quantised_on_the_bus_the_record_gives_the_same_estimates(played: Played, irb_path: Path) -> None:
    live = played.axis["parameters"]
    for from_bus, from_file in zip(live, replayed(played, irb_path)["parameters"], strict=True):
        assert from_bus["estimate"] == pytest.approx(from_file["estimate"], abs=0.2 * from_file["standard_deviation"])
        assert from_bus["p_diagonal"] == pytest.approx(from_file["p_diagonal"], rel=0.2)


def _values(axis: Any) -> list[list[float]]:
    return [[p[value] for value in VALUES] for p in axis["parameters"]]


def _counters(metrics: str) -> Iterator[tuple[str, float]]:
    for line in re.findall(r"^(axiswatch_\S+) (\S+)$", metrics, re.MULTILINE):
        yield line[0], float(line[1])


def _saved(path: Path, key: str) -> Checkpoint:
    store = Checkpoints(path)
    try:
        found = store.load(AXIS, key, 0)
    finally:
        store.close()
    assert isinstance(found, Checkpoint)
    return found
