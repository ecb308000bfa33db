"""Decodes the wanted signals in blocks of frames; values sampled at a SYNC get the time of the SYNC."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Ints
from service.can.decode_plan import Column, MessagePlan
from service.can.frames import EXTENDED, FrameBlock, FrameKey
from service.can.messages import Message, MessageSet, find_signal, key_of_message

FRAME_REASONS = ("unwanted", "too_short", "undecodable", "signal_absent")
"""Why a frame gave no signal, or (signal_absent) not all wanted signals: keys of ``Decoder.dropped``."""


class Decoded(NamedTuple):
    """The wanted signals of the frames of one message in a block; each frame has at least one of them."""

    places: Ints
    """Positions of the frames in the block (N,)"""
    t_us: Ints
    """Times of receipt (N,); for values sampled at a SYNC, the time of the SYNC"""
    signals: Mapping[str, Column]
    """Signals by name, each (N,)"""


class _SameLayout(NamedTuple):
    """Messages with signals at the same positions, as the axes of a robot mostly have; decoded together."""

    plan: MessagePlan
    keys: list[FrameKey]


_NO_ID = 0xFFFFFFFF


class Decoder:
    """Decodes the wanted signals of a bus."""

    def __init__(self, known: MessageSet) -> None:
        self.known = known
        self._messages: dict[FrameKey, Message] = {}
        self._wanted: dict[FrameKey, tuple[str, ...]] = {}
        self._sync: dict[FrameKey, SyncCycle] = {}
        self.dropped = dict.fromkeys(FRAME_REASONS, 0)
        """Number of dropped frames by reason"""

    def want(self, message: str, signal: str) -> FrameKey:
        """Decode this signal from now on; returns the key of the frames that carry it.

        Raises:
            DescriptionError: there is no such message or signal.
        """
        found, _ = find_signal(self.known, message, signal)
        key = key_of_message(found)
        self._messages[key] = found
        self._wanted[key] = tuple(dict.fromkeys((*self._wanted.get(key, ()), signal)))
        for stale in ("_groups", "_ranks"):
            self.__dict__.pop(stale, None)
        if (sync := self.known.sync.get(key)) is not None:
            self._sync.setdefault(sync, SyncCycle(sync))
        return key

    @property
    def keys(self) -> tuple[FrameKey, ...]:
        """Keys of the frames with wanted signals, and of the SYNC that times them; for the filters of the bus."""
        return (*self._messages, *self._sync)

    @property
    def messages(self) -> Mapping[FrameKey, Message]:
        """The messages with wanted signals, by the key of their frames."""
        return self._messages

    def decode(self, frames: FrameBlock) -> dict[FrameKey, Decoded]:
        """Decode the wanted signals in these frames, by message; counts the frames that lack some or all of them."""
        found: dict[FrameKey, Decoded] = {}
        left = frames.size - sum(cycle.take(frames) for cycle in self._sync.values())
        for group, places, counts in self._sorted(np.ascontiguousarray(frames.ids)):
            left -= places.size
            if places.size:
                self._decode(group, frames, places, counts, found)
        self.dropped["unwanted"] += left
        return found

    @cached_property
    def _groups(self) -> tuple[_SameLayout, ...]:
        """All wanted messages by layout; first those that are identified by all bits of the id."""
        found: dict[object, _SameLayout] = {}
        for key, message in sorted(self._messages.items(), key=lambda item: item[0] in self.known.masks):
            plan = MessagePlan(message, self._wanted[key])
            alone = plan.multiplexed or key in self.known.masks
            found.setdefault(key if alone else plan.layout, _SameLayout(plan, [])).keys.append(key)
        return tuple(found.values())

    @cached_property
    def _ranks(self) -> tuple[NDArray[np.uint32], NDArray[np.int16]]:
        """The wanted ids in increasing order, and the indices of their messages in ``_groups``; the last means none."""
        keys = [key for group in self._groups for key in group.keys if key not in self.known.masks]
        ids = np.array([*(key.record_id for key in keys), _NO_ID], np.uint32)
        ranks = ids.argsort()
        return ids[ranks], ranks.astype(np.int16)

    def _sorted(self, ids: NDArray[np.uint32]) -> Iterator[tuple[_SameLayout, Ints, Ints]]:
        """For each group: positions of its frames, sorted by message, and the number of frames of each message."""
        known, ranks = self._ranks
        at = known.searchsorted(ids)
        rank = np.where(known[at] == ids, ranks[at], ranks[-1])
        places, counts = rank.argsort(kind="stable"), np.bincount(rank, minlength=len(ranks))
        first = begin = 0
        for group in self._groups:
            if (mask := self.known.masks.get(group.keys[0])) is not None:
                mask |= EXTENDED
                alike = (ids & np.uint32(mask) == group.keys[0].record_id & mask).nonzero()[0]
                yield group, alike, np.array([alike.size])
                continue
            own = counts[first : first + len(group.keys)]
            end = begin + int(own.sum())
            yield group, places[begin:end], own
            first, begin = first + len(group.keys), end

    def _decode(
        self,
        group: _SameLayout,
        frames: FrameBlock,
        places: Ints,
        counts: Ints,
        found: dict[FrameKey, Decoded],
    ) -> None:
        """Decode the frames at these positions (N,), sorted by message; ``counts``: frames of each message."""
        plan, part, ends = group.plan, frames.select(places), counts.cumsum()
        t_us = np.ascontiguousarray(part.t_us)
        for k, key in enumerate(group.keys):
            if counts[k] and (sync := self.known.sync.get(key)) is not None:
                own = slice(ends[k] - counts[k], ends[k])
                t_us[own] = self._sync[sync].times_us(key, frames, places[own])
        long = part.lengths >= plan.length
        if short := places.size - int(np.count_nonzero(long)):
            self.dropped["too_short"] += short
            places, t_us, part = places[long], t_us[long], part.select(long)
            ends = np.concatenate([[0], long.cumsum()])[ends]
            if not places.size:
                return
        signals, known = plan.decode(part.data)
        if plan.multiplexed:
            present = np.array([column.present for column in signals.values()]) & known
            self.dropped["undecodable"] += int(np.count_nonzero(~known))
            self.dropped["signal_absent"] += int(np.count_nonzero(known & ~present.all(axis=0)))
            some = present.any(axis=0)
            places, t_us, ends = places[some], t_us[some], some.cumsum()[-1:]
            signals = {name: Column(c.values[some], c.present[some]) for name, c in signals.items()}
        begin = 0
        for key, end in zip(group.keys, ends.tolist(), strict=True):
            if end > begin:
                own = slice(begin, end)
                always = known[own]
                columns = [
                    Column(values[own], always if present is known else present[own])
                    for values, present in signals.values()
                ]
                names = self._wanted[key]
                found[key] = Decoded(places[own], t_us[own], dict(zip(names, columns, strict=True)))
            begin = end


class SyncCycle:
    """Follows the SYNC of a CANopen bus block by block, as drives send after a SYNC the values sampled at it.

    All values of one cycle get the time of the SYNC.  So torque and motion in two PDOs belong together, and the time
    that a frame waits for the bus has no effect.  If a second frame of a message follows the same SYNC, a SYNC was
    lost, and the frame keeps its own time.
    """

    def __init__(self, key: FrameKey) -> None:
        self.key = key
        self._places = np.zeros(0, np.int64)
        self._times_us = np.zeros(1, np.int64)
        """Times of the last SYNC before the block and of the SYNCs in it"""
        self._begun = False
        """Whether there was a SYNC before the block"""
        self._answered, self._answering = set[FrameKey](), set[FrameKey]()
        """Messages received after the last SYNC before the block, and after the last SYNC in it"""

    def take(self, frames: FrameBlock) -> int:
        """Take the next block; returns the number of SYNCs in it."""
        self._answered = self._answering | (set() if self._places.size else self._answered)
        self._answering = set()
        self._begun = self._begun or bool(self._places.size)
        self._places = np.flatnonzero(frames.ids == self.key.record_id)
        self._times_us = np.concatenate([self._times_us[-1:], frames.t_us[self._places]])
        return len(self._places)

    def times_us(self, key: FrameKey, frames: FrameBlock, places: Ints) -> Ints:
        """The times (N,) of the frames of one message; ``places``: their positions in the block (N,)."""
        cycles = np.searchsorted(self._places, places)
        if cycles[-1] == len(self._places):
            self._answering.add(key)
        before = np.concatenate([[0 if key in self._answered else -1], cycles[:-1]])
        first = (cycles != before) & ((cycles > 0) | self._begun)
        return np.where(first, self._times_us[cycles], frames.t_us[places])
