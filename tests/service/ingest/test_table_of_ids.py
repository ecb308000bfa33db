"""A bus that only a table of ids describes; and a torque that is sent as a current."""

import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from service.can.frames import Frame, FrameBlock, FrameFilter
from service.can.messages import DescriptionError
from service.ingest.bus_samples import Ingest
from service.ingest.encode import FrameEncoder
from service.ingest.records import read_record
from tests.service.drive_descriptions import FRAMES, dbc
from tests.service.ingest import plant

KT = -0.125


def table() -> list[dict[str, Any]]:
    """The messages of the drive, as a configuration has them."""
    return [
        {
            "name": f.name,
            "id": f.can_id,
            "signal": [
                {
                    "name": s.name,
                    "start_bit": s.start,
                    "length": s.length,
                    "kind": "signed" if s.signed else "unsigned",
                    "byte_order": "big" if s.big else "little",
                    "factor": float(s.factor),
                }
                for s in f.signals
            ],
        }
        for f in FRAMES
    ]


def axis(**torque: float) -> plant.Axis:
    found = plant.axis("a", ("Drive", "Torque"), ("Motion", "Angle"), "angle")
    found["time"] = {"counter_message": "Drive", "counter_signal": "Count"}
    found["torque"].update(torque)
    return found


def test_it_gives_the_samples_of_a_database(tmp_path: Path, seed: int) -> None:
    rng, frames = random.Random(seed), list[Frame]()
    for k in range(20):
        frames.append(Frame(5000 * k, 0x181, False, rng.randbytes(2) + bytes([k, 0])))
        frames.append(Frame(5000 * k + 300, 0x18FF0200, True, bytes([7, 0, rng.randrange(9), k, 0, 0, 0, 0])))
    (tmp_path / "a.dbc").write_text(dbc(), encoding="utf-8")
    by_file = Ingest(plant.make_config(tmp_path, axis(), messages="a.dbc"), "bus0")
    by_table = Ingest(plant.make_config(tmp_path, axis(), messages=None, message=table()), "bus0")
    both = Ingest(plant.make_config(tmp_path, axis(), message=table()), "bus0")
    assert both.decoder.known.source == "plant.dbc and [[bus.message]]"
    expected = plant.fed(by_file, frames)
    assert len(expected["r.a"]) == 20
    assert plant.fed(by_table, frames) == expected == plant.fed(both, frames)
    current = Ingest(plant.make_config(tmp_path, axis(kT_Nm_per_A=KT, offset=0.5), message=table()), "bus0")
    for sample, plain in zip(plant.fed(current, frames)["r.a"], expected["r.a"], strict=True):
        assert sample.torque == KT * plain.torque + KT * 0.5
        assert sample.motion == plain.motion


def passes(filters: Sequence[FrameFilter], frame: Frame) -> bool:
    """As the kernel filters."""
    return any(
        wanted.key.extended == frame.extended and (wanted.key.can_id ^ frame.can_id) & wanted.mask == 0
        for wanted in filters
    )


def test_parameter_groups_of_j1939(tmp_path: Path) -> None:
    """Of any priority and to any destination; from one source, or from any."""
    bits = {"start_bit": 0, "length": 16, "kind": "signed"}
    messages = [
        {"name": "Drive", "pgn": 0xFF31, "source_address": 0x21, "signal": [{"name": "Torque", **bits}]},
        {"name": "Motion", "pgn": 0xEF00, "signal": [{"name": "Angle", **bits}]},
    ]
    found = plant.axis("a", ("Drive", "Torque"), ("Motion", "Angle"), "angle")
    config = plant.make_config(tmp_path, found, messages=None, message=messages)
    ingest = Ingest(config, "bus0")
    torques = [0x18FF3121, 0x0CFF3121, 0x18FF3122, 0x19FF3121, 0x18FF3221]
    motions = [0x18EFFF05, 0x0CEF1207, 0x18EE1207, 0x1AEF1207]
    frames = [
        Frame(5000 * k, can_id, True, bytes([kind, 0]))
        for k in range(4)
        for kind, can_id in ((1, torques[k]), (2, motions[k]))
    ]
    frames.append(Frame(20_000, torques[4], True, b"\1\0"))
    frames.append(Frame(20_000, 0xFF3121 & 0x7FF, False, b"\1\0"))
    samples = plant.fed(ingest, frames)["r.a"]
    assert [(s.t_us, s.torque, s.motion) for s in samples] == [(0, 1.0, 2.0), (5000, 1.0, 2.0)]
    assert ingest.dropped["unwanted"] == len(frames) - 4
    used = {*torques[:2], *motions[:2]}
    assert all(passes(ingest.filter, frame) == (frame.can_id in used) for frame in frames)
    counts = ingest.decoder.known.counted(FrameBlock.from_frames(frames).counts())
    assert sorted(counts.values()) == [2, 2]
    sent = {frame.key.can_id for frame in FrameEncoder(config, "bus0").encode({"r.a": (1.0, 2.0)}, 0)}
    assert sent == {0x18FF3121, 0x18EFFF00}
    twice = [*messages, {**messages[0], "name": "Twin", "source_address": None}]
    with pytest.raises(DescriptionError, match=r"gives its identifier 0x18ff3121 to Twin, too"):
        Ingest(plant.make_config(tmp_path, found, messages=None, message=twice), "bus0")


def test_a_current_is_sent_as_one(tmp_path: Path) -> None:
    """By simulate and play; and read from a column."""
    config = plant.make_config(tmp_path, axis(kT_Nm_per_A=KT), messages=None, message=table())
    sent = FrameEncoder(config, "bus0").encode({"r.a": (2.0, 1.0)}, 3)
    drive = next(frame.data for frame in sent if frame.key.can_id == 0x181)
    assert int.from_bytes(drive[:2], "little", signed=True) * 0.0625 == 2.0 / KT
    file = plant.write_table(tmp_path / "a.csv", {"torque_a": [8.0, 16.0], "angle_a": [0.0, 0.1]})
    (step,) = read_record(file, config).steps()
    assert step.samples["r.a"].u.tolist() == pytest.approx([8 * KT, 16 * KT])
