"""A bus that only a table of ids describes; and a torque that is sent as a current."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from service.can.frames import Frame, FrameBlock, FrameFilter
from service.can.messages import DescriptionError
from service.ingest.records.record_files import read_record
from service.ingest.samples.bus_samples import Ingest
from service.ingest.samples.encode import FrameEncoder
from tests.service.drive_descriptions import table
from tests.service.ingest import plant

KT = -0.125


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
    """By simulate and play; it is read as one from the bus and from a column."""
    axis = plant.axis("a", ("Drive", "Torque"), ("Motion", "Angle"), "angle")
    axis["torque"] |= {"kT_Nm_per_A": KT, "offset": 0.5}
    config = plant.make_config(tmp_path, axis, messages=None, message=table())
    sent = FrameEncoder(config, "bus0").encode({"r.a": (2.0, 1.0)}, 3)
    frames = [Frame(0, *frame.key, frame.data) for frame in sent]
    drive = next(frame.data for frame in frames if frame.can_id == 0x181)
    assert int.from_bytes(drive[:2], "little", signed=True) * 0.0625 == 2.0 / KT - 0.5
    assert plant.fed(Ingest(config, "bus0"), frames) == {"r.a": [plant.Sample(0, 2.0, 1.0)]}
    file = plant.write_table(tmp_path / "a.csv", {"torque_a": [8.0, 16.0], "angle_a": [0.0, 0.1]})
    (step,) = read_record(file, config).steps()
    assert step.samples["r.a"].u.tolist() == pytest.approx([8.5 * KT, 16.5 * KT])
