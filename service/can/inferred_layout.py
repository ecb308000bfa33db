"""Which bits of an unknown message are a number: the division with the shortest description of what was received.

A number of a machine changes little from frame to frame.  Read at the right place, with the right width and byte order,
its differences are small; read across two numbers, or without its upper half, they are not.  So each reading costs the
bits of its differences, and of all divisions of the message the cheapest is taken (minimum description length:
Rissanen, "Modeling by shortest data description", Automatica 14, 1978).
"""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from service.can.messages import ByteOrder

FieldKind = Literal["signal", "counter", "state", "constant", "random"]
"""What a number does: it varies smoothly; goes up by one each frame; has few values; never changes; cannot be told from
noise, as a checksum."""

FEWEST_FRAMES = 50
"""Fewest frames of an id whose bytes are looked at."""
_WIDTHS = (1, 2, 4)
"""Bytes of the usual numbers"""
_FEW_VALUES, _SOME = 8, 256
"""Most values of a state; and how many numbers are looked at first, of which more values show that it is none"""
_COUNTS = 0.9
"""Least share of the frames in which a counter goes up by one; between the others frames were lost."""
_FEW_SKIPS, _MOST_OF_THEM = 3, 0.5
_NOISE = 0.85
"""Share of its bits that the differences of a random number need."""
_FIELD_BITS, _UNUSUAL_BITS, _FORESEEN_BITS = 50.0, 100.0, 5.0
"""Cost of each number: of two divisions that describe as well, that into fewer is taken.  More, where it is no 1, 2 or
4 bytes; less of counters, and of bits beside others that never change."""
_MANY = 1000
"""Frames; fewer cost no more each."""
_RANDOM_BITS = 0.2
"""Cost of a random number for each frame: the lowest bits of a number often look so."""
_LONGEST = 32
"""Bits of an integer"""
_RISES, _FALLS, _SELDOM = 4.0, 16.0, 0.1
"""Standard deviations, of the frames in which a bit changes; by which factor they fall to another number; and the share
in which the highest bits change, above which a number may begin at each half byte"""
_MANTISSA = 23
_MOST_PAGES, _OFTEN = 32, 0.1
"""Most values of a multiplexer, and the least share of the frames with another one than before"""
_MUCH_SHORTER = 0.7
_PLAUSIBLE = (1e-9, 1e12)
"""Largest magnitude of a floating-point number of a machine"""


class Part(NamedTuple):
    """Some bits of the integer that bytes are."""

    low_bit: int
    length: int

    def values(self, raw: NDArray[np.uint64]) -> NDArray[np.uint64]:
        """The numbers in these integers (N,)."""
        return (raw >> np.uint64(self.low_bit)) & np.uint64((1 << self.length) - 1)


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
    """The bits that it is, where these are not whole bytes"""

    @property
    def length(self) -> int:
        """Bits."""
        return 8 * self.width if self.part is None else self.part.length

    def values(self, data: NDArray[np.uint8]) -> Floats:
        """The numbers in these data (N, W), raw (N,)."""
        raw = _raw(data, self.first_byte, self.width, self.byte_order)
        if self.is_float:
            return raw.astype(np.uint32).view(np.float32).astype(np.float64)
        if self.part is not None:
            raw = self.part.values(raw)
        return _signed(raw, self.length) if self.is_signed else raw.astype(np.float64)


def find_multiplexer(data: NDArray[np.uint8], fields: Sequence[Field]) -> int | None:
    """The byte that tells what the others mean, as in inverters that send one register after another; None: none does.

    Divided by its values, the frames (N, W) have a much shorter description than all together, in ``fields``.
    """
    least, best = _MUCH_SHORTER * _total(fields, len(data)), None
    for byte in range(data.shape[1]):
        pages, counts = np.unique(data[:, byte], return_counts=True)
        # Where it seldom changes, most differences are those within a page anyway.
        if (
            not 2 <= pages.size <= _MOST_PAGES
            or counts.min() < FEWEST_FRAMES
            or np.mean(np.diff(data[:, byte]) != 0) < _OFTEN
        ):
            continue
        share = counts / data.shape[0]
        bits = -float(share @ np.log2(share))
        for page, part in zip(pages, share, strict=True):
            if bits < least:  # else it is no better already
                own = data[data[:, byte] == page]
                bits += part * _total(infer_layout(own), len(own))
        if bits < least:
            least, best = bits, byte
    return best


def _total(fields: Sequence[Field], frames: int) -> float:
    return sum(_price(field, frames) for field in fields)


def infer_layout(data: NDArray[np.uint8]) -> tuple[Field, ...]:
    """The numbers in the data of one id, in their order; together they are all bits.

    ``data``: of at least FEWEST_FRAMES frames with the same length W, in the order of receipt (N, W).
    """
    orders: tuple[ByteOrder, ...] = ("little", "big")
    bytes_read = dict[tuple[int, int], list[Field]]()
    divisions = [_division(data, order, bytes_read) for order in orders]
    return min(divisions, key=lambda fields: _total(fields, len(data)))


def _division(
    data: NDArray[np.uint8], order: ByteOrder, bytes_read: dict[tuple[int, int], list[Field]]
) -> tuple[Field, ...]:
    """The cheapest division, in which numbers that are not whole bytes have this order.

    ``bytes_read``: all ways to read whole bytes, which are the same in both orders; filled as they are needed.
    """
    edges = _edges(data, order)
    best: dict[int, tuple[float, tuple[Field, ...]]] = {0: (0.0, ())}  # of the first bits
    for end in edges[1:]:
        ways = []
        for start in edges[: edges.index(end)]:
            if end - start > _LONGEST:
                continue
            found = bytes_read.get((start, end)) or list(_readings(data, start, end, order))
            if start % 8 == end % 8 == 0:
                bytes_read[start, end] = found
            cost, fields = best[start]
            ways += [(cost + _price(f, len(data)), (*fields, f)) for f in found]
        best[end] = min(ways, key=lambda way: way[0])
    return best[edges[-1]][1]


def _edges(data: NDArray[np.uint8], order: ByteOrder) -> list[int]:
    """Where numbers may begin or end, by bits in this order: where one changes more than that below it, or far less.

    Of a number each bit changes less often than those below it (Marchetti and Stabili, "READ: Reverse engineering of
    automotive data frames", IEEE Transactions on Information Forensics and Security 14, 2019).
    """
    bits = np.unpackbits(data, axis=1, bitorder=order)
    changes = np.mean(bits[1:] != bits[:-1], axis=0)
    inside = changes if order == "little" else changes[1:]
    if order == "big":
        changes = changes[::-1]
    lower, upper = changes[:-1], changes[1:]
    scatter = np.sqrt((lower + upper) / len(data))
    inner = 1 + np.flatnonzero((upper > lower + _RISES * scatter) | (upper < lower / _FALLS))
    edges = inner if order == "little" else changes.size - inner
    half = [k for k in range(4, changes.size, 8) if 0 < inside[k - 1] < _SELDOM]
    return sorted({*edges.tolist(), *half, *range(0, changes.size + 1, 8)})


def _price(field: Field, frames: int) -> float:
    """Of a number in so many frames, for each of them."""
    if field.kind == "counter" or (field.kind == "constant" and field.part is not None):
        return field.bits + _FORESEEN_BITS / max(frames, _MANY)
    usual = field.part is None and field.width in _WIDTHS
    own = (_FIELD_BITS if usual else _UNUSUAL_BITS) / max(frames, _MANY)
    return field.bits + own + (_RANDOM_BITS if field.kind == "random" else 0.0)


def counts_frames(numbers: Floats, size: float) -> bool:
    """Whether a number (N,) goes up by one from frame to frame, modulo its size; where it does not, frames were lost.

    One that always skips after the same value has another size: a counter of four bits beside others in its byte, or
    one from 0 to 14.
    """
    steps = np.diff(numbers) % size
    if not steps.size or float(np.mean(steps == 1)) <= _COUNTS:
        return False
    skips = np.unique(numbers[:-1][steps != 1], return_counts=True)[1]
    return not (skips.sum() >= _FEW_SKIPS and skips.max() > _MOST_OF_THEM * skips.sum())


def _readings(data: NDArray[np.uint8], start: int, end: int, order: ByteOrder) -> Iterator[Field]:
    """All ways to read a number from these bits."""
    first, width, length = start // 8, -(-end // 8) - start // 8, end - start
    of_bytes = length == 8 * width
    orders: tuple[ByteOrder, ...] = ("little", "big") if of_bytes and width > 1 else (order,)
    part = None if of_bytes else Part(start % 8 if order == "little" else -end % 8, length)
    for each in orders:
        raw = _raw(data, first, width, each)
        numbers = raw if part is None else part.values(raw)
        bits = _cost(numbers, length)
        kind = _kind(numbers, bits, length)
        yield Field(first, width, each, False, _is_signed(numbers, length), kind, bits, part)
        if of_bytes and width == np.dtype(np.float32).itemsize:
            with np.errstate(invalid="ignore"):  # any bits may come
                real = raw.astype(np.uint32).view(np.float32).astype(np.float64)
            if _is_plausible(real):
                bits = _float_cost(real)
                yield Field(first, width, each, True, True, _kind(raw, bits, length), bits)


def _raw(data: NDArray[np.uint8], first: int, width: int, order: ByteOrder) -> NDArray[np.uint64]:
    """Bytes as integers (N,) of 64 bits."""
    columns = data[:, first : first + width].T.astype(np.uint64)
    found = np.zeros(data.shape[0], np.uint64)
    for column in columns if order == "big" else columns[::-1]:
        found = (found << np.uint64(8)) | column
    return found


def _signed(raw: NDArray[np.uint64], length: int) -> Floats:
    """Integers of so many bits (N,) as two's complements; also the shorter way of a difference modulo 2^length."""
    unused = 64 - length
    return ((raw << np.uint64(unused)).view(np.int64) >> np.int64(unused)).astype(np.float64)


def _cost(raw: NDArray[np.uint64], length: int) -> float:
    """Bits of a value: of the value itself, of its difference or of its second difference, whichever is least.

    The differences are modulo 2^length: a number that starts again after its last value goes on smoothly.
    """
    series, costs = raw, list[float]()
    for _ in range(3):
        costs.append(_code_bits(_signed(series, length)))
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


def _is_signed(raw: NDArray[np.uint64], length: int) -> bool:
    """Whether the number passes zero rather than the middle of its range; if neither, whether it is just below zero."""
    numbers, limit = raw.astype(np.float64), 2.0 ** (length - 1)
    upper = numbers >= limit
    crossings = np.flatnonzero(upper[1:] != upper[:-1])
    if not crossings.size:
        return bool(np.all(numbers >= limit * 1.5))
    at_zero = (
        np.minimum(numbers, 2 * limit - 1 - numbers) < limit / 2
    )  # nearer to 0 or to the last number than to the middle
    return float(np.mean(at_zero[crossings])) > 0.5


def _kind(raw: NDArray[np.uint64], bits: float, length: int) -> FieldKind:
    few = np.unique(raw[:: max(1, raw.size // _SOME)]).size <= _FEW_VALUES
    values = np.unique(raw).size if few else raw.size
    if values == 1:
        return "constant"
    if counts_frames(raw.astype(np.float64), 2.0**length):
        return "counter"
    if values <= _FEW_VALUES:
        return "state"
    return "random" if bits > _NOISE * length else "signal"
