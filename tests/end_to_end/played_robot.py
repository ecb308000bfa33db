"""A record of the simulated robot, and its play on the bus."""

import subprocess
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from service.can.frame_recorder import FrameRecorder
from service.config import Config, load
from service.simulation.robot import SimulatedFault
from tests.end_to_end.processes import running
from tests.service.pipeline.robots import blocks


def write_log(path: Path, config: Config, seconds: float, seed: int, faults: Sequence[SimulatedFault]) -> None:
    """What `run --record` would write."""
    with FrameRecorder(path) as recorder:
        for block in blocks(config, seconds, seed, faults):
            recorder.write(config.bus[0].name, block)


def played_robot(
    config: Path, seconds: float, seed: int, *faults: SimulatedFault
) -> AbstractContextManager[subprocess.Popen[bytes]]:
    """The simulated robot, of which no sample lacks on a busy machine: a record of it is played."""
    record = config.with_name("robot.log")
    write_log(record, load(config, {}), seconds, seed, faults)
    return running("play", "--config", config, record, log=config.with_name("played.txt"))
