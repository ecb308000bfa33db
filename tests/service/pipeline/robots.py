"""Frames of a simulated robot, without real time, and what the daemon and a replay make of them."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from service.can.bus_reader import BusSnapshot
from service.can.frames import Frame, FrameBlock
from service.commands.command_line.exit_codes import OK
from service.config import AxisConfig, Config, load
from service.ingest.samples.encode import Encoded, FrameEncoder
from service.pipeline.axes.axis_alarms import AxisAlarm
from service.pipeline.axes.axis_monitors import FramePipeline
from service.simulation.axis import SimulatedSample
from service.simulation.robot import Moment, SimulatedFault, SimulatedRobot
from tests.service.command_line import as_json

DEMO = Path(__file__).resolve().parents[3] / "config" / "demo.toml"
START_US = 1_760_000_000_000_000


def demo(folder: Path, axes: int = 2, **service: float) -> Config:
    """The demo's configuration for its first axes, with its state in a folder."""
    config = load(DEMO, {})
    kept = config.service.model_copy(update={"state_dir": folder, **service})
    return with_axes(config, config.robot[0].axis[:axes]).model_copy(update={"service": kept})


def with_axes(config: Config, axes: Sequence[AxisConfig]) -> Config:
    """The configuration of a robot that has these axes."""
    robot = config.robot[0].model_copy(update={"axis": tuple(axes)})
    return config.model_copy(update={"robot": (robot,)})


def on_bus(config: Config, **values: object) -> Config:
    """The configuration with other values of its bus."""
    return config.model_copy(update={"bus": (config.bus[0].model_copy(update=values),)})


def changed(config: Config, only: str = "", **parts: Any) -> Config:
    """Each axis, or only the one of that name, with other values; a mapping changes those keys of a table."""

    def with_parts(axis: AxisConfig) -> AxisConfig:
        new = {
            name: getattr(axis, name).model_copy(update=value) if isinstance(value, Mapping) else value
            for name, value in parts.items()
        }
        return axis.model_copy(update=new) if only in ("", axis.name) else axis

    return with_axes(config, [*map(with_parts, config.robot[0].axis)])


def moments(
    config: Config,
    seconds: float,
    seed: int,
    faults: Sequence[SimulatedFault] = (),
    measured: Callable[[Moment], Mapping[str, SimulatedSample]] = lambda moment: moment.readings,
) -> Iterator[tuple[float, list[Encoded]]]:
    """Times since the start, and the frames that a robot sends then."""
    encoder = FrameEncoder(config, config.bus[0].name)
    for moment in SimulatedRobot(config, seed, faults).moments():
        if moment.time_s >= seconds:
            return
        yield moment.time_s, encoder.encode(measured(moment), moment.number)


def blocks(
    config: Config,
    seconds: float,
    seed: int,
    faults: Sequence[SimulatedFault] = (),
    every_s: float = 0.1,
    measured: Callable[[Moment], Mapping[str, SimulatedSample]] = lambda moment: moment.readings,
) -> Iterator[FrameBlock]:
    """The frames of a robot in blocks of that length."""
    block: list[Frame] = []
    ends_s = every_s
    for time_s, sent in moments(config, seconds, seed, faults, measured):
        if time_s >= ends_s:
            yield FrameBlock.from_frames(block)
            block, ends_s = [], ends_s + every_s
        block += [Frame(START_US + round(time_s * 1e6), *f.key, f.data) for f in sent]
    yield FrameBlock.from_frames(block)


def live(core: FramePipeline, frames: Iterable[FrameBlock], bus: str = "can0") -> list[AxisAlarm]:
    """The daemon's core over blocks of frames to their end; returns all changes of alarms."""
    changes = []
    for block in frames:
        core.take(bus, block)
        changes += core.update()
    core.flush()
    return changes + core.update()


def cut(frames: Sequence[Frame], every: int) -> Iterator[FrameBlock]:
    """Blocks of that number of frames."""
    return (FrameBlock.from_frames(frames[k : k + every]) for k in range(0, len(frames), every))


def replayed(file: Path, *records: Path, code: int = OK) -> dict[str, Any]:
    """The first axis of a replay."""
    return dict(as_json("replay", "--config", file, *records, "--json", "-", code=code)["axes"][0])


class Waiting:
    """A reader whose frames are there from the start."""

    def __init__(self, frames: Sequence[Frame] = ()) -> None:
        self.frames = list(frames)
        self.received = len(self.frames)

    def take(self, most: int = 4096) -> FrameBlock:
        taken, self.frames = self.frames[:most], self.frames[most:]
        return FrameBlock.from_frames(taken)

    def stats(self) -> BusSnapshot:
        return BusSnapshot("can0", "up", self.received, {"queue_full": 0})
