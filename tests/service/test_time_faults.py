"""Lost, repeated and backward samples and clocks that are set: each counted by its reason, live as in a replay."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from service.can.frames import Frame
from service.can.log_files import FrameRecorder
from service.config import Config, load
from service.pipeline.frame_pipeline import FramePipeline
from tests.end_to_end.processes import demo_config
from tests.service.pipeline.robots import START_US, cut, live, moments, replayed

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
    found = moments(config, (samples - 0.5) * CYCLE_US * 1e-6, seed)
    return [Frame(START_US + CYCLE_US * k, *f.key, f.data) for k, (_, (f,)) in enumerate(found)]


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
    axis = replayed(file, log)
    return {what: axis[what] for what in ("counters", "dropped", "clock")}


def of_the_daemon(config: Config, frames: list[Frame]) -> dict[str, Mapping[str, int]]:
    core = FramePipeline(config)
    live(core, cut(frames, 61))
    axis = core.ingests["can0"].axes["demo.axis1"]
    counters = core.monitors.by_id["demo.axis1"].status().counters
    return {"counters": counters, "dropped": axis.dropped, "clock": axis.events}


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
    found = of_the_daemon(config, frames)
    assert of_replay(file, frames) == found
    assert {reason: n for reason, n in found["dropped"].items() if n} == {**refused, "missing": 45}
    assert found["clock"] == dict(zip(("clock_reanchored", "clock_set_back"), events, strict=True))
    counters, samples = found["counters"], len(frames) - sum(refused.values()) // 2
    # Four lost samples are bridged; forty are more than max_gap_s, and so is an hour back.
    assert (counters["started"], counters["gap"], counters["not_increasing"]) == (1, 2, 0)
    assert sum(n for fate, n in counters.items() if fate != "projected") == samples
    assert counters["settling"] >= 2 * 300 - 2  # settling_time_s = 4.5 after each of them
