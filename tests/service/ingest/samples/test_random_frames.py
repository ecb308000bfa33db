"""Random frames on random buses: nothing but samples comes out, and every frame is accounted for.

A bus has a DBC of random messages, and axes that use any of their signals.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from cantools.database.can import Database, Message, Signal
from cantools.database.conversion import BaseConversion
from cantools.database.errors import Error

from monitor_core.samples import PHYSICAL_LIMITS, SampleBlock
from service.can.frames import FD_BYTES, FrameBlock
from service.config.schema import Config
from service.ingest.samples.bus_samples import Ingest
from tests.service.ingest.plant import make_config

START_US = 1_760_000_000_000_000
LENGTHS = [*range(1, 9), 12, 24, 64]
SCALES = [1, 0.5, 0.001, -0.1, 1e-9, 3, 1e6]


class RandomBus(NamedTuple):
    """A configuration, and the ids, as in the records of frames, that its messages have."""

    config: Config
    ids: list[int]


def random_bus(folder: Path, rng: random.Random) -> RandomBus:
    """Up to eight messages, multiplexed ones and CAN FD among them, and up to six axes."""
    messages = [_message(rng, number) for number in range(rng.randint(2, 8))]
    (folder / "random.dbc").write_text(Database(messages).as_dbc_string(), encoding="utf-8")
    places = [(message.name, signal.name) for message in messages for signal in message.signals]
    axes = [_axis(rng, number, messages, places) for number in range(rng.randint(1, 6))]
    ids = [message.frame_id | message.is_extended_frame << 31 for message in messages]
    return RandomBus(make_config(folder, *axes, messages="random.dbc"), ids)


def _message(rng: random.Random, number: int) -> Message:
    extended, length, paged = rng.random() < 0.4, rng.choice(LENGTHS), rng.random() < 0.3
    # Each a number of its own, so that no two have the same.
    frame_id = (rng.randrange(1 << 26) << 3 if extended else rng.randrange(1 << 8) << 3) + number
    signals = [Signal("Page", 0, 3, is_multiplexer=True)] if paged else []
    message: Message | None = None
    while message is None or rng.random() < 0.8:
        more = [*signals, _signal(rng, f"S{number}_{len(signals)}", length, paged)]
        try:
            message = Message(frame_id, f"M{number}", length, more, is_extended_frame=extended, strict=True)
            signals = more
        except Error:  # it overlaps others
            if message is None and length == 1:
                signals, paged = [], False
    return message


def _signal(rng: random.Random, name: str, length: int, paged: bool) -> Signal:
    is_float = length >= 4 and rng.random() < 0.3
    bits = rng.choice([32, 64] if length >= 8 else [32]) if is_float else rng.randint(1, min(64, 8 * length))
    first, big = rng.randint(0, 8 * length - bits), rng.random() < 0.5
    return Signal(
        name,
        8 * (first // 8) + 7 - first % 8 if big else first,
        bits,
        byte_order="big_endian" if big else "little_endian",
        is_signed=not is_float and rng.random() < 0.5,
        conversion=BaseConversion.factory(rng.choice(SCALES), rng.choice([0, -40, 0.25]), None, is_float),
        multiplexer_signal="Page" if paged else None,
        multiplexer_ids=rng.sample(range(8), rng.randint(1, 3)) if paged else None,
    )


def _axis(rng: random.Random, number: int, messages: list[Message], places: list[tuple[str, str]]) -> dict[str, Any]:
    (torque, motion, further) = (rng.choice(places) for _ in range(3))
    counters = [
        (message.name, signal.name)
        for message in messages
        if message.name in (torque[0], motion[0])
        for signal in message.signals
        if signal.conversion.scale == 1 and signal.conversion.offset == 0 and not signal.conversion.is_float
    ]
    time: dict[str, Any] = {"clock": rng.choice(["receipt", "cyclic"])}
    if counters and rng.random() < 0.4:
        time = dict(zip(("counter_message", "counter_signal"), rng.choice(counters), strict=True))
    output = rng.choice(["angle", "speed"])
    wraps = {"wrap_period": 360.0} if output == "angle" and rng.random() < 0.3 else {}
    return {
        "name": f"a{number}",
        "bus": "bus0",
        "sample_interval_s": rng.choice([0.001, 0.005, 0.02]),
        "torque": {"message": torque[0], "signal": torque[1]},
        output: {"message": motion[0], "signal": motion[1], **wraps},
        "time": time,
        "signal": [{"name": "further", "message": further[0], "signal": further[1]}],
        "gate": [{"signal": "further", "above": 0.0}],
        "model": {"monitor": ["kT"], "nominal": {"kT": 1.0}},
        "estimator": {},
    }


def random_frames(rng: random.Random, ids: list[int], count: int, from_us: int) -> FrameBlock:
    """Frames of these ids and of others, of any length, in any order of time, with any data."""
    numbers = np.random.default_rng(rng.randrange(2**32))
    steps = numbers.choice([0, 1, 200, 1000, 5000, 20_000, -3000, 10**7], count, p=[0.1] * 4 + [0.3, 0.2, 0.09, 0.01])
    chosen = np.array([*ids, *ids, 0x123, 0x80000123, 0x1FFFFFFF | 1 << 31], np.int64)
    lengths = numbers.choice([*range(9), 12, 24, 48, *[64] * 20], count)
    data = numbers.integers(0, 256, (count, FD_BYTES), np.uint8)
    data[numbers.random(count) < 0.1] = 0xFF
    data[numbers.random(count) < 0.1] = 0
    return FrameBlock.from_columns(
        from_us + np.cumsum(steps), numbers.choice(chosen, count), lengths, data, np.zeros(count, np.int64)
    )


def feed_random_frames(bus: RandomBus, rng: random.Random, count: int, most: int) -> Counter[str]:
    """Feed frames in blocks of at most so many, and check what comes: values that are numbers, all frames counted.

    Returns how many frames and samples there were, and what was dropped.
    """
    ingest, found, from_us = Ingest(bus.config, "bus0"), Counter[str](), START_US
    outputs = {axis.id: axis.config.output for axis in bus.config.axes}
    needed = {key.record_id: message.length for key, message in ingest.decoder.messages.items()}

    def look(samples_of: Mapping[str, SampleBlock]) -> None:
        for axis_id, samples in samples_of.items():
            found["samples"] += samples.size
            for values, quantity in ((samples.u, "torque"), (samples.y, outputs[axis_id])):
                assert np.all(np.abs(values) <= PHYSICAL_LIMITS[quantity])  # what is no number is not

    unwanted = too_short = 0
    while found["frames"] < count:
        frames = random_frames(rng, bus.ids, min(rng.randint(1, most), count - found["frames"]), from_us)
        from_us, found["frames"] = int(frames.t_us[-1]), found["frames"] + frames.size
        look(ingest.feed(frames))
        lengths = np.array([needed.get(record_id, -1) for record_id in frames.ids.tolist()])
        unwanted += int(np.count_nonzero(lengths < 0))
        too_short += int(np.count_nonzero(frames.lengths < lengths))
    look(ingest.flush())
    assert (ingest.dropped["unwanted"], ingest.dropped["too_short"]) == (unwanted, too_short)
    return found + Counter(ingest.dropped)


@pytest.mark.parametrize(
    ("buses", "frames", "most"), [(10, 1000, 200), pytest.param(200, 5000, 500, marks=pytest.mark.soak)]
)
def test_random_frames_on_random_buses(tmp_path: Path, seed: int, buses: int, frames: int, most: int) -> None:
    rng, found = random.Random(seed), Counter[str]()
    for _ in range(buses):
        found += feed_random_frames(random_bus(tmp_path, rng), rng, frames, most)
    assert found["frames"] == buses * frames
    for what in ("samples", "unwanted", "too_short", "signal_absent"):
        assert found[what] > found["frames"] / 100
