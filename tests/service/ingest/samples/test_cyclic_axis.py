"""Axes whose controller sends in cycles: frames in, samples at whole cycles out."""

import random
import struct
from pathlib import Path
from typing import Any

import pytest

from monitor_core.sampling.controller_cycle import WINDOW
from service.can.frames import Frame
from service.ingest.samples.bus_samples import Ingest
from tests.service.ingest.plant import (
    START_US,
    Sample,
    angle1,
    axis1,
    axis2,
    axis3,
    axis_drops,
    both2,
    fed,
    flushed,
    make_config,
    torque1,
)

CYCLE_US = 5000
LATEST_US = 1500
"""How late a frame may be."""
CYCLIC: dict[str, Any] = {"time": {"clock": "cyclic"}}


def sampled(ingest: Ingest, frames: list[Frame], axis_id: str) -> list[Sample]:
    return fed(ingest, frames).get(axis_id, []) + flushed(ingest).get(axis_id, [])


def test_torque_and_motion_of_one_frame(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    ingest = Ingest(make_config(tmp_path, axis2(**CYCLIC)), "bus0")
    cycles = [n for n in range(4000) if n == 0 or rng.random() > 0.02]
    frames = [both2(START_US + CYCLE_US * n + (rng.randrange(LATEST_US) if n else 0), 1.0, n / 16) for n in cycles]
    samples = sampled(ingest, frames, "r.two")
    assert [s.motion for s in samples] == [n / 16 for n in cycles]
    late_us = [s.t_us - START_US - 16 * s.motion * CYCLE_US for s in samples]
    assert all(abs(late) < LATEST_US for late in late_us)  # of the first ten frames none may have been early
    assert all(abs(late) < LATEST_US / 3 for late in late_us[WINDOW:])
    assert axis_drops(ingest, "r.two") == {"missing": cycles[-1] + 1 - len(cycles)}
    stamps = ingest.axes["r.two"].stamps
    assert stamps.clock == "cyclic"
    assert stamps.scatter_s == pytest.approx(LATEST_US * 1e-6 / 12**0.5, rel=0.15)
    assert stamps.interval_s == pytest.approx(0.005, rel=1e-4)


@pytest.mark.parametrize("torque_first", [True, False])
def test_two_messages_that_are_late_each_by_itself_pair_by_their_cycles(
    tmp_path: Path, seed: int, *, torque_first: bool
) -> None:
    """By times of receipt one in eight would not: one is late by the tolerance of 2 ms more than the other."""
    rng = random.Random(seed)
    ingest = Ingest(make_config(tmp_path, axis1(**CYCLIC)), "bus0")
    frames, lost = list[Frame](), 0
    for n in range(4000):
        two = [torque1, angle1] if torque_first else [angle1, torque1]
        for k, make_frame in enumerate(two):
            if n > 40 and rng.random() < 0.01:
                lost += 1
                continue
            late_us = min(3500, round(rng.expovariate(1 / 700))) if n else 0
            value = n % 16 if make_frame is torque1 else n / 16
            frames.append(make_frame(START_US + CYCLE_US * n + 300 * k + late_us, value))
    frames.sort(key=lambda f: f.t_us)
    samples = sampled(ingest, frames, "r.one")
    assert all(s.torque == (s.motion * 16) % 16 for s in samples)
    steps = [16 * s.motion - (s.t_us - START_US) / CYCLE_US for s in samples]
    assert sum(abs(step) > 0.3 for step in steps) < 10
    # Each lost value leaves the other one alone; both may be lost together.
    assert axis_drops(ingest, "r.one")["unpaired"] == pytest.approx(lost, abs=12)
    assert len(samples) == pytest.approx(4000 - lost, abs=12)


def test_a_value_waits_while_the_cycle_of_its_partner_is_not_known(tmp_path: Path) -> None:
    ingest = Ingest(make_config(tmp_path, axis1(**CYCLIC)), "bus0")
    frames = list[Frame]()
    for n in range(200):
        t_us = START_US + CYCLE_US * n
        frames.append(angle1(t_us, n / 16))
        if n != 100:  # and the next one is so late that it comes with the one after it
            frames.append(torque1(t_us + (3500 if n == 101 else 300), n % 16))
    samples = sampled(ingest, frames, "r.one")
    assert [16 * s.motion for s in samples] == [n for n in range(200) if n != 100]
    assert all(s.torque == 16 * s.motion % 16 for s in samples)
    assert axis_drops(ingest, "r.one") == {"unpaired": 1, "missing": 1}


def test_multiplexed_torque_and_speed(tmp_path: Path) -> None:
    ingest = Ingest(make_config(tmp_path, axis3(**CYCLIC)), "bus0")
    frames = [
        Frame(START_US + CYCLE_US * n + 500 * k, 0x120, False, struct.pack("<Bf3x", 1 + k, float(n + k)))
        for n in range(300)
        for k in (0, 1)
    ]
    samples = sampled(ingest, frames, "r.three")
    assert samples == [Sample(START_US + CYCLE_US * n + 500, n, n + 1) for n in range(300)]


def test_a_frame_that_is_held_has_the_further_signals_of_the_moment(tmp_path: Path) -> None:
    signal = [{"name": "what", "message": "Other", "signal": "Something"}]
    gate = [{"signal": "what", "above": 0.0}]
    ingest = Ingest(make_config(tmp_path, axis2(**CYCLIC, signal=signal, gate=gate)), "bus0")
    frames = [both2(START_US + CYCLE_US * n, 1.0, n / 16) for n in (*range(100), 103)]
    frames.insert(50, Frame(frames[50].t_us, 0x140, False, bytes([7, *bytes(7)])))
    samples = sampled(ingest, frames, "r.two")
    assert len(samples) == 101
    assert [s.signals for s in samples[50:]] == [(7.0,)] * 51
