"""Decoding of the wanted signals in blocks of frames, with the times of what a SYNC has sampled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Ints
from service.can.decode_plan import Column, MessagePlan
from service.can.frames import EXTENDED, FrameBlock, FrameKey
from service.can.messages import Message, MessageSet, find_signal, key_of_message

FRAME_REASONS = ("unwanted", "too_short", "undecodable", "signal_absent")
"""Why a frame gave nothing (or, signal_absent, not all that was wanted): ``Decoder.dropped``."""


class Decoded(NamedTuple):
    """The wanted signals of the frames of one message in a block; each frame has at least one of them."""

    places: Ints
    """Of the frames in the block (N,)"""
    t_us: Ints
    """Times of receipt (N,), of what a SYNC has sampled that of the SYNC"""
    signals: Mapping[str, Column]
    """By name, each (N,)"""


class Decoder:
    """Decodes the wanted signals of a bus."""

    def __init__(self, known: MessageSet) -> None:
        self.known = known
        self._messages: dict[FrameKey, Message] = {}
        self._wanted: dict[FrameKey, tuple[str, ...]] = {}
        self._plans: dict[FrameKey, MessagePlan] = {}
        self._sync: dict[FrameKey, SyncCycle] = {}
        self.dropped = dict.fromkeys(FRAME_REASONS, 0)
        """Frames by reason"""

    def want(self, message: str, signal: str) -> FrameKey:
        """Decode that signal from now on; returns which frames carry it.

        Raises:
            DescriptionError: there is no such message or signal.
        """
        found, _ = find_signal(self.known, message, signal)
        key = key_of_message(found)
        self._messages[key] = found
        self._wanted[key] = tuple(dict.fromkeys((*self._wanted.get(key, ()), signal)))
        self._plans.pop(key, None)
        if (sync := self.known.sync.get(key)) is not None:
            self._sync.setdefault(sync, SyncCycle(sync))
        return key

    @property
    def keys(self) -> tuple[FrameKey, ...]:
        """The frames with wanted signals, and the SYNC that times them: for the filters of the bus."""
        return (*self._messages, *self._sync)

    @property
    def messages(self) -> Mapping[FrameKey, Message]:
        """The messages with wanted signals, by their frames."""
        return self._messages

    def decode(self, frames: FrameBlock) -> dict[FrameKey, Decoded]:
        """The wanted signals in these frames, by message; counts the frames where some or all are missing."""
        found: dict[FrameKey, Decoded] = {}
        left, ids = frames.size, np.ascontiguousarray(frames.ids)  # looked at for each message
        left -= sum(cycle.take(frames) for cycle in self._sync.values())
        for key in self._messages:
            mask = self.known.masks.get(key)
            alike = ids if mask is None else ids & np.uint32(mask | EXTENDED)
            wanted = key.record_id if mask is None else key.record_id & (mask | EXTENDED)
            places = (alike == wanted).nonzero()[0]
            if places.size:
                left -= places.size
                decoded = self._decoded(key, frames, places)
                if decoded.places.size:
                    found[key] = decoded
        self.dropped["unwanted"] += left
        return found

    def _decoded(self, key: FrameKey, frames: FrameBlock, places: Ints) -> Decoded:
        t_us = frames.t_us[places]
        if (sync := self.known.sync.get(key)) is not None:
            t_us = self._sync[sync].times_us(key, frames, places)
        if key not in self._plans:
            self._plans[key] = MessagePlan(self._messages[key], self._wanted[key])
        plan = self._plans[key]
        long = frames.lengths[places] >= plan.length
        if short := places.size - int(np.count_nonzero(long)):
            self.dropped["too_short"] += short
            places, t_us = places[long], t_us[long]
        if not places.size:
            return Decoded(places, np.zeros(0, np.int64), {})
        signals, known = plan.decode(frames.data[places])
        if not plan.multiplexed:
            return Decoded(places, t_us, signals)
        present = np.array([column.present for column in signals.values()]) & known
        self.dropped["undecodable"] += int(np.count_nonzero(~known))
        self.dropped["signal_absent"] += int(np.count_nonzero(known & ~present.all(axis=0)))
        some = present.any(axis=0)
        if not some.all():
            places, t_us = places[some], t_us[some]
            signals = {name: Column(c.values[some], c.present[some]) for name, c in signals.items()}
        return Decoded(places, t_us, signals)


class SyncCycle:
    """The SYNC of a bus, block by block: what a CANopen drive sends after one has been sampled at it.

    All that is sent in one cycle gets the time of its SYNC: torque and motion in two PDOs belong together, and the wait
    of a frame for the bus does not count.  A second frame after the same SYNC shows that one was lost: it keeps its own
    time.
    """

    def __init__(self, key: FrameKey) -> None:
        self.key = key
        self._places = np.zeros(0, np.int64)
        self._times_us = np.zeros(1, np.int64)
        """Of the last SYNC before the block, and of those in it"""
        self._begun = False
        """Whether there was a SYNC before the block"""
        self._answered, self._answering = set[FrameKey](), set[FrameKey]()
        """Messages that have come after the last SYNC before the block, and after the last one in it"""

    def take(self, frames: FrameBlock) -> int:
        """Look at the next block; returns how many SYNCs it has."""
        self._answered = self._answering | (set() if self._places.size else self._answered)
        self._answering = set()
        self._begun = self._begun or bool(self._places.size)
        self._places = np.flatnonzero(frames.ids == self.key.record_id)
        self._times_us = np.concatenate([self._times_us[-1:], frames.t_us[self._places]])
        return len(self._places)

    def times_us(self, key: FrameKey, frames: FrameBlock, places: Ints) -> Ints:
        """The times (N,) of the frames of one message, which are at these places (N,) of the block."""
        cycles = np.searchsorted(self._places, places)
        if cycles[-1] == len(self._places):
            self._answering.add(key)
        before = np.concatenate([[0 if key in self._answered else -1], cycles[:-1]])
        first = (cycles != before) & ((cycles > 0) | self._begun)
        return np.where(first, self._times_us[cycles], frames.t_us[places])
