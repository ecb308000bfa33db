"""However a stream of frames is cut into blocks, samples, counts and stamps are the same to the last bit."""

from __future__ import annotations

import itertools
import random
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.can.frames import Frame, FrameBlock
from service.config import Config
from service.ingest.samples.bus_samples import Ingest
from tests.service.ingest.plant import (
    START_US,
    angle1,
    axis1,
    axis2,
    axis3,
    axis4,
    both2,
    counted,
    fed,
    flushed,
    make_config,
    torque1,
)

CYCLE_US = 5000
HEAT = {"name": "heat", "message": "Other", "signal": "Something", "max_age_s": 0.1}


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Config:
    """A counter in one of two messages, cycles in one message, receipt on two pages and on CAN FD; held signals."""
    motion = {"name": "other", "axis": "two"}
    gates: list[dict[str, Any]] = [{"signal": "heat", "above": 0.0}, {"signal": "other", "above": 0.0}]
    return make_config(
        tmp_path_factory.mktemp("cuts"),
        axis1(time=counted("Angle1"), signal=[HEAT, motion], gate=gates),
        axis2(time={"clock": "cyclic"}),
        axis3(signal=[HEAT], gate=gates[:1]),
        axis4(),
    )


def traffic(rng: random.Random, cycles: int) -> list[Frame]:
    """Late, lost, repeated, short, foreign and out of order; the host stalls, and its clock jumps."""
    found, jump_us, stalled_us = list[Frame](), 0, 0
    for n in range(cycles):
        t_us = START_US + CYCLE_US * n + jump_us
        wide = struct.pack("<f", n) + bytes(56) + struct.pack("<f", -n)
        sent = [
            torque1(t_us, n % 16),
            angle1(t_us + 300, n / 16, n),
            both2(t_us + 600, n % 16, n / 16, n),
            *(Frame(t_us + 700 + p, 0x120, False, struct.pack("<Bf3x", p, n)) for p in (1, 2)),
            Frame(t_us + 900, 0x130, False, wide),
            Frame(t_us + 1000, 0x140, False, bytes([n % 256])),
        ]
        if rng.random() < 0.01:
            stalled_us = t_us + rng.choice([30_000, 700_000])
            jump_us += rng.choice([0, 0, -3_600_000_000, 2_000_000])
        for frame in sent:
            late_us = max(frame.t_us + round(rng.expovariate(1 / 500)), min(stalled_us, t_us + 700_000))
            for _ in range(rng.choice([0, *[1] * 30, 2])):
                data = frame.data[: rng.choice([*[64] * 30, 2])]
                found.append(frame._replace(t_us=late_us, data=data))
        if rng.random() < 0.05:
            k = rng.randrange(1, len(sent))
            found[-k:] = rng.sample(found[-k:], len(found[-k:]))
    return found


def seen(config: Config, blocks: Sequence[Sequence[Frame]]) -> Any:
    """Everything that comes of these blocks, with the bits of all numbers."""
    ingest = Ingest(config, "bus0")
    rows: dict[str, list[object]] = {axis_id: [] for axis_id in ingest.axes}
    for found in (*(fed(ingest, block) for block in blocks), flushed(ingest)):
        for axis_id, samples in found.items():
            rows[axis_id] += map(repr, samples)
    facts = {axis_id: (axis.dropped, axis.events, axis.stamps) for axis_id, axis in ingest.axes.items()}
    return rows, facts, ingest.dropped


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32), cuts=st.lists(st.integers(0, 1500), max_size=40))
def test_cuts_change_nothing(config: Config, seed: int, cuts: list[int]) -> None:
    frames = traffic(random.Random(seed), 150)
    ends = sorted({0, len(frames), *(cut for cut in cuts if cut < len(frames))})
    at_once = seen(config, [frames])
    assert seen(config, [frames[a:b] for a, b in itertools.pairwise(ends)]) == at_once
    assert all(rows for rows in at_once[0].values())


def test_frame_by_frame_is_the_same(config: Config, seed: int) -> None:
    frames = traffic(random.Random(seed), 200)
    assert seen(config, [[frame] for frame in frames]) == seen(config, [frames])


def test_a_block_of_other_messages_completes_nothing(config: Config) -> None:
    ingest = Ingest(config, "bus0")
    assert ingest.feed(FrameBlock.from_frames([Frame(START_US, 0x140, False, bytes(8))])) == {}
    assert ingest.feed(FrameBlock(np.zeros(0, FrameBlock.from_frames([]).records.dtype))) == {}
