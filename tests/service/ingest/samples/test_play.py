"""Records on a bus: what is played is what is read again."""

import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pytest

from service.can.bus import open_bus
from service.can.frame_recorder import FrameRecorder
from service.can.frames import Frame, FrameBlock, FrameKey
from service.can.user_errors import BusError
from service.commands.play import PlayFrame, play_frames, play_record
from service.config.schema import Config
from service.ingest.records.record_files import read_record
from service.ingest.samples.bus_samples import Ingest
from service.ingest.samples.encode import FrameEncoder
from tests.service.ingest.plant import Sample, axis1, axis2, axis3, axis4, fed, make_config


def through_the_pipeline(config: Config, played: list[PlayFrame]) -> dict[str, list[Sample]]:
    frames = [Frame(round(p.offset_s * 1e6), p.key.can_id, p.key.extended, p.data) for p in played]
    return fed(Ingest(config, "bus0"), frames)


def played_from(path: Path, config: Config) -> Iterator[PlayFrame]:
    return play_record(read_record(path, config), config)


def table(path: Path, count: int = 300) -> dict[str, Any]:
    k = np.arange(count)
    columns = {"t": 7 + 0.005 * k}
    for name, motion in (("one", "angle"), ("two", "speed"), ("three", "speed"), ("four", "speed")):
        columns |= {f"torque_{name}": np.sin(k), f"{motion}_{name}": np.cos(k)}
    pa.csv.write_csv(pa.table(columns), path)
    return columns


def test_a_table_comes_back_to_the_resolution_of_its_signals(tmp_path: Path) -> None:
    columns = table(tmp_path / "a.csv")
    counter = {"column": "t", "counter_message": "Angle1", "counter_signal": "Count"}
    time = {"column": "t"}
    axes = [axis1(time=counter), axis2(time=time), axis3(time=time), axis4(time=time)]
    axes[1]["torque"] |= {"factor": -0.5, "offset": 0.25}
    config = make_config(tmp_path, *axes)
    played = list(played_from(tmp_path / "a.csv", config))
    samples = through_the_pipeline(config, played)
    assert set(samples) == {"r.one", "r.two", "r.three", "r.four"}
    for axis_id, found in samples.items():
        name = axis_id.removeprefix("r.")
        motion = columns["angle_one" if name == "one" else f"speed_{name}"]
        assert [s.t_us for s in found] == [5000 * k for k in range(300)]
        torque = columns[f"torque_{name}"] * (-0.5 if name == "two" else 1) + (0.25 if name == "two" else 0)
        assert [s.torque for s in found] == pytest.approx(torque, abs=0.5 / 1024)
        assert [s.motion for s in found] == pytest.approx(motion, abs=0.5 / 65536)
    assert played[-1].done == 1.0


def test_counters_show_the_gaps_of_the_table(tmp_path: Path) -> None:
    columns = table(tmp_path / "a.csv", 400)
    keep = np.ones(400, bool)
    keep[[3, 4, 5, 200]] = False
    pa.csv.write_csv(pa.table({name: column[keep] for name, column in columns.items()}), tmp_path / "a.csv")
    counter = {"column": "t", "counter_message": "Both2", "counter_signal": "Count"}
    played = list(played_from(tmp_path / "a.csv", make_config(tmp_path, axis2(time=counter))))
    assert [int.from_bytes(p.data[6:8], "little") for p in played] == np.flatnonzero(keep).tolist()


def test_what_an_encoder_does_with_other_signals(tmp_path: Path) -> None:
    encoder = FrameEncoder(make_config(tmp_path, axis4()), "bus0")
    ((key, data),) = encoder.encode({"r.four": (1.0, 2.0), "r.unknown": (3.0, 4.0)}, 0)
    assert key == FrameKey(0x130, False)
    assert data[5] == 7
    assert sum(data[6:60]) == 0


def test_a_log_is_played_as_it_is(tmp_path: Path) -> None:
    sent = [Frame(10**15 + 700 * k, 0x123 + k % 2, k % 3 == 0, bytes([k % 256])) for k in range(1000)]
    with FrameRecorder(tmp_path / "a.log") as recorder:
        recorder.write("bus0", FrameBlock.from_frames(sent))
    played = list(played_from(tmp_path / "a.log", make_config(tmp_path, axis1())))
    assert [(p.bus, p.key, p.data) for p in played] == [("bus0", (f.can_id, f.extended), f.data) for f in sent]
    assert [round(p.offset_s * 1e6) for p in played] == [700 * k for k in range(1000)]


def frame(offset_s: float, number: int = 0) -> PlayFrame:
    return PlayFrame(offset_s, "bus0", FrameKey(0x100, False), bytes([number]), 1.0)


def test_frames_go_onto_the_bus_on_time(tmp_path: Path) -> None:
    config = make_config(tmp_path, axis1())
    with open_bus(config.bus[0]) as sender, open_bus(config.bus[0]) as listener:
        frames = [frame(0.02 * k, k) for k in range(6)]
        before = time.time()
        assert len(list(play_frames({"bus0": sender}, frames, speed=2.0))) == 6
        received = [message for _ in range(6) if (message := listener.recv(5.0))]
    assert [message.data[0] for message in received] == list(range(6))
    # Never early, however late this machine may be.
    assert all(m.timestamp - before > 0.01 * k - 0.001 for k, m in enumerate(received))


def test_as_fast_as_the_bus_takes_it_and_stopped_early(tmp_path: Path) -> None:
    config = make_config(tmp_path, axis1())
    stop = threading.Event()
    with open_bus(config.bus[0]) as sender:
        assert len(list(play_frames({"bus0": sender}, [frame(1e6 * k) for k in range(3)], math.inf))) == 3
        sent = 0
        for _ in play_frames({"bus0": sender}, [frame(1e6 * k) for k in range(3)], stop=stop):
            sent += 1
            stop.set()
    assert sent == 1


def test_a_bus_that_does_not_take_frames(tmp_path: Path) -> None:
    config = make_config(tmp_path, axis1())
    with open_bus(config.bus[0]) as sender:
        pass
    with pytest.raises(BusError, match="cannot send on Virtual bus channel"):
        list(play_frames({"bus0": sender}, [frame(0.0)]))
