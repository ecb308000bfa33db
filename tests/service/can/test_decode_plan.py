"""Frames are decoded in blocks to the same bits as cantools decodes each of them."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from cantools.database.errors import DecodeError
from hypothesis import given, settings
from hypothesis import strategies as st

from service.can.decode_plan import MessagePlan
from service.can.decoder import Decoder
from service.can.frames import CLASSIC_BYTES, FD_BYTES, Frame, FrameBlock, FrameKey, concatenate_frames
from service.can.message_files import read_messages
from service.can.messages import Bits, ByteOrder, MessageSet, NumberKind, message_of
from tests.service.ingest.plant import DBC

FRAMES = 12
LENGTHS = [*range(1, 9), 12, 16, 20, 24, 32, 48, 64]
NUMBERS = st.one_of(
    st.integers(-(2**40), 2**40),
    st.sampled_from([1, 0, 0.5, 2.0, -1, 0.1, 1e-9, 1 / 3]),
    st.floats(allow_nan=False, allow_infinity=False),
)


@st.composite
def signals(draw: st.DrawFn, length: int, multiplexer: str | None) -> Signal:
    """Any signal that fits into so many bytes."""
    bits = draw(st.one_of(st.sampled_from([1, 8, 16, 32, 64]), st.integers(1, 64)).filter(lambda n: n <= 8 * length))
    first = draw(st.integers(0, 8 * length - bits))
    big = draw(st.booleans())
    is_float = bits in (16, 32, 64) and draw(st.booleans())
    scale = draw(NUMBERS.filter(lambda number: number != 0))
    return Signal(
        "value",
        8 * (first // 8) + 7 - first % 8 if big else first,
        bits,
        byte_order="big_endian" if big else "little_endian",
        is_signed=draw(st.booleans()),
        conversion=BaseConversion.factory(scale, draw(NUMBERS), None, is_float),
        multiplexer_signal=multiplexer,
        multiplexer_ids=None if multiplexer is None else draw(st.lists(st.integers(0, 5), min_size=1, max_size=3)),
    )


def selector(name: str, start: int, above: tuple[str, list[int]] | None = None) -> Signal:
    """A multiplexer of three bits; its value is shifted by one."""
    return Signal(
        name,
        start,
        3,
        conversion=BaseConversion.factory(1, -1),
        is_multiplexer=True,
        multiplexer_signal=above and above[0],
        multiplexer_ids=above and above[1],
    )


@st.composite
def messages(draw: st.DrawFn) -> Message:
    """One wanted signal, which may be below one or two multiplexers; others have pages of their own."""
    length = draw(st.sampled_from(LENGTHS))
    depth = draw(st.integers(0, 2))
    above = [selector("page", 0), selector("leaf", 3, ("page", [1, 3]))][:depth]
    other = [Signal("other", 7, 1, multiplexer_signal=above[0].name, multiplexer_ids=[6])] if above else []
    wanted = draw(signals(length, above[-1].name if above else None))
    return Message(1, "M", length, [*above, *other, wanted], strict=False)


def by_cantools(message: Message, data: bytes) -> float | str | None:
    """The value, None where the signal is absent, or why there is none."""
    try:
        found = message.decode_simple(data, decode_choices=False)
    except DecodeError:
        return "undecodable"
    if "value" not in found:
        return None
    try:
        return float(found["value"])  # type: ignore[arg-type]
    except OverflowError:  # of a large factor
        return math.inf if found["value"] > 0 else -math.inf  # type: ignore[operator]


def bits(value: float | str | None) -> object:
    if isinstance(value, float):
        return "nan" if value != value else struct.pack("<d", value)
    return value


@settings(max_examples=60)
@given(message=messages(), seed=st.integers(0, 2**32), extra=st.booleans())
def test_a_block_has_the_bits_of_cantools(message: Message, seed: int, extra: bool) -> None:
    rng = random.Random(seed)
    wide = message.length > CLASSIC_BYTES or extra
    length = FD_BYTES if extra else message.length
    frames = [rng.choice([bytes(length), b"\xff" * length, rng.randbytes(length)]) for _ in range(FRAMES)]
    width = FD_BYTES if wide else CLASSIC_BYTES
    data = np.frombuffer(b"".join(frame.ljust(width, b"\0") for frame in frames), np.uint8).reshape(-1, width)
    columns, known = MessagePlan(message, ["value"]).decode(data)
    values, present = columns["value"]
    for k, frame in enumerate(frames):
        found = "undecodable" if not known[k] else float(values[k]) if present[k] else None
        assert bits(found) == bits(by_cantools(message, frame))


MODERATE = NUMBERS.filter(lambda number: abs(number) < 1e100)


@st.composite
def table_signals(draw: st.DrawFn) -> list[Bits]:
    """Signals of a table of ids, which may overlap."""
    kinds: st.SearchStrategy[NumberKind] = st.sampled_from(["unsigned", "signed", "float"])
    orders: st.SearchStrategy[ByteOrder] = st.sampled_from(["little", "big"])
    found = []
    for k in range(draw(st.integers(1, 4))):
        kind, order = draw(kinds), draw(orders)
        length = draw(st.sampled_from([16, 32, 64]) if kind == "float" else st.integers(1, 64))
        first = draw(st.integers(0, 512 - length))
        start = first if order == "little" else 8 * (first // 8) + 7 - first % 8
        found.append(Bits(f"s{k}", start, length, kind, order, draw(MODERATE), draw(MODERATE)))
    return found


def bits_of(signal: Bits) -> list[int]:
    """The bits of a table's signal, the highest first, by its definition."""
    if signal.byte_order == "little":
        return list(range(signal.start_bit + signal.length - 1, signal.start_bit - 1, -1))
    found = [signal.start_bit]
    while len(found) < signal.length:  # down, then on with the highest bit of the next byte
        found.append(found[-1] - 1 if found[-1] % 8 else found[-1] + 15)
    return found


def by_the_bits(signal: Bits, data: bytes) -> float:
    """The value, bit by bit."""
    number = 0
    for at in bits_of(signal):
        number = (number << 1) | (data[at // 8] >> (at % 8) & 1)
    if signal.kind == "float":
        raw = number.to_bytes(signal.length // 8, "big")
        real: float = struct.unpack(f">{ {16: 'e', 32: 'f', 64: 'd'}[signal.length] }", raw)[0]
        return real * signal.factor + signal.offset
    if signal.kind == "signed" and number >> signal.length - 1:
        number -= 1 << signal.length
    if signal.factor == int(signal.factor) and signal.offset == int(signal.offset):
        return number * int(signal.factor) + int(signal.offset)  # exact, rounded once
    return number * signal.factor + signal.offset


@settings(max_examples=40)
@given(table=table_signals(), seed=st.integers(0, 2**32))
def test_a_table_of_ids_has_the_values_of_its_bits_and_of_cantools(table: list[Bits], seed: int) -> None:
    rng = random.Random(seed)
    message = message_of("M", FrameKey(1, False), table)
    assert message.length == max(signal.bytes_needed for signal in table) <= 64
    frames = [rng.randbytes(64) for _ in range(5)]
    data = np.frombuffer(b"".join(frames), np.uint8).reshape(-1, 64)
    columns, _ = MessagePlan(message, [signal.name for signal in table]).decode(data)
    for signal in table:
        assert signal.bytes_needed == 1 + max(bits_of(signal)) // 8
        alone = Message(1, "M", 64, [message.get_signal_by_name(signal.name)])  # cantools refuses any overlap
        for k, frame in enumerate(frames):
            found = bits(float(columns[signal.name].values[k]))
            by_each_bit = by_the_bits(signal, frame)
            assert found == bits(float(by_each_bit))
            decoded = alone.decode_simple(frame, decode_choices=False)
            assert found == bits(float(decoded[signal.name]))  # type: ignore[arg-type]


def by_each(decoder: Decoder, wanted: Mapping[FrameKey, list[str]], frames: list[Frame]) -> tuple[Any, dict[str, int]]:
    """What single frames give: by message the place, the time and the values of each; and what is counted."""
    found: dict[FrameKey, list[tuple[int, int, dict[str, object]]]] = {}
    dropped = dict.fromkeys(("unwanted", "too_short", "undecodable", "signal_absent"), 0)
    for place, frame in enumerate(frames):
        if frame.key not in wanted:
            dropped["unwanted"] += 1
            continue
        message = decoder.messages[frame.key]
        if len(frame.data) < message.length:
            dropped["too_short"] += 1
            continue
        try:
            values = message.decode_simple(frame.data, decode_choices=False)
        except DecodeError:
            dropped["undecodable"] += 1
            continue
        mine = {n: bits(float(values[n])) for n in wanted[frame.key] if n in values}  # type: ignore[arg-type]
        dropped["signal_absent"] += len(mine) < len(wanted[frame.key])
        if mine:
            found.setdefault(frame.key, []).append((place, frame.t_us, mine))
    return found, dropped


def in_blocks(decoder: Decoder, frames: list[Frame]) -> Any:
    found = {}
    for key, (places, t_us, columns) in decoder.decode(FrameBlock.from_frames(frames)).items():
        found[key] = [
            (place, time, {n: bits(float(c.values[k])) for n, c in columns.items() if c.present[k]})
            for k, (place, time) in enumerate(zip(places.tolist(), t_us.tolist(), strict=True))
        ]
    return found


def check_messages(known: MessageSet, seed: int, count: int) -> None:
    """Random frames of all messages, some of them too short, too long or with another kind of id."""
    rng, decoder, wanted = random.Random(seed), Decoder(known), dict[FrameKey, list[str]]()
    for message in known.messages:
        for signal in message.signals:
            key = decoder.want(message.name, signal.name)
            wanted.setdefault(key, []).append(signal.name)
    keys, frames = list(wanted), list[Frame]()
    for k in range(count):
        can_id, extended = rng.choice(keys)
        length = rng.choice([decoder.messages[FrameKey(can_id, extended)].length, 8, rng.randrange(9), 64])
        data = rng.choice([rng.randbytes(length), bytes(length), bytes([rng.randrange(4)]) * length])
        frames.append(Frame(1000 + k, can_id, extended ^ (rng.random() < 0.05), data))
    found, dropped = by_each(decoder, wanted, frames)
    assert in_blocks(decoder, frames) == found
    assert decoder.dropped == dropped
    assert dropped["unwanted"]
    assert dropped["too_short"]


def test_a_plant(tmp_path: Path, seed: int) -> None:
    """With extended ids, floats, CAN FD, names of values, and pages that are in the database or not."""
    (tmp_path / "plant.dbc").write_text(DBC, encoding="utf-8")
    check_messages(read_messages(tmp_path / "plant.dbc"), seed, 1000)


@pytest.mark.records
def test_a_drive_that_can_be_bought(records_dir: Path, seed: int) -> None:
    check_messages(read_messages(records_dir / "can" / "odrive-cansimple.dbc"), seed, 3000)


def test_frames_of_any_length_are_joined_and_come_out_again(seed: int) -> None:
    rng = random.Random(seed)
    parts = [
        [
            Frame(
                rng.randrange(2**50),
                rng.randrange(2**11),
                rng.random() < 0.5,
                rng.randbytes(rng.choice(lengths)),
            )
            for _ in range(5)
        ]
        for lengths in ([0, 3, 8], [8, 12, 64], [1])
    ]
    block = concatenate_frames([FrameBlock.from_frames(part) for part in parts])
    frames = [frame for part in parts for frame in part]
    assert list(block.frames()) == frames
    odd = np.array([frame.extended for frame in frames])
    assert list(block.select(odd).frames()) == [frame for frame in frames if frame.extended]
    assert block.counts() == {frame.key: sum(f.key == frame.key for f in frames) for frame in frames}
    assert list(concatenate_frames([]).frames()) == []


def test_a_database_without_the_page_of_a_frame(tmp_path: Path) -> None:
    """Wanted or not, a multiplexer with an unknown value makes the frame undecodable, as for cantools."""
    message = Message(
        1,
        "M",
        8,
        [
            selector("page", 0),
            Signal("plain", 8, 8),
            Signal("a", 16, 8, multiplexer_signal="page", multiplexer_ids=[1]),
        ],
    )
    data = np.zeros((2, 8), np.uint8)
    data[:, 0] = [2, 5]
    columns, known = MessagePlan(message, ["plain"]).decode(data)
    assert list(columns) == ["plain"]
    assert known.tolist() == [True, False]
