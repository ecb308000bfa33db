"""A table of a simulated robot, as fast as it can be computed: the record of a robot that has no bus."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from service.config import Config
from service.simulation.robot import Fault, SimulatedRobot

TIME = "t"


def columns_of(config: Config) -> list[str]:
    """Names of the columns: the time [s], and torque [N m] and motion of each axis."""
    motions = [f"{axis.config.name}_{axis.config.output.split()[-1]}" for axis in config.axes]
    torques = [f"{axis.config.name}_torque" for axis in config.axes]
    return [TIME, *(name for pair in zip(torques, motions, strict=True) for name in pair)]


def table_lines(
    config: Config,
    seconds: float,
    seed: int,
    progress: Callable[[float], None] = lambda _: None,
    faults: Sequence[Fault] = (),
) -> Iterator[str]:
    """The lines of a CSV file with the samples of the robot of a configuration.

    Args:
        config: its axes are simulated, all with the interval of the first.
        seconds: length.
        seed: of noise and test signals; the same one gives the same lines.
        progress: called with the share that is done.
        faults: none, of a healthy robot.

    Raises:
        ValueError: the axes have different intervals.
    """
    intervals = {axis.config.sample_interval_s for axis in config.axes}
    if len(intervals) > 1:
        raise ValueError("a table needs axes with the same interval")
    yield ",".join(columns_of(config)) + "\n"
    for moment in SimulatedRobot(config, seed, faults).moments():
        if moment.time_s >= seconds:
            return
        if moment.number % 1000 == 0:
            progress(moment.time_s / seconds)
        readings = [moment.readings[axis.id] for axis in config.axes]
        values = [f"{v:.7g}" for reading in readings for v in (reading.torque, reading.motion)]
        yield ",".join([f"{moment.time_s:.6f}", *values]) + "\n"
