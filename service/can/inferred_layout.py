"""Which bytes of an unknown message are a number: the division with the shortest description of what was received.

A number of a machine changes little from frame to frame.  Read at the right place, with the right width and byte order,
its differences are small; read across two numbers, or without its upper half, they are not.  So each reading costs the
bits of its differences, and of all divisions of the message the cheapest is taken (minimum description length:
Rissanen, "Modeling by shortest data description", Automatica 14, 1978).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from service.can.messages import ByteOrder

FieldKind = Literal["signal", "counter", "state", "constant", "random"]
"""What a number does: it varies smoothly; goes up by one each frame; has few values; never changes; cannot be told from
noise, as a checksum."""

FEWEST_FRAMES = 50
"""Of an id, to look at its bytes."""
_WIDTHS = (1, 2, 4)
_FEW_VALUES = 8
_COUNTS = 0.9
"""Of the frames, in which a counter goes up by one; the others were lost."""
_FEW_SKIPS, _MOST_OF_THEM = 3, 0.5
_NOISE = 0.85
"""Of its bits, that the differences of a random number need."""
_FIELD_BITS = 0.05
"""Cost of each number, per frame: of two divisions that describe as well, that into fewer is taken."""
_MANTISSA = 23
_MOST_PAGES = 32
_MUCH_SHORTER = 0.7
_PLAUSIBLE = (1e-9, 1e12)
"""Largest magnitude of a floating-point number of a machine"""


class Part(NamedTuple):
    """Some bits of a byte."""

    low_bit: int
    length: int

    def values(self, data: NDArray[np.uint8]) -> Floats:
        """The numbers in these bytes (N,)."""
        return np.asarray((data >> self.low_bit) & ((1 << self.length) - 1), np.float64)


class Field(NamedTuple):
    """A number in the data of a message."""

    first_byte: int
    width: int
    """Bytes"""
    byte_order: ByteOrder
    is_float: bool
    is_signed: bool
    kind: FieldKind
    bits: float
    """Mean description of a frame's value: of the smoothest a few"""
    part: Part | None = None
    """The bits that it is, of a byte that it shares"""

    def values(self, data: NDArray[np.uint8]) -> Floats:
        """The numbers in these data (N, W), raw (N,)."""
        if self.part is not None:
            return self.part.values(data[:, self.first_byte])
        raw = _raw(data, self.first_byte, self.width, self.byte_order)
        if self.is_float:
            return raw.view(np.float32).astype(np.float64)
        if self.is_signed:
            return raw.view(raw.dtype.name.replace("u", "")).astype(np.float64)
        return raw.astype(np.float64)


def find_multiplexer(data: NDArray[np.uint8]) -> int | None:
    """The byte that tells what the others mean, as in inverters that send one register after another; None: none does.

    Divided by its values, the frames (N, W) have a much shorter description.
    """
    undivided = _total(infer_layout(data))
    best: tuple[float, int] | None = None
    for byte in range(data.shape[1]):
        pages, counts = np.unique(data[:, byte], return_counts=True)
        if not 2 <= pages.size <= _MOST_PAGES or counts.min() < FEWEST_FRAMES:
            continue
        share = counts / data.shape[0]
        own = [_total(infer_layout(data[data[:, byte] == page])) for page in pages]
        bits = float(share @ own - share @ np.log2(share))
        if bits < _MUCH_SHORTER * undivided and (best is None or bits < best[0]):
            best = bits, byte
    return None if best is None else best[1]


def _total(fields: tuple[Field, ...]) -> float:
    return sum(field.bits + _FIELD_BITS for field in fields)


def infer_layout(data: NDArray[np.uint8]) -> tuple[Field, ...]:
    """The numbers in the data of one id, in their order; together they are all bytes.

    ``data``: of at least FEWEST_FRAMES frames with the same length W, in the order of receipt (N, W).
    """
    length = data.shape[1]
    best: list[tuple[float, tuple[Field, ...]]] = [(0.0, ())]  # of the first bytes
    for end in range(1, length + 1):
        ways = []
        for width in _WIDTHS:
            if width <= end:
                cost, fields = best[end - width]
                ways += [
                    (cost + f.bits + _FIELD_BITS, (*fields, f)) for f in _readings(data, end - width, width)
                ]
        best.append(min(ways, key=lambda way: way[0]))
    return best[-1][1]


def split_counter(field: Field, data: NDArray[np.uint8]) -> tuple[Field, ...]:
    """The fields in a number of which only some bits change, the lowest or the highest of a byte, and count the frames.

    Of any other number it is the number itself.
    """
    places = range(field.first_byte, field.first_byte + field.width)
    varying = [place for place in places if np.ptp(data[:, place])]
    if field.kind == "counter" or len(varying) != 1:
        return (field,)
    raw = data[:, varying[0]]
    for length in range(7, 1, -1):  # the lower bits of a counter count as well
        rest = 8 - length
        for counter, other in ((Part(0, length), Part(length, rest)), (Part(rest, length), Part(0, rest))):
            if counts_frames(counter.values(raw), 2.0**length):
                one_byte = field._replace(width=1, byte_order="little", is_float=False, is_signed=False)
                constant = one_byte._replace(kind="constant")
                parts = (
                    one_byte._replace(kind="counter", part=counter),
                    one_byte._replace(kind=_kind_of_part(other.values(raw)), part=other),
                )
                return tuple(
                    field._replace(first_byte=place)
                    for place in places
                    for field in (sorted(parts, key=_low_bit) if place in varying else [constant])
                )
    return (field,)


def _low_bit(field: Field) -> int:
    return field.part.low_bit if field.part is not None else 0


def _kind_of_part(numbers: Floats) -> FieldKind:
    values = np.unique(numbers).size
    return "constant" if values == 1 else "state" if values <= _FEW_VALUES else "signal"


def counts_frames(numbers: Floats, size: float) -> bool:
    """Whether a number (N,) goes up by one from frame to frame, modulo its size; where it does not, frames were lost.

    One that always skips after the same value has another size: a counter of four bits beside others in its byte, or
    one from 0 to 14.
    """
    steps = np.diff(numbers) % size
    skips = np.unique(numbers[:-1][steps != 1], return_counts=True)[1]
    restarts = skips.sum() >= _FEW_SKIPS and skips.max() > _MOST_OF_THEM * skips.sum()
    return steps.size > 0 and float(np.mean(steps == 1)) > _COUNTS and not restarts


def _readings(data: NDArray[np.uint8], first: int, width: int) -> Iterator[Field]:
    """All ways to read a number from these bytes."""
    orders: tuple[ByteOrder, ...] = ("little", "big") if width > 1 else ("little",)
    for order in orders:
        raw = _raw(data, first, width, order)
        bits = _cost(raw)
        yield Field(first, width, order, False, _is_signed(raw), _kind(raw, bits), bits)
        if width == np.dtype(np.float32).itemsize:
            with np.errstate(invalid="ignore"):  # any bits may come
                real = raw.view(np.float32).astype(np.float64)
            if _is_plausible(real):
                bits = _float_cost(real)
                yield Field(first, width, order, True, True, _kind(raw, bits), bits)


def _raw(data: NDArray[np.uint8], first: int, width: int, order: ByteOrder) -> NDArray[np.unsignedinteger]:
    part = np.ascontiguousarray(data[:, first : first + width])
    native: NDArray[np.unsignedinteger] = part.view(f"{'<' if order == 'little' else '>'}u{width}")[:, 0]
    return native.astype(f"u{width}")


def _cost(raw: NDArray[np.unsignedinteger]) -> float:
    """Bits of a value: of the value itself, of its difference or of its second difference, whichever is least.

    The differences are modulo 2^bits: a number that starts again after its last value goes on smoothly.
    """
    signed, series, costs = raw.dtype.name.replace("u", ""), raw, list[float]()
    for _ in range(3):
        costs.append(_code_bits(series.view(signed).astype(np.float64)))
        series = np.diff(series)
    return min(costs)


def _float_cost(real: Floats) -> float:
    """The same of a floating-point number, in steps of its resolution at its largest value.

    What small numbers have below such a step is described as it is: any bits that vary look like numbers of all sizes.
    """
    largest = float(np.max(np.abs(real)))
    step, series, costs = largest * 2.0**-_MANTISSA, real, list[float]()
    for _ in range(3):
        costs.append(_code_bits(np.rint(series / step)))
        series = np.diff(series)
    below = np.frexp(largest)[1] - np.frexp(real[real != 0])[1]
    return min(costs) + float(np.sum(np.minimum(below, _MANTISSA))) / real.size


def _code_bits(x: Floats) -> float:
    """Mean bits of integers in a code that fits itself to them: the length of each, its other digits, its sign."""
    digits = np.frexp(np.abs(x))[1]  # 0 of 0, 1 of 1, 2 of 2 and 3, ...
    share = np.bincount(digits) / x.size
    share = share[share > 0]
    entropy = float(-np.sum(share * np.log2(share)))
    return entropy + float(np.mean(np.maximum(digits - 1, 0))) + float(np.mean(digits > 0))


def _is_plausible(real: Floats) -> bool:
    if not np.isfinite(real).all():
        return False
    largest = float(np.max(np.abs(real)))
    small = np.abs(real) < largest * 2.0 ** -(2 * _MANTISSA)
    return _PLAUSIBLE[0] < largest < _PLAUSIBLE[1] and not np.any(small & (real != 0))


def _is_signed(raw: NDArray[np.unsignedinteger]) -> bool:
    """Whether the number passes zero rather than the middle of its range; if neither, whether it is just below zero."""
    limit = np.iinfo(raw.dtype).max // 2
    upper = raw > limit
    crossings = np.flatnonzero(upper[1:] != upper[:-1])
    if not crossings.size:
        return bool(np.all(raw > limit + limit // 2))
    at_zero = np.minimum(raw, ~raw) < limit // 2  # nearer to 0 or to the last number than to the middle
    return float(np.mean(at_zero[crossings])) > 0.5


def _kind(raw: NDArray[np.unsignedinteger], bits: float) -> FieldKind:
    values = np.unique(raw)
    if values.size == 1:
        return "constant"
    if counts_frames(raw.astype(np.float64), 2.0 ** (8 * raw.dtype.itemsize)):
        return "counter"
    if values.size <= _FEW_VALUES:
        return "state"
    return "random" if bits > _NOISE * 8 * raw.dtype.itemsize else "signal"
