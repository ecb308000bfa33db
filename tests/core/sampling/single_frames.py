"""The compiled clocks and the pairing, frame by frame: as tests speak of them."""

from __future__ import annotations

from typing import Any, Generic, Literal, NamedTuple, TypeVar

import numpy as np

from monitor_core.kernel.compile import entry
from monitor_core.samples import PHYSICAL_LIMITS
from monitor_core.sampling import (
    DROP_REASONS,
    counted_interval_s,
    counter_clock,
    cyclic_clock,
    cyclic_interval_s,
    new_pairing,
    time_per_count_s,
)
from monitor_core.sampling.controller_clocks import GIVEN, READY, VALUE
from monitor_core.sampling.controller_cycle import read_cycle, release_held
from monitor_core.sampling.pairing import MOTION, NO_TIME, SAMPLE, TORQUE, add_pair, add_value, flush_pairing
from monitor_core.sampling.sample_counter import count_time

Kind = Literal["torque", "motion"]
LIMITS = PHYSICAL_LIMITS["torque"], PHYSICAL_LIMITS["angle"]
V = TypeVar("V")


@entry
def _count(state: Any, received_us: int, count: float) -> Any:
    return count_time(state[0], received_us, count)


@entry
def _read(state: Any, values: Any, value: Any) -> None:
    read_cycle(state[0], values, value[0])


@entry
def _release(state: Any, values: Any) -> None:
    state[0].ready = 0
    release_held(state[0], values)


@entry
def _add(state: Any, waiting: Any, kind: int, t_us: int, value: float, sample_us: int, sample: Any) -> Any:
    return add_value(state[0], waiting, kind, t_us, value, sample_us, sample[0])


@entry
def _add_pair(state: Any, waiting: Any, t_us: int, torque: float, motion: float, sample_us: int, sample: Any) -> Any:
    return add_pair(state[0], waiting, t_us, torque, motion, sample_us, sample[0])


@entry
def _flush(state: Any, waiting: Any) -> None:
    flush_pairing(state[0], waiting)


class SampleClock:
    """A clock by a counter."""

    def __init__(self, interval_s: float, bits: int) -> None:
        self.clock = counter_clock(interval_s, bits)

    @property
    def reanchored(self) -> int:
        return self.clock.reanchored

    @property
    def interval_s(self) -> float | None:
        return counted_interval_s(self.clock)

    @property
    def time_per_count_s(self) -> float | None:
        return time_per_count_s(self.clock)

    def read(self, received_us: int, raw: int) -> int | str:
        time_us, reason = _count(self.clock.state, received_us, float(raw))
        return int(time_us) if reason == GIVEN else DROP_REASONS[reason]


class CyclicClock(Generic[V]):
    """A clock by cycles; a value stands for those of a frame."""

    def __init__(self, interval_s: float) -> None:
        self.clock = cyclic_clock(interval_s)
        self._content = list[V]()

    @property
    def reanchored(self) -> int:
        return self.clock.reanchored

    @property
    def interval_s(self) -> float | None:
        return cyclic_interval_s(self.clock)

    def read(self, received_us: int, value: V) -> list[tuple[V, int | str]]:
        record = np.zeros(1, VALUE)
        record["received_us"], record["torque"] = received_us, len(self._content)
        self._content.append(value)
        _read(self.clock.state, self.clock.values, record)
        return self._ready()

    def flush(self) -> list[tuple[V, int | str]]:
        _release(self.clock.state, self.clock.values)
        return self._ready()

    def _ready(self) -> list[tuple[V, int | str]]:
        found = self.clock.values[READY, : self.clock.state["ready"][0]]
        columns = (found[name].tolist() for name in ("torque", "time_us", "reason"))
        return [
            (self._content[int(k)], time_us if reason == GIVEN else DROP_REASONS[reason])
            for k, time_us, reason in zip(*columns, strict=True)
        ]


class Paired(NamedTuple):
    """A sample."""

    t_us: int
    torque: float
    motion: float


class Assembler:
    """The pairing of an axis."""

    def __init__(self, interval_s: float, tolerance_s: float, max_gap_s: float) -> None:
        self._pairing = new_pairing(interval_s, tolerance_s, max_gap_s, 1.0, LIMITS)

    @property
    def dropped(self) -> dict[str, int]:
        return self._pairing.counts

    @property
    def clock_set_back(self) -> int:
        return self._pairing.set_back

    def add(self, kind: Kind, t_us: int, value: float, sample_us: int | None = None) -> Paired | None:
        sample, time_us = np.zeros(1, SAMPLE), NO_TIME if sample_us is None else sample_us
        code = TORQUE if kind == "torque" else MOTION
        return _paired(_add(*self._pairing, code, t_us, float(value), time_us, sample), sample)

    def add_pair(self, t_us: int, torque: float, motion: float, sample_us: int | None = None) -> Paired | None:
        sample, time_us = np.zeros(1, SAMPLE), NO_TIME if sample_us is None else sample_us
        return _paired(_add_pair(*self._pairing, t_us, float(torque), float(motion), time_us, sample), sample)

    def flush(self) -> None:
        _flush(*self._pairing)


def _paired(found: bool, sample: Any) -> Paired | None:
    return Paired(*(sample[name][0].item() for name in ("t_us", "torque", "motion"))) if found else None
