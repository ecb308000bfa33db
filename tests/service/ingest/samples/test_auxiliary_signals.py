"""Further signals come with the samples: the last value received by then, if it is not too old."""

import math
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.arrays import Floats
from monitor_core.samples import concatenate
from service.can.frames import Frame, FrameBlock
from service.can.user_errors import RecordError
from service.commands.play import encode_table
from service.config import Config
from service.ingest.records.record_files import read_record
from service.ingest.samples.axis_columns import AxisColumns
from service.ingest.samples.bus_samples import Ingest
from service.ingest.samples.encode import FrameEncoder, SampleValues
from service.ingest.samples.motion_derivatives import MotionDerivative, derivative_late
from service.ingest.samples.quantities import HeldColumns
from service.ingest.tables.csv_tables import CsvRows
from tests.service.ingest import plant
from tests.service.ingest.plant import START_US, angle1, axis1, axis2, axis4, both2, make_config, torque1

HEAT = {"name": "heat", "message": "Other", "signal": "Something", "factor": 0.5, "offset": -10.0}
ACCELERATION = {"name": "one-acceleration", "axis": "one", "acceleration": True, "factor": 3.0}
GATE_TWO = {"gate": [{"signal": "one-acceleration", "above": -1e12}]}
GATE = {"gate": [{"signal": "heat", "above": 0.0}]}


def heat(t_us: int, raw: int) -> Frame:
    return Frame(t_us, 320, False, bytes([raw, 0, 0, 0, 0, 0, 0, 0]))


def pair(t_us: int, torque: float = 1.0, angle: float = 2.0) -> list[Frame]:
    return [torque1(t_us, torque), angle1(t_us + 100, angle)]


def fed(config: Config, *frames: Frame, axis_id: str = "r.one") -> list[tuple[float, ...]]:
    """The further signals of each sample."""
    return [sample.signals for sample in plant.fed(Ingest(config, "bus0"), frames)[axis_id]]


def test_a_sample_has_the_last_value_received_by_then(tmp_path: Path) -> None:
    config = make_config(tmp_path, axis1(signal=[HEAT], **GATE))
    T = START_US
    frames = [
        *pair(T),
        heat(T + 2000, 100),
        *pair(T + 5000),
        heat(T + 7000, 60),
        heat(T + 8000, 62),
        *pair(T + 10_000),
        torque1(T + 15_000, 1.0),
        heat(T + 15_050, 80),  # between the two of a sample: it is there when the sample is complete
        angle1(T + 15_100, 2.0),
    ]
    first, *others = fed(config, *frames)
    assert len(first) == 1
    assert math.isnan(first[0])
    assert others == [(40.0,), (21.0,), (30.0,)]


def test_an_axis_that_needs_none_has_none(tmp_path: Path) -> None:
    unused = make_config(tmp_path, axis1(signal=[HEAT]))
    ingest = Ingest(unused, "bus0")
    assert (320, False) not in ingest.decoder.keys
    assert plant.fed(ingest, pair(START_US)) == {"r.one": [plant.Sample(START_US + 100, 1.0, 2.0)]}


def test_an_old_value_is_not_known_until_there_is_a_new_one_nor_after_the_clock_is_set_back(
    tmp_path: Path,
) -> None:
    config = make_config(tmp_path, axis1(signal=[{**HEAT, "max_age_s": 0.02}], **GATE))
    T = START_US
    times = [T + 5000 * k for k in range(8)]
    frames = [
        heat(T - 100, 100),
        *(f for t in times for f in pair(t)),
        heat(T + 36_000, 50),
        *pair(T + 40_000),
    ]
    known = [not math.isnan(value) for (value,) in fed(config, *frames)]
    assert known == [True] * 4 + [False] * 4 + [True]
    config = make_config(tmp_path, axis1(signal=[HEAT], **GATE))
    (value,) = fed(config, heat(START_US, 100), *pair(START_US - 3_600_000_000))[0]
    assert math.isnan(value)


def test_the_motion_of_another_axis(tmp_path: Path) -> None:
    other = {"name": "speed2", "axis": "two", "factor": 2.0, "offset": 1.0}
    gate = [{"signal": "speed2", "above": 0.0}]
    two = axis2()
    two["speed"] |= {"factor": -3.0, "offset": 0.25}
    config = make_config(tmp_path, axis1(signal=[other], gate=gate), two)
    T = START_US
    frames = [
        both2(T, 0.5, 1.0),
        *pair(T + 50),
        *pair(T + 5000),
        both2(T + 7000, 0.5, 2.0),
        *pair(T + 10_000),
    ]
    assert fed(config, *frames) == [(-4.5,), (-4.5,), (-10.5,)]
    assert fed(config, *frames, axis_id="r.two") == [(), ()]


@pytest.mark.parametrize("first", ["one", "two"])
def test_the_acceleration_of_another_axis(first: str, tmp_path: Path) -> None:
    """That in the middle to the next sample, whichever axis sends first, and whatever the times of receipt."""
    two = axis2(signal=[ACCELERATION], **GATE_TWO)
    sender = axis1()
    sender["angle"] |= {"factor": -2.0}
    config = make_config(tmp_path, sender, two)
    T, h, count, lost, frames = START_US, 0.005, 40, 19, list[Frame]()
    for k in range(count):
        early = T + 5000 * k + 300 * (k % 3)
        of_two = [both2(early if first == "two" else early + 1500, 0.5, 1.0)]
        of_one = [] if k == lost else pair(early if first == "one" else early + 1500, angle=2.0 + 30.0 * (k * h) ** 3)
        frames += of_one + of_two if first == "one" else of_two + of_one
    found = np.array(fed(config, *frames, axis_id="r.two"))[:, 0]
    wanted = -6.0 * 180.0 * h * (np.arange(count) + 0.5)
    # The first two have none; around the lost one the nearest is taken, or none.
    near, beside = np.arange(count - 4), range(lost - 3, lost + 3)
    exact = np.setdiff1d(near[2:], beside)
    # The bus sends the angle in steps, of which some 0.5 make the second difference.
    step = 6.0 * 2.0**-16 / h**2 / 2
    np.testing.assert_allclose(found[exact], wanted[exact], atol=step)
    off = np.abs(found - wanted[: len(found)])
    given = off[beside][np.isfinite(off[beside])]
    assert given.size >= len(beside) - 2
    assert (given < step + 5.0 * 6.0 * 180.0 * h).all()


@pytest.mark.parametrize(("h", "waits"), [(0.005, 4), (0.001, 10)])
def test_the_speed_of_the_axis_itself(h: float, waits: int, tmp_path: Path) -> None:
    own = {"name": "speed", "axis": "one", "speed": True, "factor": 2.0}
    sender = axis1(signal=[own], gate=[{"signal": "speed", "above": -1e12}], sample_interval_s=h)
    config, count = make_config(tmp_path, sender), 40
    step_us = round(1e6 * h)
    frames = [f for k in range(count) for f in pair(START_US + step_us * k, angle=2.0 + 30.0 * (k * h) ** 2)]
    found = np.array(fed(config, *frames))[:, 0]
    assert len(found) == count - waits  # a sample waits for some more
    wanted = 2.0 * 60.0 * h * (np.arange(count - waits) + 0.5)  # in the middle to the next sample
    step = 2.0 * 2.0**-16 / h  # by the steps in which the bus sends the angle
    np.testing.assert_allclose(found[waits - 1 :], wanted[waits - 1 :], atol=step)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(("interval_s", "late"), [(0.01, 3), (0.004, 3), (0.002, 5), (0.001, 9), (0.000125, 65)])
def test_a_derivative_of_a_parabola_is_exact(order: Literal[1, 2], interval_s: float, late: int, seed: int) -> None:
    """At any interval; the noise of the angle adds little, as it is taken over 16 ms at least."""
    rng = np.random.default_rng(seed)
    assert derivative_late(interval_s) == late
    count = 2 * late + 2000
    t: Floats = interval_s * np.arange(count, dtype=float)
    taken = MotionDerivative(order, interval_s)
    sent: Floats = 1e6 * t
    noise = rng.normal(size=count)
    found = taken.take(0.5 + 2.0 * t + 15.0 * t**2, sent, np.arange(1, count + 1), sent)
    assert np.isnan(found[: 2 * late - 2]).all()
    wanted = 2.0 + 30.0 * t if order == 1 else np.full(count, 30.0)
    np.testing.assert_allclose(found[2 * late :], wanted[late:-late], rtol=1e-5)
    scatter = MotionDerivative(order, interval_s).take(noise, sent, np.arange(1, count + 1), sent)
    assert np.nanstd(scatter) < 1.2 * (80 if order == 1 else 34_000)  # those at 4 ms


def test_a_value_in_the_very_frame_of_the_sample_counts(tmp_path: Path) -> None:
    mode = {"name": "mode", "message": "Wide4", "signal": "Mode"}
    config = make_config(tmp_path, axis4(signal=[mode], gate=[{"signal": "mode", "equals": [3.0]}]))
    data = bytearray(64)
    data[0:4], data[5], data[60:64] = struct.pack("<f", 1.5), 3, struct.pack("<f", 2.5)
    assert fed(config, Frame(START_US, 304, False, bytes(data)), axis_id="r.four") == [(3.0,)]


def test_a_value_that_is_no_number_is_passed_over(tmp_path: Path) -> None:
    torque4 = {"name": "other", "message": "Wide4", "signal": "Torque"}
    config = make_config(tmp_path, axis1(signal=[torque4], gate=[{"signal": "other", "above": 0.0}]))

    def wide(t_us: int, value: float) -> Frame:
        return Frame(t_us, 304, False, struct.pack("<f", value) + bytes(60))

    T = START_US
    frames = [wide(T, 1.5), wide(T + 10, math.nan), wide(T + 20, math.inf), *pair(T + 100)]
    assert fed(config, *frames) == [(1.5,)]


def test_what_is_needed_is_what_is_followed_or_gates(tmp_path: Path) -> None:
    signals = [{**HEAT, "name": name} for name in ("a", "b", "c", "d")]
    varying = [{"parameter": "kT", "signal": "cos(d)", "slope": 0.1, "reference": 0.0}]
    axis = axis1(signal=signals, gate=[{"signal": "b", "above": 0.0}])
    axis["model"] |= {"schedule": varying}
    config = make_config(tmp_path, axis)
    assert [held.quantity.name for held in next(iter(Ingest(config, "bus0").axes.values())).held] == [
        "signal b",
        "signal d",
    ]
    names = [
        value.quantity for value in Ingest(config, "bus0").feed_values(FrameBlock.from_frames([heat(START_US, 30)]))
    ]
    assert names == ["signal b", "signal d"]


# --- tables -----------------------------------------------------------------------------------------------


def table_axis(**other: Any) -> dict[str, Any]:
    return axis1(time={"column": "t"}, signal=[{**HEAT, "column": "warm"}], **GATE, **other)


def signals_of(path: Path, config: Config) -> np.ndarray:
    blocks = [step.samples["r.one"] for step in read_record(path, config).steps() if step.samples]
    return np.concatenate([block.signals for block in blocks if block.signals is not None])


def written(folder: Path, rows: Sequence[str], names: str = "t,torque_one,angle_one,warm") -> Path:
    path = folder / "a.csv"
    path.write_text("\n".join([names, *rows]) + "\n", encoding="utf-8")
    return path


def test_a_column_is_held_over_empty_cells(tmp_path: Path) -> None:
    rows = ["0,1,2,", "0.005,1,2,100", "0.01,1,2,", "0.012,,,60", "0.015,1,2,", ",1,2,7", "1e300,1,2,9"]
    rows += ["0.02,1,2,", "0.025,1,2,80", "10.026,1,2,"]
    found = signals_of(written(tmp_path, rows), make_config(tmp_path, table_axis()))
    np.testing.assert_array_equal(found[:, 0], [math.nan, 40.0, 40.0, 20.0, 20.0, 30.0, math.nan])


@settings(max_examples=30)
@given(cells=st.lists(st.sampled_from(["", "5", "7.5", "nan"]), min_size=2, max_size=60), rows=st.integers(1, 20))
def test_blocks_of_a_table_change_nothing(
    cells: list[str], rows: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("held")
    config = make_config(folder, table_axis())
    path = written(folder, [f"{0.005 * k:.6f},1,2,{cell}" for k, cell in enumerate(cells)])
    warm = np.array([float(cell) if cell else math.nan for cell in cells])
    t_us = np.rint(5000.0 * np.arange(len(cells)))
    sources, at_once = config.axes[0].sources, signals_of(path, config)
    held = HeldColumns(sources, 0.005)
    pieces = [held.take(t_us[k : k + rows], {"warm": warm[k : k + rows]}) for k in range(0, len(cells), rows)]
    np.testing.assert_array_equal(np.concatenate(pieces), at_once)


def test_the_column_of_another_axis(tmp_path: Path) -> None:
    other = {"name": "speed2", "axis": "two", "factor": 2.0}
    first = axis1(signal=[other], gate=[{"signal": "speed2", "above": 0.0}])
    path = written(tmp_path, ["1,2,1,3", "1,2,1,4"], "torque_one,angle_one,torque_two,speed_two")
    np.testing.assert_array_equal(signals_of(path, make_config(tmp_path, first, axis2())), [[6.0], [8.0]])
    first["signal"][0]["column"] = "torque_two"
    np.testing.assert_array_equal(signals_of(path, make_config(tmp_path, first, axis2())), [[2.0], [2.0]])


def test_the_acceleration_of_another_axis_in_a_table(tmp_path: Path, seed: int) -> None:
    """As on the bus, in the middle to the next row; blocks change nothing, to the last bit."""
    rng = np.random.default_rng(seed)
    rows = 60
    t_us: Floats = np.arange(0.0, 5000.0 * rows, 5000.0)
    angle: Floats = np.cumsum(rng.normal(size=rows))
    config = make_config(
        tmp_path, axis1(time={"column": "t"}), axis2(time={"column": "t"}, signal=[ACCELERATION], **GATE_TWO)
    )
    (source,) = sources = config.axes[1].sources
    columns = {
        "t": 1e-6 * t_us,
        "torque_two": np.arange(rows) / 100,
        "speed_two": np.zeros(rows),
        "angle_one": angle,
    }
    at_once, in_blocks = (
        concatenate(
            [
                taken.samples(CsvRows({n: c[k : k + length] for n, c in columns.items()}, 1.0), k)
                for k in range(0, rows, length)
            ]
        )
        for taken, length in ((AxisColumns(config.axes[1], sources), n) for n in (rows, 7))
    )
    assert at_once.signals is not None
    np.testing.assert_array_equal(in_blocks.signals, at_once.signals)
    np.testing.assert_array_equal(at_once.t_us, t_us[:-4])
    np.testing.assert_array_equal(at_once.u, columns["torque_two"][:-4])
    second = np.convolve(angle, np.array([2, 1, -3, -3, 1, 2]) / 14, "valid") / 0.005**2
    np.testing.assert_allclose(at_once.signals[2:, 0], source.factor * second[:-1], rtol=1e-6)
    angle[30] = math.nan
    held = HeldColumns(sources, 0.005).take(t_us, {"angle_one": angle})[:, 0]
    assert np.flatnonzero(np.isnan(held)).tolist() == [0, 1, 2, 3]  # else the nearest


def test_a_long_table_has_the_signals_of_its_parts(tmp_path: Path, seed: int) -> None:
    """Rows are worked on in blocks, which change nothing, to the last bit: an axis that also moves with the other."""
    rng, rows = np.random.default_rng(seed), 140_000
    config = make_config(
        tmp_path,
        axis1(time={"column": "t"}),
        axis2(time={"column": "t"}, signal=[ACCELERATION], **GATE_TWO),
    )
    columns: dict[str, Floats] = {
        "t": np.asarray(5e-3 * np.arange(rows), np.float64),
        "torque_two": rng.normal(size=rows),
        "speed_two": rng.normal(size=rows),
        "angle_one": np.cumsum(rng.normal(size=rows)),
    }
    columns["torque_two"][rng.integers(0, rows, 30)] = np.nan
    at_once, in_parts = (
        concatenate(
            [
                taken.samples(CsvRows({n: c[k : k + length] for n, c in columns.items()}, 1.0), k)
                for k in range(0, rows, length)
            ]
        )
        for taken, length in ((AxisColumns(config.axes[1], config.axes[1].sources), n) for n in (rows, 9000))
    )
    assert rows - 40 < at_once.size < rows - 20
    for name in ("t_us", "u", "y", "signals"):
        np.testing.assert_array_equal(getattr(in_parts, name), getattr(at_once, name))


def test_a_column_that_is_missing_is_named(tmp_path: Path) -> None:
    path = written(tmp_path, ["0,1,2"], "t,torque_one,angle_one")
    with pytest.raises(RecordError, match=r'no column "warm" for the signal heat of axis r\.one'):
        read_record(path, make_config(tmp_path, table_axis()))
    nowhere = axis1(signal=[HEAT], **GATE)
    with pytest.raises(RecordError, match=r"axis r\.one: the signal heat has no column in the configuration"):
        read_record(path, make_config(tmp_path, nowhere))


# --- frames of samples ----------------------------------------------------------------------------------------


def test_what_is_encoded_is_what_is_received(tmp_path: Path) -> None:
    other = {"name": "speed2", "axis": "two"}
    gates = [{"signal": "heat", "above": 0.0}, {"signal": "speed2", "above": 0.0}]
    config = make_config(tmp_path, axis1(signal=[HEAT, other], gate=gates), axis2())
    encoder, ingest = FrameEncoder(config, "bus0"), Ingest(config, "bus0")
    found = []
    for k in range(3):
        values: dict[str, SampleValues] = {"r.one": (1.0, 2.0, (5.0 + k, 99.0)), "r.two": (0.5, 0.25 * k)}
        frames = encoder.encode(values, k)
        assert frames[0].key.can_id == 320, "signals first: they are of this sample"
        assert sum(key.can_id == 272 for key, _ in frames) == 1
        block = [Frame(START_US + 5000 * k, *key, data) for key, data in frames]
        found += [sample.signals for sample in plant.fed(ingest, block).get("r.one", [])]
    assert math.isnan(found[0][1]), "the other axis had not sent by then"
    assert [signals[0] for signals in found] == [5.0, 6.0, 7.0]
    assert [signals[1] for signals in found[1:]] == [0.0, 0.25]


def test_a_table_is_played_with_its_signals(tmp_path: Path) -> None:
    rows = ["0,1,2,", "0.005,1,2,100", "0.01,1,2,"]
    config = make_config(tmp_path, table_axis())
    frames = encode_table(read_record(written(tmp_path, rows), config), config)
    assert [f.key.can_id for f in frames if f.key.can_id == 320] == [320, 320], "what is not known is not sent"
