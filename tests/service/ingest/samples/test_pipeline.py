"""Frames of a bus become samples of its axes."""

import math
import struct
from pathlib import Path

import pytest

from service.can.frames import Frame, FrameBlock
from service.ingest.samples.bus_samples import Ingest
from tests.service.ingest.plant import (
    ANGLE_ID,
    START_US,
    Sample,
    angle1,
    axis1,
    axis2,
    axis3,
    axis_drops,
    both2,
    counted,
    fed,
    make_config,
    torque1,
)


def drops(ingest: Ingest) -> dict[str, int]:
    return {reason: n for reason, n in ingest.dropped.items() if n}


def test_two_axes_of_one_bus(tmp_path: Path) -> None:
    ingest = Ingest(make_config(tmp_path, axis1(), axis2()), "bus0")
    assert tuple(ingest.axes) == ("r.one", "r.two")
    assert set(ingest.decoder.keys) == {(0x100, False), (ANGLE_ID, True), (0x110, False)}
    samples = fed(ingest, [torque1(START_US, 1.5), both2(START_US + 100, -0.25, 12.5), angle1(START_US + 200, -3.0)])
    assert samples == {
        "r.two": [Sample(START_US + 100, -0.25, 12.5)],
        "r.one": [Sample(START_US + 200, 1.5, -3.0)],
    }


def test_what_is_decoded_of_a_frame(tmp_path: Path) -> None:
    """With factor and offset; a number where values have names; a frame may be longer than the DBC says."""
    axis = axis2()
    axis["torque"] |= {"factor": -2.0, "offset": 0.5}
    axis["speed"] |= {"factor": 0.25}
    (sample,) = fed(Ingest(make_config(tmp_path, axis), "bus0"), [both2(START_US, 1.5, 20.0)])["r.two"]
    assert sample == Sample(START_US, -2.5, 5.0)
    (sample,) = fed(Ingest(make_config(tmp_path, axis2()), "bus0"), [both2(START_US, 1 / 1024, 1.0)])["r.two"]
    assert sample.torque == 1 / 1024  # of the raw value 1, which is named "on"
    ingest = Ingest(make_config(tmp_path, axis1()), "bus0")
    frame = torque1(START_US, 1.5)
    samples = fed(ingest, [frame._replace(data=frame.data + bytes(4)), angle1(START_US, 1.0)])
    assert samples["r.one"] == [Sample(START_US, 1.5, 1.0)]


def test_multiplexed_torque_and_speed(tmp_path: Path) -> None:
    ingest = Ingest(make_config(tmp_path, axis3()), "bus0")
    frames = [
        Frame(START_US, 0x120, False, struct.pack("<Bf3x", 1, 1.5)),
        Frame(START_US + 500, 0x120, False, struct.pack("<Bf3x", 2, 2.5)),
    ]
    assert fed(ingest, frames) == {"r.three": [Sample(START_US + 500, 1.5, 2.5)]}
    assert drops(ingest) == {"signal_absent": 2}


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ([(math.nan, 1.0), (1.0, -math.inf)], "not_finite"),
        # A torque of 1e30 would leave fm at twice its value for a long time.
        ([(1e30, 1.0), (1.0, -1e30), (-1.1e6, 1.0), (1.0, 1.1e5)], "absurd"),
    ],
)
def test_values_that_no_motor_ever_had(tmp_path: Path, values: list[tuple[float, float]], reason: str) -> None:
    ingest = Ingest(make_config(tmp_path, axis3()), "bus0")
    for k, (torque, speed) in enumerate([*values, (1.0, 2.0)]):
        t_us = START_US + 5000 * k
        frames = [
            Frame(t_us, 0x120, False, struct.pack("<Bf3x", 1, torque)),
            Frame(t_us, 0x120, False, struct.pack("<Bf3x", 2, speed)),
        ]
        assert bool(fed(ingest, frames)) == (k == len(values))
    ingest.flush()
    assert axis_drops(ingest, "r.three") == {reason: len(values), "unpaired": len(values)}


@pytest.mark.parametrize("message", ["Torque1", "Angle1"])
def test_a_counter_in_either_message_gives_the_time(tmp_path: Path, message: str) -> None:
    ingest = Ingest(make_config(tmp_path, axis1(time=counted(message))), "bus0")
    late_us = [0, 900, 300, 0, 1700]
    frames = [
        frame
        for k, late in enumerate(late_us)
        for frame in (
            torque1(START_US + 5000 * k + late, 1.0, 254 + k),
            angle1(START_US + 5000 * k + late, 2.0, 254 + k),
        )
    ]
    samples = fed(ingest, frames)["r.one"]
    assert [s.t_us for s in samples] == [START_US + 5000 * k for k in range(5)]


def test_a_counter_tells_repeated_frames_and_gaps(tmp_path: Path) -> None:
    ingest = Ingest(make_config(tmp_path, axis2(time=counted("Both2"))), "bus0")
    counts = [65534, 65535, 65535, 0, 65534, 4]
    received = [0, 5000, 5050, 10_000, 10_050, 30_000]
    frames = [both2(START_US + t, 1.0, 2.0, n) for t, n in zip(received, counts, strict=True)]
    times = [s.t_us - START_US for s in fed(ingest, frames)["r.two"]]
    assert times == [0, 5000, 10_000, 30_000]
    assert axis_drops(ingest, "r.two") == {"repeated": 2, "out_of_order": 2, "missing": 3}
    assert ingest.axes["r.two"].events == {"clock_reanchored": 0, "clock_set_back": 0}


def test_values_as_decoded(tmp_path: Path) -> None:
    axis = axis2(time=counted("Both2"))
    axis["torque"]["factor"] = 2.0
    ingest = Ingest(make_config(tmp_path, axis), "bus0")
    frames = [both2(START_US, 1.5, 20.0, 7), Frame(START_US, 0x140, False, bytes(8))]
    frames.append(both2(START_US + 5000, 2.5, 30.0, 8))
    found = [
        (v.axis_id, v.quantity, v.message, v.signal, v.t_us.tolist(), v.physical.tolist(), v.si.tolist())
        for v in ingest.feed_values(FrameBlock.from_frames(frames))
    ]
    times = [START_US, START_US + 5000]
    assert found == [
        ("r.two", "torque", "Both2", "Torque", times, [1.5, 2.5], [3.0, 5.0]),
        ("r.two", "speed", "Both2", "Speed", times, [20.0, 30.0], [20.0, 30.0]),
        ("r.two", "counter", "Both2", "Count", times, [7.0, 8.0], [7.0, 8.0]),
    ]
    assert drops(ingest) == {"unwanted": 1}
