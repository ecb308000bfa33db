"""A bus that only a table of ids describes; and a torque that is sent as a current."""

import random
from pathlib import Path
from typing import Any

import pytest

from service.can.frames import Frame
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


def test_a_current_is_sent_as_one(tmp_path: Path) -> None:
    """By simulate and play; and read from a column."""
    config = plant.make_config(tmp_path, axis(kT_Nm_per_A=KT), messages=None, message=table())
    sent = FrameEncoder(config, "bus0").encode({"r.a": (2.0, 1.0)}, 3)
    drive = next(frame.data for frame in sent if frame.key.can_id == 0x181)
    assert int.from_bytes(drive[:2], "little", signed=True) * 0.0625 == 2.0 / KT
    file = plant.write_table(tmp_path / "a.csv", {"torque_a": [8.0, 16.0], "angle_a": [0.0, 0.1]})
    (step,) = read_record(file, config).steps()
    assert step.samples["r.a"].u.tolist() == pytest.approx([8 * KT, 16 * KT])
