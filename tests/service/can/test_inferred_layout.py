"""The division of unknown messages into numbers: those of simulated robots and of hand-made frames are found again."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from service.can.frames import concatenate_frames
from service.can.inferred_layout import BitRange, Field, counts_frames, find_multiplexer, infer_layout
from service.can.log_files import CanLog

N = 1000


def smooth(rng: np.random.Generator, largest: float, noise: float) -> NDArray[np.float64]:
    """A motion: some sines up to ``largest``, and noise."""
    t = np.arange(N) * 0.005
    sines = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in rng.uniform(0.1, 2, 3))
    return np.asarray(largest * sines / 3 + noise * rng.standard_normal(N), np.float64)


def packed(form: str, *columns: NDArray[np.float64]) -> NDArray[np.uint8]:
    integers = [c if kind in "fd" else np.rint(c).astype(int) for kind, c in zip(form[1:], columns, strict=True)]
    rows = zip(*(c.tolist() for c in integers), strict=True)
    return np.frombuffer(b"".join(struct.pack(form, *row) for row in rows), np.uint8).reshape(N, -1)


def places(fields: tuple[Field, ...]) -> list[tuple[int, int, str, str]]:
    kinds = {(True, True): "float", (False, True): "signed", (False, False): "unsigned"}
    return [(f.first_byte, f.width, f.byte_order, kinds[f.is_float, f.is_signed]) for f in fields]


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.sampled_from("<>"), st.permutations("hif"), st.floats(1, 300))
def test_numbers_of_every_width_order_and_place(seed: int, order: str, kinds: list[str], noise: float) -> None:
    rng = np.random.default_rng(seed)
    columns = {
        "h": smooth(rng, 2e4, noise),
        "i": smooth(rng, 3e7, 10 * noise),
        "f": smooth(rng, 8, 1e-3 * noise),
    }
    form, name = order + "".join(kinds), {"<": "little", ">": "big"}[order]
    data, first = packed(form, *(columns[kind] for kind in kinds)), 0
    for kind, found in zip(kinds, infer_layout(data), strict=True):
        width = struct.calcsize(kind)
        sign = "float" if kind == "f" else "signed"
        assert places((found,)) == [(first, width, name, sign)]
        assert found.kind == "signal"
        expected = columns[kind].astype(np.float32) if kind == "f" else np.rint(columns[kind])
        np.testing.assert_array_equal(found.values(data), expected)
        first += width


def test_counter_state_constant_and_checksum() -> None:
    rng = np.random.default_rng(5)
    data = np.zeros((N, 4), np.uint8)
    data[:, 0] = np.arange(N) % 256
    data[:, 1] = np.arange(N) > N // 2
    data[:, 3] = rng.integers(0, 256, N)
    found = {field.first_byte: field.kind for field in infer_layout(data) if field.width == 1}
    assert (found[0], found[3]) == ("counter", "random")
    assert [f.kind for f in infer_layout(data[:, 1:2])] == ["state"]
    assert [f.kind for f in infer_layout(data[:, 2:3])] == ["constant"]


def test_bits_that_look_like_a_float_of_all_sizes_are_none() -> None:
    """A byte that varies, a torque and the lowest byte of an angle: as a float, most seem to be near zero."""
    rng = np.random.default_rng(3)
    counter = 0x30 + np.arange(N) % 16
    data = np.column_stack([counter.astype(np.uint8), packed(">hi", smooth(rng, 3e3, 20), 2e9 + smooth(rng, 1e7, 20))])
    counted, _, *numbers = infer_layout(data)
    assert (counted.kind, counted.part) == ("counter", BitRange(0, 4))
    assert places(tuple(numbers)) == [(1, 2, "big", "signed"), (3, 4, "big", "unsigned")]


@pytest.mark.parametrize("order", ["little", "big"])
def test_numbers_that_are_no_whole_bytes(order: str) -> None:
    """A state of four bits, a torque of 12, an angle of 24, a temperature of 10, and a counter of 6."""
    rng = np.random.default_rng(4)
    columns = [
        np.arange(N) // 300 % 4,
        np.rint(smooth(rng, 1500, 3)).astype(int),
        np.rint(smooth(rng, 5e6, 30)).astype(int),
        np.rint(300 + smooth(rng, 150, 2)).astype(int),
        np.arange(N) % 64,
    ]
    lengths, first, words = (4, 12, 24, 10, 6), 0, np.zeros(N, object)
    for numbers, length in zip(columns, lengths, strict=True):
        shift = first if order == "little" else 56 - first - length
        words |= (numbers % (1 << length)).astype(object) << shift
        first += length
    data = np.frombuffer(b"".join(w.to_bytes(7, order) for w in words), np.uint8).reshape(N, 7)
    fields = infer_layout(data)
    assert [field.kind for field in fields] == ["state", "signal", "signal", "signal", "counter"]
    assert [field.length for field in fields] == list(lengths)
    for numbers, field in zip(columns, fields, strict=True):
        assert field.byte_order == order or field.width == 1
        np.testing.assert_array_equal(field.values(data), numbers)


def test_an_angle_that_passes_zero_below_a_temperature() -> None:
    """24 bits: with those above as one number it would jump where it passes zero, which is seldom."""
    count = 4000
    angle = np.rint(1e5 * np.sin(np.arange(count) / 150)).astype(int)
    rows = [struct.pack("<i", a)[:3] + struct.pack("<H", 300 + k // 1500) for k, a in enumerate(angle)]
    data = np.frombuffer(b"".join(rows), np.uint8).reshape(count, 5)
    (found, *_) = infer_layout(data)
    assert places((found,)) == [(0, 3, "little", "signed")]
    np.testing.assert_array_equal(found.values(data), angle)


@pytest.mark.parametrize(("shift", "length", "other"), [(0, 4, 3), (4, 4, 9), (6, 2, 17), (0, 7, 1)])
def test_a_counter_that_shares_its_byte(shift: int, length: int, other: int) -> None:
    numbers = np.arange(N) % (1 << length)
    numbers = np.delete(numbers, [100, 101, 450])  # frames that were lost
    beside = other << (length if shift == 0 else 0)
    data = (numbers << shift | beside).astype(np.uint8)[:, np.newaxis]
    parts = {part.kind: part for part in infer_layout(data)}
    assert parts["counter"].part == BitRange(shift, length)
    np.testing.assert_array_equal(parts["counter"].values(data), numbers)
    np.testing.assert_array_equal(parts["constant"].values(data), other)


def test_what_counts_the_frames() -> None:
    lost = np.delete(np.arange(5000.0), slice(7, None, 50))
    assert counts_frames(lost % 256, 256)
    assert not counts_frames(lost % 16, 256)  # of four bits
    assert not counts_frames(lost % 15, 16)  # of AUTOSAR, from 0 to 14
    assert not counts_frames(np.repeat(lost, 2) % 256, 256)


def test_registers_of_an_inverter_are_told_apart() -> None:
    """Speed and current in turn, named by the first byte."""
    rng = np.random.default_rng(7)
    data = np.zeros((N, 3), np.uint8)
    data[:, 0] = np.where(np.arange(N) % 2, 0x30, 0x20)
    speed, current = smooth(rng, 2e4, 20), smooth(rng, 3e3, 20)
    data[:, 1:] = packed("<h", np.where(np.arange(N) % 2, speed, current))
    assert find_multiplexer(data, infer_layout(data)) == 0
    assert find_multiplexer(data[::2], infer_layout(data[::2])) is None
    assert places(infer_layout(data[::2, 1:])) == [(0, 2, "little", "signed")]


@pytest.mark.records
def test_a_real_bus(records_dir: Path) -> None:
    """Two inverters, idle: their big-endian numbers are found, and no multiplexer where there is one value."""
    frames = concatenate_frames([block.frames for block in CanLog(records_dir / "can/inverter_idle.log").blocks()])
    data = frames.select(frames.ids == 0x4EC).data[:, :8]
    assert places(infer_layout(data))[:2] == [(0, 2, "big", "unsigned"), (2, 2, "big", "signed")]
    data = frames.select(frames.ids == 0xC0).data[:, :8]
    assert find_multiplexer(data, infer_layout(data)) is None
