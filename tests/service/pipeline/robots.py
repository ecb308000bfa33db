"""Frames of a simulated robot, without real time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from service.can.bus_reader import ReaderStats
from service.can.frames import Frame
from service.config import Config, load
from service.ingest.encode import FrameEncoder
from service.simulation.robot import Fault, SimulatedRobot

DEMO = Path(__file__).resolve().parents[3] / "config" / "demo.toml"
START_US = 1_760_000_000_000_000


def demo(folder: Path, axes: int = 2, **service: float) -> Config:
    """The demo's configuration for its first axes, with its state in a folder."""
    config = load(DEMO, {})
    robot = config.robot[0].model_copy(update={"axis": config.robot[0].axis[:axes]})
    kept = config.service.model_copy(update={"state_dir": folder, **service})
    return config.model_copy(update={"robot": (robot,), "service": kept})


def blocks(
    config: Config, seconds: float, seed: int, faults: Sequence[Fault] = (), every_s: float = 0.1
) -> Iterator[list[Frame]]:
    """The frames of a robot in blocks of that length."""
    encoder = FrameEncoder(config, config.bus[0].name)
    block: list[Frame] = []
    ends_s = every_s
    for moment in SimulatedRobot(config, seed, faults).moments():
        if moment.time_s >= ends_s or moment.time_s >= seconds:
            yield block
            block, ends_s = [], ends_s + every_s
        if moment.time_s >= seconds:
            return
        t_us = START_US + round(moment.time_s * 1e6)
        block += [
            Frame(t_us, f.key.can_id, f.key.extended, f.data)
            for f in encoder.encode(moment.readings, moment.number)
        ]


class Waiting:
    """A reader whose frames are there from the start."""

    def __init__(self, frames: Sequence[Frame] = ()) -> None:
        self.frames = list(frames)
        self.received = len(self.frames)

    def take(self, most: int = 4096) -> list[Frame]:
        taken, self.frames = self.frames[:most], self.frames[most:]
        return taken

    def stats(self) -> ReaderStats:
        return ReaderStats("up", True, self.received, {"queue_full": 0})
