"""The simulated robot: all axes of a configuration, sample by sample, with faults; and in real time on open buses."""

import heapq
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from service.can.bus import Bus, send
from service.config import Config, given_values
from service.ingest.samples.arm_motions import ArmMotions
from service.ingest.samples.encode import FrameEncoder
from service.simulation.axis import ControlledAxis, SimulatedSample


class SimulatedFault(NamedTuple):
    """A change of parameters of an axis by factors, at a time."""

    axis_id: str
    factors: Mapping[str, float]
    after_s: float


class Moment(NamedTuple):
    """Axes that are sampled at the same moment: time since the start, number of the sample."""

    time_s: float
    interval_s: float
    number: int
    readings: Mapping[str, SimulatedSample]


class FaultError(Exception):
    """A fault that cannot be simulated; the text says why."""


class SimulatedRobot:
    """All axes of a configuration.

    Args:
        config: the configuration.
        seed: seed of noise and test signals.
        faults: the faults and their times.
        may_break: a fault that is due occurs only when this is true.

    Raises:
        FaultError: a fault of a parameter that does not exist, or with an impossible value.
    """

    def __init__(
        self,
        config: Config,
        seed: int | None = None,
        faults: Sequence[SimulatedFault] = (),
        may_break: Callable[[], bool] = lambda: True,
    ) -> None:
        self._may_break = may_break
        rng = np.random.default_rng(seed)
        self._axes = {axis.id: ControlledAxis(axis, rng) for axis in config.axes}
        self._sent: dict[str, dict[str, float]] = {robot.name: {} for robot in config.robot}
        self._faults = sorted(faults, key=lambda fault: fault.after_s)
        for fault in faults:
            _try_out(fault, config)

    def moments(self, happened: Callable[[SimulatedFault], None] = lambda _: None) -> Iterator[Moment]:
        """Endless samples in order of time; ``happened`` is called for each fault."""
        waiting = list(self._faults)
        groups = [(0.0, interval_s, 0) for interval_s in sorted({a.interval_s for a in self._axes.values()})]
        while True:
            time_s, interval_s, k = heapq.heappop(groups)
            while waiting and waiting[0].after_s <= time_s and self._may_break():
                fault = waiting.pop(0)
                self._axes[fault.axis_id].break_down(fault.factors)
                happened(fault)
            axes = [(i, axis) for i, axis in self._axes.items() if axis.interval_s == interval_s]
            yield Moment(time_s, interval_s, k, {i: self._sample(axis, k) for i, axis in axes})
            heapq.heappush(groups, ((k + 1) * interval_s, interval_s, k + 1))

    def _sample(self, axis: ControlledAxis, k: int) -> SimulatedSample:
        """The sample of an axis; its motion becomes available to the other axes, as on the bus."""
        named = axis.axis
        sent, motion = self._sent[named.robot], named.config.motion
        reading = axis.sample(k, sent)
        if motion.factor:
            sent[named.config.name] = (reading.motion - motion.offset) / motion.factor
        return reading


def _try_out(fault: SimulatedFault, config: Config) -> None:
    axis = next(axis for axis in config.axes if axis.id == fault.axis_id)
    try:
        ControlledAxis(axis, np.random.default_rng(0)).break_down(fault.factors)
    except KeyError as error:
        known = ", ".join(given_values(axis.config))
        raise FaultError(f"fault: no parameter {error} in axis {axis.id}; there is {known}") from None
    except (ValueError, ZeroDivisionError) as error:
        raise FaultError(f"fault: {error}") from None


# --- In real time on open buses ---------------------------------------------------------------------------------------


CATCH_UP = 0.7
"""Smallest distance of late samples, in intervals: as on a real bus they never come in a bunch."""

LATEST_S = 0.4
"""Samples later than this [s] are left out: a controller sends at the right time or not at all, and a monitor that
follows its counter takes a delay of more than half a second for a changed clock."""

Send = Callable[[Moment], int]
"""Sends the frames of a moment and returns their number."""


def sender(config: Config, buses: Mapping[str, Bus]) -> Send:
    """Sends moments on open buses; a bus that keeps times gets those since the first moment.

    Raises:
        BusError: a bus does not take a frame.
        DescriptionError, IngestError: the configuration cannot be used, or a value does not fit into its signal.
    """
    encoders = {bus.name: FrameEncoder(config, bus.name) for bus in config.bus}
    began_s: float | None = None

    def send_moment(moment: Moment) -> int:
        nonlocal began_s
        began_s = time.time() - moment.time_s if began_s is None else began_s
        # All frames are encoded first and then sent, so that those of a moment are close together on the bus.
        frames = [(buses[n], f) for n, e in encoders.items() for f in e.encode(moment.readings, moment.number)]
        for bus, (key, data) in frames:
            send(bus, key, data, began_s + moment.time_s)
        return len(frames)

    return send_moment


class Sent(NamedTuple):
    """Counts of a robot: sent frames, and moments that were left out because this machine was too busy."""

    frames: int
    left_out: int


def run_robot(
    robot: SimulatedRobot,
    send_moment: Send,
    stop: threading.Event,
    happened: Callable[[SimulatedFault], None] = lambda _: None,
    duration_s: float | None = None,
    latest_s: float = LATEST_S,
    catch_up: float = CATCH_UP,
) -> Sent:
    """Send the samples of a robot on a schedule that does not drift; those later than ``latest_s`` are left out.

    Late samples have a distance of at least ``catch_up`` intervals.  It ends when ``stop`` is set, or after
    ``duration_s``.
    """
    start = time.monotonic()
    frames, left_out, sending = 0, 0, True
    earliest = dict[float, float]()
    for moment in robot.moments(happened):
        now, planned = time.monotonic(), start + moment.time_s
        if stop.is_set() or (duration_s is not None and moment.time_s >= duration_s):
            break
        sending = planned > now - (latest_s if sending else 0.0)
        if not sending:
            left_out += 1
            continue
        wait_s = max(planned, earliest.get(moment.interval_s, start)) - now
        if wait_s > 0 and stop.wait(wait_s):
            break
        frames += send_moment(moment)
        earliest[moment.interval_s] = time.monotonic() + catch_up * moment.interval_s
    return Sent(frames, left_out)


# --- A record of a robot that has no bus: a table, as fast as it can be computed --------------------------------------


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
    faults: Sequence[SimulatedFault] = (),
) -> Iterator[str]:
    """The lines of a CSV file with the samples of the robot of a configuration.

    Args:
        config: configuration whose axes are simulated; all have the same interval.
        seconds: duration of the record.
        seed: seed of noise and test signals; the same one gives the same lines.
        progress: called with the completed share.
        faults: the faults and their times; empty: a healthy robot.
    """
    yield ",".join(columns_of(config)) + "\n"
    arm = ArmMotions(config.axes)
    for moment in SimulatedRobot(config, seed, faults).moments():
        if moment.time_s >= seconds:
            return
        if moment.number % 1000 == 0:
            progress(moment.time_s / seconds)
        motions = arm.take({axis_id: reading.motion for axis_id, reading in moment.readings.items()})
        values = [f"{v:.7g}" for axis in config.axes for v in (moment.readings[axis.id].torque, motions[axis.id])]
        yield ",".join([f"{moment.time_s:.6f}", *values]) + "\n"
