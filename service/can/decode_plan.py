"""Decodes all frames of one message at once; the results are bit-equal to those of cantools for each frame.

A plan is made once from the message: the bytes of each signal, and the multiplexer values for which it is present.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from cantools.database.can import Message, Signal
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Floats

_WORD = 8
_IS_LITTLE = sys.byteorder == "little"
_EXACT = 1 << 53
"""Smaller integers are exact in a float64."""
_LARGE = 1e200
_SHIFTS = tuple(map(np.uint64, range(64)))
_FLOATS = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}

Data = NDArray[np.uint8]


class Column(NamedTuple):
    """The values of a signal in the frames of its message."""

    values: Floats
    """Values (N,)"""
    present: Bools
    """Mask (N,); False: the page of the frame does not have the signal, so that the value has no meaning"""


class _Place:
    """Position of the bits of a signal: in a word of eight bytes, possibly with bits in a ninth byte."""

    def __init__(self, signal: Signal) -> None:
        self.length = signal.length
        self._big = signal.byte_order == "big_endian"
        # Bits are counted from the first one of the first byte: the highest in big endian, the lowest in little endian.
        start = 8 * (signal.start // 8) + 7 - signal.start % 8 if self._big else signal.start
        self._first, self._end = start, start + signal.length
        self._bytes = range(start // 8, (self._end - 1) // 8 + 1)

    def raw(self, data: _Words) -> NDArray[np.uint64]:
        """The bits (N,) at the upper end of a word; the bits below them are undefined."""
        if len(self._bytes) > _WORD:
            return self._of_nine(data)
        at = min(self._bytes[0], data.width - _WORD)
        up = self._first - 8 * at if self._big else 64 + 8 * at - self._end
        word = data.word(at, self._big)
        return word << _SHIFTS[up] if up else word

    def _of_nine(self, data: _Words) -> NDArray[np.uint64]:
        first = self._bytes[0]
        if self._big:
            beyond = 8 * (first + 9) - self._end
            low, high = data.word(first + 1, True), data.byte(first)
        else:
            beyond = self._first - 8 * first
            low, high = data.word(first, False), data.byte(first + _WORD)
        word = (low >> np.uint64(beyond)) | (high << np.uint64(64 - beyond))
        return word << np.uint64(64 - self.length)


class _Words:
    """The data of frames (N, W) as words of eight bytes, cached, as signals often share a word."""

    def __init__(self, data: Data) -> None:
        self._data, self.width = data, data.shape[1]
        self._known: dict[tuple[int, bool], NDArray[np.uint64]] = {}

    def word(self, at: int, big: bool) -> NDArray[np.uint64]:
        """The eight bytes from position ``at`` on (N,)."""
        if (at, big) not in self._known:
            eight = np.ascontiguousarray(self._data[:, at : at + _WORD]).view(np.uint64)[:, 0]
            self._known[at, big] = eight.byteswap() if big == _IS_LITTLE else eight
        return self._known[at, big]

    def byte(self, at: int) -> NDArray[np.uint64]:
        """The byte at position ``at`` (N,)."""
        return self._data[:, at].astype(np.uint64)


class _Condition(NamedTuple):
    multiplexer: str
    values: Floats


class _SignalPlan:
    def __init__(self, signal: Signal, pages: Mapping[str, Sequence[int]]) -> None:
        self.name = signal.name
        self._place = _Place(signal)
        self._signed, self._float = signal.is_signed, signal.conversion.is_float
        self._scale, self._offset = _numbers_of(signal)
        kind = self._signed, self._float, self._scale, self._offset
        self.layout = signal.start, signal.length, signal.byte_order, *kind
        self._factor, self._added = _real(self._scale), _real(self._offset)
        self._is_raw = self._scale == 1 and self._offset == 0
        self._is_large = _beyond_floats(signal, self._scale, self._offset)
        self.may_overflow = self._float or max(abs(self._factor), abs(self._added)) > _LARGE
        """Whether numpy may warn of an overflow"""
        self.present: _Condition | None = None
        if signal.multiplexer_signal is not None:
            self.present = _Condition(signal.multiplexer_signal, _floats(signal.multiplexer_ids or ()))
        self.pages = _floats(pages[signal.name]) if signal.name in pages else None
        """Known values of a multiplexer; None: the signal is no multiplexer"""

    def values(self, data: _Words) -> Floats:
        """Raw numbers (N,) times the factor plus the offset, rounded at the same steps as in cantools."""
        word, down = self._place.raw(data), 64 - self._place.length
        if self._float:
            unsigned, real = _FLOATS[self._place.length]
            values = (word >> _SHIFTS[down]).astype(unsigned).view(real).astype(np.float64)
        else:
            bits = word.view(np.int64) >> down if self._signed else word >> _SHIFTS[down]
            if self._is_large:  # rare
                return np.array([_real(n * self._scale + self._offset) for n in bits.tolist()], np.float64)
            values = bits.astype(np.float64)
        if not self._is_raw:
            values *= self._factor
            values += self._added
        return values


def _numbers_of(signal: Signal) -> tuple[float, float]:
    """Factor and offset, as integers if cantools computes with integers."""
    scale, offset = signal.conversion.scale, signal.conversion.offset
    if all(isinstance(number, int) or number.is_integer() for number in (scale, offset)):
        return int(scale), int(offset)
    return scale, offset


def _beyond_floats(signal: Signal, scale: float, offset: float) -> bool:
    """Whether integers of this signal may be too large to be exact as floats."""
    parts = ((1 << signal.length) * scale, offset)
    return sum(abs(number) for number in parts if isinstance(number, int)) >= _EXACT


class MessagePlan:
    """Decodes the ``wanted`` signals of one message."""

    def __init__(self, message: Message, wanted: Iterable[str]) -> None:
        self.length = message.length
        self.wanted = tuple(wanted)
        pages = dict(_pages(message.signal_tree))
        signals = {signal.name: signal for signal in message.signals}
        # Decode all multiplexers, so that an unknown page is noticed; each multiplexer comes before its signals.
        names = dict.fromkeys([*pages, *self.wanted])
        ordered = dict[str, _SignalPlan]()
        for name in names:
            for needed in _chain(name, signals):
                ordered.setdefault(needed.name, _SignalPlan(needed, pages))
        self._signals = tuple(ordered.values())
        self.multiplexed = any(signal.pages is not None for signal in self._signals)
        """Whether a frame may lack a signal, or have an unknown page"""
        self.layout = (self.length, *(signal.layout for signal in self._signals))
        """Frames of messages with equal layout that are not multiplexed can be decoded together."""
        may_overflow = any(signal.may_overflow for signal in self._signals)
        self._quiet = partial(np.errstate, all="ignore") if may_overflow else nullcontext

    def decode(self, data: Data) -> tuple[dict[str, Column], Bools]:
        """The wanted signals in data (N, W) of sufficient length, and a mask of the frames (N,) with a known page."""
        known = np.ones(len(data), np.bool_)
        columns: dict[str, Column] = {}
        everywhere, words = known, _Words(data)
        with self._quiet():  # the bits may be a float of any size
            for signal in self._signals:
                values, present = signal.values(words), everywhere
                if signal.present is not None:
                    above = columns[signal.present.multiplexer]
                    present = above.present & _among(above.values, signal.present.values)
                if signal.pages is not None:
                    known = known & (~present | _among(values, signal.pages))
                columns[signal.name] = Column(values, present)
        return {name: columns[name] for name in self.wanted}, known


def _pages(tree: Sequence[Any]) -> Iterator[tuple[str, list[int]]]:
    """The multiplexers in a tree of signals, outer ones first, with their known values."""
    for branch in tree:
        if isinstance(branch, Mapping):
            for name, by_value in branch.items():
                yield name, sorted(by_value)
                for below in by_value.values():
                    yield from _pages(below)


def _chain(name: str, signals: Mapping[str, Signal]) -> list[Signal]:
    """The multiplexers above a signal, then the signal."""
    signal = signals[name]
    if signal.multiplexer_signal is None:
        return [signal]
    return [*_chain(signal.multiplexer_signal, signals), signal]


def _real(number: float) -> float:
    """A number as a float; infinite if an integer is too large."""
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf


def _floats(numbers: Iterable[int]) -> Floats:
    return np.array(sorted(numbers), np.float64)


def _among(values: Floats, allowed: Floats) -> Bools:
    """Mask of the values (N,) whose integer part is allowed."""
    numbers = np.trunc(values)
    if len(allowed) == 1:
        return np.asarray(numbers == allowed[0], np.bool_)
    return np.isin(numbers, allowed)
