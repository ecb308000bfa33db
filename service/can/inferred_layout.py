"""Finds the numbers in an unknown message: the division of its bits with the shortest description of the received data.

A physical value changes little from frame to frame.  Read with the right position, width and byte order, its
differences are small; read across two numbers, or without its upper half, they are large.  The cost of a number is the
number of bits that encode its differences, and the division with the least total cost is taken (minimum description
length: Rissanen, "Modeling by shortest data description", Automatica 14, 1978).
"""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from service.can.messages import ByteOrder

FieldKind = Literal["signal", "counter", "state", "constant", "random"]
"""Behaviour of a number: it varies smoothly (signal); increases by one each frame (counter); has few values (state);
never changes (constant); looks like noise, as a checksum does (random)."""

FEWEST_FRAMES = 50
"""Fewest frames of an id for an analysis."""
_WIDTHS = (1, 2, 4)
"""Usual widths of numbers in bytes"""
_FEW_VALUES, _SOME = 8, 256
"""Most values of a state; size of the sample that is checked first, for speed"""
_COUNTS = 0.9
"""Least share of the frames in which a counter increases by one; in the others, frames were lost."""
_FEW_SKIPS, _MOST_OF_THEM = 3, 0.5
_NOISE = 0.85
"""A number is random if encoding its differences takes at least this share of its bits."""
_FIELD_BITS, _UNUSUAL_BITS, _FORESEEN_BITS = 50.0, 100.0, 5.0
"""Cost of each number in bits, so that of two equally good divisions the one with fewer numbers is taken.  The second
is for widths other than 1, 2 or 4 bytes; the third for counters and for constant parts of a byte."""
_MANY = 1000
"""The cost of a number is spread over at least this many frames."""
_RANDOM_BITS = 0.2
"""Extra cost of a random number per frame, as the lowest bits of a signal often look random."""
_LONGEST = 32
"""Most bits of an integer"""
_RISES, _FALLS, _SELDOM = 4.0, 16.0, 0.1
"""An edge between numbers is assumed where the rate of bit changes rises by more than the first number of standard
deviations, or falls by more than the second factor; and at half a byte if its bit changes at less than the third
rate"""
_MANTISSA = 23
_MOST_PAGES, _OFTEN = 32, 0.1
"""Most values of a multiplexer, and least share of the frames in which it changes"""
_MUCH_SHORTER = 0.7
_PLAUSIBLE = (1e-9, 1e12)
"""Range of the largest magnitude of a plausible floating-point number"""


class BitRange(NamedTuple):
    """Some bits of an integer that is read from whole bytes."""

    low_bit: int
    length: int

    def values(self, raw: NDArray[np.uint64]) -> NDArray[np.uint64]:
        """The values of these bits in the integers (N,)."""
        return (raw >> np.uint64(self.low_bit)) & np.uint64((1 << self.length) - 1)


class Field(NamedTuple):
    """A number in the data of a message."""

    first_byte: int
    width: int
    """Width in bytes"""
    byte_order: ByteOrder
    is_float: bool
    is_signed: bool
    kind: FieldKind
    bits: float
    """Mean number of bits that encode the value of one frame; small for a smooth signal"""
    part: BitRange | None = None
    """The bits of the number, if they are not whole bytes"""

    @property
    def length(self) -> int:
        """Length in bits."""
        return 8 * self.width if self.part is None else self.part.length

    def values(self, data: NDArray[np.uint8]) -> Floats:
        """The raw values (N,) of the number in these data (N, W)."""
        raw = _raw(data, self.first_byte, self.width, self.byte_order)
        if self.is_float:
            return raw.astype(np.uint32).view(np.float32).astype(np.float64)
        if self.part is not None:
            raw = self.part.values(raw)
        return _signed(raw, self.length) if self.is_signed else raw.astype(np.float64)


def find_multiplexer(data: NDArray[np.uint8], fields: Sequence[Field]) -> int | None:
    """Find the byte that selects the meaning of the others, as in inverters that send one register after another.

    Grouped by the values of this byte, the frames (N, W) have a much shorter description than ``fields``, the
    description of all frames together.  None: there is no such byte.
    """
    least, best = _MUCH_SHORTER * _total(fields, len(data)), None
    for byte in range(data.shape[1]):
        pages, counts = np.unique(data[:, byte], return_counts=True)
        # If the byte seldom changes, most differences are within one page anyway.
        if (
            not 2 <= pages.size <= _MOST_PAGES
            or counts.min() < FEWEST_FRAMES
            or np.mean(np.diff(data[:, byte]) != 0) < _OFTEN
        ):
            continue
        share = counts / data.shape[0]
        bits = -float(share @ np.log2(share))
        for page, part in zip(pages, share, strict=True):
            if bits < least:  # otherwise it cannot be the best any more
                own = data[data[:, byte] == page]
                bits += part * _total(infer_layout(own), len(own))
        if bits < least:
            least, best = bits, byte
    return best


def _total(fields: Sequence[Field], frames: int) -> float:
    return sum(_price(field, frames) for field in fields)


def infer_layout(data: NDArray[np.uint8]) -> tuple[Field, ...]:
    """Divide the data of one id into numbers, in their order, which together cover all bits.

    ``data``: data of at least FEWEST_FRAMES frames of equal length W, in order of receipt (N, W).
    """
    orders: tuple[ByteOrder, ...] = ("little", "big")
    bytes_read = dict[tuple[int, int], list[Field]]()
    divisions = [_division(data, order, bytes_read) for order in orders]
    return min(divisions, key=lambda fields: _total(fields, len(data)))


def _division(
    data: NDArray[np.uint8], order: ByteOrder, bytes_read: dict[tuple[int, int], list[Field]]
) -> tuple[Field, ...]:
    """The cheapest division with this bit order for numbers that are not whole bytes.

    ``bytes_read``: cache of the readings of whole bytes, which are the same in both orders.
    """
    edges = _edges(data, order)
    # Cost and numbers of the first bits, by end.
    best: dict[int, tuple[float, tuple[Field, ...]]] = {0: (0.0, ())}
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
    """Bit positions in this order where numbers may begin or end.

    There, a bit changes more often than the next lower bit, or far less often.
    In a number, each bit changes less often than the bits below it (Marchetti and Stabili, "READ: Reverse engineering
    of automotive data frames", IEEE Transactions on Information Forensics and Security 14, 2019).
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
    """Cost of a number per frame, [bits]."""
    if field.kind == "counter" or (field.kind == "constant" and field.part is not None):
        return field.bits + _FORESEEN_BITS / max(frames, _MANY)
    usual = field.part is None and field.width in _WIDTHS
    own = (_FIELD_BITS if usual else _UNUSUAL_BITS) / max(frames, _MANY)
    return field.bits + own + (_RANDOM_BITS if field.kind == "random" else 0.0)


def counts_frames(numbers: Floats, size: float) -> bool:
    """Whether a number (N,) increases by one from frame to frame, modulo ``size``, except for lost frames.

    A number that always skips after the same value has another size, e.g. a 4-bit counter that shares a byte, or a
    counter from 0 to 14.
    """
    steps = np.diff(numbers) % size
    if not steps.size or float(np.mean(steps == 1)) <= _COUNTS:
        return False
    skips = np.unique(numbers[:-1][steps != 1], return_counts=True)[1]
    return not (skips.sum() >= _FEW_SKIPS and skips.max() > _MOST_OF_THEM * skips.sum())


def _readings(data: NDArray[np.uint8], start: int, end: int, order: ByteOrder) -> Iterator[Field]:
    """All ways to read a number from these bits: byte order, integer or float."""
    first, width, length = start // 8, -(-end // 8) - start // 8, end - start
    of_bytes = length == 8 * width
    orders: tuple[ByteOrder, ...] = ("little", "big") if of_bytes and width > 1 else (order,)
    part = None if of_bytes else BitRange(start % 8 if order == "little" else -end % 8, length)
    for each in orders:
        raw = _raw(data, first, width, each)
        numbers = raw if part is None else part.values(raw)
        bits = _cost(numbers, length)
        kind = _kind(numbers, bits, length)
        yield Field(first, width, each, False, _is_signed(numbers, length), kind, bits, part)
        if of_bytes and width == np.dtype(np.float32).itemsize:
            with np.errstate(invalid="ignore"):  # the bits may be no valid float
                real = raw.astype(np.uint32).view(np.float32).astype(np.float64)
            if _is_plausible(real):
                bits = _float_cost(real)
                yield Field(first, width, each, True, True, _kind(raw, bits, length), bits)


def _raw(data: NDArray[np.uint8], first: int, width: int, order: ByteOrder) -> NDArray[np.uint64]:
    """Bytes as 64-bit integers (N,)."""
    columns = data[:, first : first + width].T.astype(np.uint64)
    found = np.zeros(data.shape[0], np.uint64)
    for column in columns if order == "big" else columns[::-1]:
        found = (found << np.uint64(8)) | column
    return found


def _signed(raw: NDArray[np.uint64], length: int) -> Floats:
    """Integers (N,) of ``length`` bits as two's complements; for differences, the smaller one modulo 2^length."""
    unused = 64 - length
    return ((raw << np.uint64(unused)).view(np.int64) >> np.int64(unused)).astype(np.float64)


def _cost(raw: NDArray[np.uint64], length: int) -> float:
    """Mean bits to encode an integer by its value, its difference or its second difference, whichever takes least.

    Differences are modulo 2^length, so that a number that wraps counts as smooth.
    """
    series, costs = raw, list[float]()
    for _ in range(3):
        costs.append(_code_bits(_signed(series, length)))
        series = np.diff(series)
    return min(costs)


def _float_cost(real: Floats) -> float:
    """Like ``_cost`` for a floating-point number, in steps of the resolution at its largest value.

    Digits of small numbers below such a step are added to the cost, as arbitrary bits look like floats of all
    magnitudes.
    """
    largest = float(np.max(np.abs(real)))
    step, series, costs = largest * 2.0**-_MANTISSA, real, list[float]()
    for _ in range(3):
        costs.append(_code_bits(np.rint(series / step)))
        series = np.diff(series)
    below = np.frexp(largest)[1] - np.frexp(real[real != 0])[1]
    return min(costs) + float(np.sum(np.minimum(below, _MANTISSA))) / real.size


def _code_bits(x: Floats) -> float:
    """Mean bits of integers in an adaptive code: entropy of the lengths, then the remaining digits and the sign."""
    digits = np.frexp(np.abs(x))[1]  # 0 for 0, 1 for 1, 2 for 2 and 3, ...
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
    """Whether the number crosses zero rather than the middle of its range; without crossings, whether it is near -1."""
    numbers, limit = raw.astype(np.float64), 2.0 ** (length - 1)
    upper = numbers >= limit
    crossings = np.flatnonzero(upper[1:] != upper[:-1])
    if not crossings.size:
        return bool(np.all(numbers >= limit * 1.5))
    # Nearer to 0 or to the last number than to the middle.
    at_zero = np.minimum(numbers, 2 * limit - 1 - numbers) < limit / 2
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
