"""The motor of an axis that also moves with other axes: its motion is the same from a bus and from a table."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.samples import SampleBlock, concatenate
from service.can.frames import Frame, FrameBlock
from service.can.user_errors import IngestError, RecordError
from service.config import Config
from service.ingest.records.axis_records import axis_record
from service.ingest.records.record_files import read_record
from service.ingest.samples.arm_motions import ArmMotions
from service.ingest.samples.bus_samples import Ingest
from service.ingest.samples.encode import FrameEncoder, SampleValues
from tests.service.ingest import plant
from tests.service.ingest.plant import START_US, Axis, angle1, axis, axis1, both2, make_config, torque1, write_table

H_US = 5000
COUNT = 40
OWN = {"name": "own", "axis": "one"}
FOLLOWS = [{"signal": "own", "above": -1e12}]


def second(**other: Any) -> Axis:
    """An axis whose angle is sent in one message with its torque."""
    return axis("two", ("Both2", "Torque"), ("Both2", "Speed"), "angle", **other)


def coupled(**other: Any) -> Axis:
    return axis1(coupling={"two": -0.25}, **other)


def angles(seed: int) -> tuple[Floats, Floats]:
    """Of both axes (COUNT,), as exact as the bus sends them."""
    rng = np.random.default_rng(seed)
    found = np.cumsum(rng.normal(scale=0.2, size=(2, COUNT)), axis=1)
    own, other = np.rint(65536 * found) / 65536
    return own, other


def frames(
    own: Floats, other: Floats, beside_us: int = 700, lost: int | None = None, jitter_us: int = 0
) -> list[Frame]:
    """Of both axes; the second one sends ``beside_us`` later than the first, and does not send sample ``lost``."""
    found = list[Frame]()
    for k, (a, b) in enumerate(zip(own.tolist(), other.tolist(), strict=True)):
        t_us = START_US + 10_000 + H_US * k + jitter_us * (k % 3)
        found += [torque1(t_us, k / 64), angle1(t_us + 100, a)]
        found += [] if k == lost else [both2(t_us + beside_us, 0.5, b)]
    return sorted(found, key=lambda frame: frame.t_us)


def live(config: Config, sent: list[Frame], block: int = 7, axis_id: str = "r.one") -> SampleBlock:
    """The samples of the frames, which come in blocks."""
    ingest, found = Ingest(config, "bus0"), list[SampleBlock]()
    for first in range(0, len(sent), block):
        fed = ingest.feed(FrameBlock.from_frames(sent[first : first + block]))
        found += [fed[axis_id]] if axis_id in fed else []
    return concatenate(found)


def table(folder: Path, own: Floats, other: Floats) -> Path:
    rows = np.arange(COUNT)
    columns = {"torque_one": rows / 64, "angle_one": own, "torque_two": 0.5 + 0 * own, "angle_two": other}
    return write_table(folder / "a.csv", columns)


@pytest.mark.parametrize("time", [{}, {"clock": "cyclic"}], ids=["receipt", "cyclic"])
@pytest.mark.parametrize("beside_us", [-1500, 50, 1500])
def test_the_bus_gives_the_samples_of_a_table(beside_us: int, time: dict[str, str], tmp_path: Path, seed: int) -> None:
    """Whichever axis sends first.  The last sample waits, as the other axis may send later."""
    config = make_config(tmp_path, coupled(time=time, signal=[OWN], gate=FOLLOWS), second())
    own, other = angles(seed)
    (step,) = read_record(table(tmp_path, own, other), config).steps()
    recorded, received = step.samples["r.one"], live(config, frames(own, other, beside_us, jitter_us=200))
    np.testing.assert_array_equal(recorded.y, own - 0.25 * other)
    assert recorded.signals is not None
    np.testing.assert_array_equal(recorded.signals[:, 0], own)  # that of the arm
    places = np.rint(64 * received.u).astype(int)  # which samples these are
    assert places.tolist() == list(range(places[0], COUNT - 1))
    assert places[0] <= 4  # a cyclic clock must be known first
    np.testing.assert_array_equal(received.y, recorded.y[places])
    np.testing.assert_array_equal(received.signals, recorded.signals[places])
    np.testing.assert_array_equal(step.samples["r.two"].y, other)


def test_it_refers_to_the_arm_in_a_circle_and_beside_late_torque_and_derivatives(tmp_path: Path, seed: int) -> None:
    speed = {"name": "own-speed", "axis": "one", "speed": True}
    gates = [*FOLLOWS, {"signal": "own-speed", "above": -1e12}]
    first = coupled(signal=[OWN, speed], gate=gates)
    first["torque"]["late_samples"] = 2
    config = make_config(tmp_path, first, second(coupling={"one": 0.5}))
    own, other = angles(seed)
    (step,) = read_record(table(tmp_path, own, other), config).steps()
    for block in (step.samples["r.one"], live(config, frames(own, other))):
        places = np.rint(64 * block.u).astype(int) - 2
        assert len(places) == COUNT - 4  # as long as the derivative in the middle to the next sample takes
        np.testing.assert_array_equal(block.y, (own - 0.25 * other)[places])
        assert block.signals is not None
        np.testing.assert_array_equal(block.signals[:, 0], own[places])
        fitted = np.convolve(own, np.array([2, 3, 1, -1, -3, -2]) / 20)[3:] / 0.005
        np.testing.assert_allclose(block.signals[2:, 1], fitted[places[2:]], rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(live(config, frames(own, other), axis_id="r.two").y, (other + 0.5 * own)[:-1])


def test_a_sample_whose_coupled_motion_is_lost_is_dropped(tmp_path: Path, seed: int) -> None:
    config = make_config(tmp_path, coupled(), second())
    own, other = angles(seed)
    wanted = np.delete(own - 0.25 * other, 20)
    sent = frames(own, other, lost=20)
    np.testing.assert_array_equal(live(config, sent).y, wanted[:-1])
    ingest = Ingest(config, "bus0")
    plant.fed(ingest, sent)
    assert plant.axis_drops(ingest, "r.one") == {"unpaired": 1}
    unknown = other.copy()
    unknown[20] = np.nan
    record = read_record(table(tmp_path, own, unknown), config)
    np.testing.assert_array_equal(concatenate([step.samples["r.one"] for step in record.steps()]).y, wanted)
    assert record.quality.axis_dropped["r.one"]["unpaired"] == 1


def test_scales_of_both_axes_and_a_signal_in_place_of_an_axis(tmp_path: Path, seed: int) -> None:
    own, other = angles(seed)
    first, partner = axis1(coupling={"two": -0.25, "angle2": 0.5}), second()
    first["angle"] |= {"factor": 2.0, "offset": 1.0}
    partner["angle"] |= {"factor": -4.0, "offset": 8.0}
    signal = {"name": "angle2", "message": "Both2", "signal": "Speed", "column": "angle_two", "factor": 8.0}
    config = make_config(tmp_path, first | {"signal": [signal]}, partner)
    wanted = 2.0 * own + 1.0 - 0.25 * (-4.0 * other + 8.0) + 0.5 * 8.0 * other
    np.testing.assert_allclose(live(config, frames(own, other)).y, wanted[:-1], rtol=1e-12)
    (step,) = read_record(table(tmp_path, own, other), config).steps()
    np.testing.assert_allclose(step.samples["r.one"].y, wanted, rtol=1e-12)
    assert step.samples["r.one"].signals is None


def test_an_angle_that_wraps_becomes_the_continuous_one_of_the_motor(tmp_path: Path) -> None:
    first = coupled()
    first["angle"] |= {"wrap_period": 2.0}
    config = make_config(tmp_path, first, second())
    own: Floats = np.arange(COUNT, dtype=float) * 0.25
    other = np.sin(np.arange(COUNT) / 4)
    record = axis_record(table(tmp_path, np.mod(own, 2.0), other), config, config.axes[0], ())
    np.testing.assert_allclose(record.block.y, own - 0.25 * other, atol=1e-9)


def test_what_is_encoded_is_what_is_received(tmp_path: Path, seed: int) -> None:
    """Of the motor in the program, of the arm on the bus."""
    config = make_config(tmp_path, coupled(), second(coupling={"one": 0.5}))
    encoder, (own, other), sent = FrameEncoder(config, "bus0"), angles(seed), list[Frame]()
    for k in range(COUNT):
        values: dict[str, SampleValues] = {"r.one": (1.0, own[k]), "r.two": (0.5, other[k])}
        sent += [Frame(START_US + H_US * k, *key, data) for key, data in encoder.encode(values, k)]
    for axis_id, wanted in (("r.one", own), ("r.two", other)):
        np.testing.assert_allclose(live(config, sent, axis_id=axis_id).y, wanted[:-1], atol=3e-5)  # steps of the bus
    arm = ArmMotions(config.axes)
    assert arm.take({"r.one": 1.0, "r.two": 5.0}) == pytest.approx({"r.one": 2.0, "r.two": 4.0})
    assert arm.take({"r.one": 3.0}) == pytest.approx({"r.one": 4.0})  # the other axis is where it was
    circle = make_config(tmp_path, axis1(coupling={"two": 2.0}), second(coupling={"one": 0.5}))
    with pytest.raises(IngestError, match=r"the coupling of r\.one, r\.two is a circle"):
        ArmMotions(circle.axes).take({"r.one": 1.0, "r.two": 5.0})


def test_a_column_that_is_missing_is_named(tmp_path: Path) -> None:
    path = write_table(tmp_path / "a.csv", {"torque_one": [1.0, 2.0], "angle_one": [1.0, 2.0]})
    other = second()
    with pytest.raises(RecordError, match=r'no column "angle_two" for the coupling with two of axis r\.one'):
        axis_record(path, config := make_config(tmp_path, coupled(), other), config.axes[0], ())
    del other["angle"]["column"]
    config = make_config(tmp_path, coupled(), other)
    with pytest.raises(RecordError, match=r"axis r\.one: two has no column in the configuration, and coupling adds"):
        axis_record(path, config, config.axes[0], ())
