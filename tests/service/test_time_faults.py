"""Lost, repeated and backward samples and clocks that are set: each counted by its reason, live as in a replay."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.can.frames import Frame
from service.can.log_files import FrameRecorder
from service.commands.main import app
from service.config import Config, load
from service.ingest.encode import FrameEncoder
from service.pipeline.frame_pipeline import FramePipeline
from service.simulation.robot import SimulatedRobot
from tests.end_to_end.processes import demo_config

START_US = 1_760_000_000_000_000
COUNTER = 'counter_message = "Axis1State"\ncounter_signal = "Counter"'
CLOCKS = {"receipt": "", "cyclic": 'clock = "cyclic"', "counter": COUNTER}
CYCLE_US = 5000


def configured(folder: Path, clock: str) -> Path:
    file = demo_config(folder, 'interface = "virtual"\nchannel = "faults"', axes=1)
    text = file.read_text(encoding="utf-8")
    assert COUNTER in text
    file.write_text(text.replace(COUNTER, CLOCKS[clock]), encoding="utf-8")
    return file


def sent(config: Config, seed: int, samples: int) -> list[Frame]:
    encoder, frames = FrameEncoder(config, "can0"), list[Frame]()
    for moment in SimulatedRobot(config, seed).moments():
        (frame,) = encoder.encode(moment.readings, moment.number)
        frames.append(Frame(START_US + CYCLE_US * len(frames), *frame.key, frame.data))
        if len(frames) == samples:
            return frames
    raise AssertionError("a robot without an end")


def received(frames: list[Frame]) -> list[Frame]:
    """Four samples lost in a row, then forty; one repeated, one again from before; then the clock is set back.

    The last but one is lost, too: only at the end it is known that no other comes that would tell its cycle.
    """
    found = [*frames[:400], *frames[404:600], *frames[640:800]]
    last = found[-1]
    found += [last._replace(t_us=last.t_us + 30), frames[796]._replace(t_us=last.t_us - 3 * CYCLE_US)]
    hour_us = 3_600_000_000
    return found + [f._replace(t_us=f.t_us - hour_us) for f in (*frames[800:-2], frames[-1])]


def of_replay(file: Path, frames: list[Frame]) -> dict[str, Mapping[str, int]]:
    log = file.with_name("faults.log")
    with FrameRecorder(log) as recorder:  # python-can's own does not let a time go back
        recorder.write("can0", frames)
    result = CliRunner().invoke(app, ["replay", "--config", str(file), str(log), "--json", "-"])
    assert result.exit_code == 0, result.output
    (axis,) = json.loads(result.stdout)["axes"]
    return {what: axis[what] for what in ("counters", "dropped", "clock")}


def of_the_daemon(config: Config, frames: list[Frame]) -> dict[str, Mapping[str, int]]:
    core = FramePipeline(config)
    for k in range(0, len(frames), 61):
        core.take("can0", frames[k : k + 61])
        core.update()
    core.flush()
    core.update()
    ingest = core.ingests["can0"]
    return {
        "counters": core.monitors.by_id["demo.axis1"].status().counters,
        "dropped": ingest.axes["demo.axis1"].dropped,
        "clock": ingest.axes["demo.axis1"].events,
    }


@pytest.mark.parametrize(
    ("clock", "refused", "events"),
    [
        ("receipt", {"repeated": 2, "out_of_order": 2}, (0, 1)),
        ("cyclic", {"repeated": 2, "out_of_order": 2, "untimed": 400}, (1, 1)),
        ("counter", {"repeated": 2, "out_of_order": 2, "untimed": 400}, (1, 1)),
    ],
)
def test_each_has_its_counter(
    tmp_path: Path, seed: int, clock: str, refused: dict[str, int], events: tuple[int, int]
) -> None:
    file = configured(tmp_path, clock)
    config = load(file, {})
    frames = received(sent(config, seed, 1600))
    live = of_the_daemon(config, frames)
    assert of_replay(file, frames) == live
    assert {reason: n for reason, n in live["dropped"].items() if n} == {**refused, "missing": 45}
    assert live["clock"] == dict(zip(("clock_reanchored", "clock_set_back"), events, strict=True))
    counters, samples = live["counters"], len(frames) - sum(refused.values()) // 2
    # Four lost samples are bridged; forty are more than max_gap_s, and so is an hour back.
    assert (counters["started"], counters["gap"], counters["not_increasing"]) == (1, 2, 0)
    assert sum(n for fate, n in counters.items() if fate != "projected") == samples
    assert counters["settling"] >= 2 * 300 - 2  # settling_time_s = 4.5 after each of them
