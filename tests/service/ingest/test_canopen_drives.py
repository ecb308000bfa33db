"""Drives that speak CANopen: frames of the canopen package give its own values, by the EDS and a few numbers."""

from __future__ import annotations

import math
import random
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import canopen
import numpy as np
import pytest

from service.can.canopen_drives import read_drive
from service.can.decoder import SyncCycle
from service.can.frames import Frame, FrameBlock
from service.can.messages import DescriptionError, find_signal
from service.config import ConfigErrors, load
from service.config.remarks import remarks
from service.config.written.commissioned import Found, commissioned
from service.ingest.roles.drive_objects import nodes_in
from service.ingest.samples.bus_samples import Ingest
from service.ingest.samples.encode import FrameEncoder
from tests.conftest import ROOT
from tests.service.canopen_files import TWO_PDOS, Pdo, eds, settings
from tests.service.ingest.plant import Sample, fed

CONFIG = """\
[[bus]]
name = "can0"
channel = "can0"
[[robot]]
name = "r"
[robot.defaults]
sample_interval_s = 0.01
model = { drive = "one-mass", monitor = ["kT", "fm"], nominal = { kT = 1 } }
canopen = { eds = "drive.eds", rated_torque_Nm = 1.25, counts_per_turn = 4096 }
[[robot.axis]]
name = "a"
canopen = { node_id = 3 }
"""
RATED, COUNT = 1.25 / 1000, 2 * math.pi / 4096


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "drive.eds").write_text(eds(), encoding="utf-8")
    return tmp_path


def configured(folder: Path, *changes: tuple[str, str]) -> Any:
    text = CONFIG
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "a.toml").write_text(text, encoding="utf-8")
    return load(folder / "a.toml", {})


def refused(folder: Path, *changes: tuple[str, str]) -> str:
    with pytest.raises(ConfigErrors) as caught:
        configured(folder, *changes)
    return "\n".join(str(problem).removeprefix(f"{folder}/") for problem in caught.value.problems)


# --- what the canopen package sends and reads ---------------------------------------------------------------


@pytest.fixture
def drive(folder: Path, request: pytest.FixtureRequest) -> Iterator[tuple[Any, Any, Any]]:
    """Node 3 on a virtual bus, its network, and what receives the frames."""
    channel = f"canopen-{request.node.name}"
    network = canopen.Network()
    network.connect(interface="virtual", channel=channel)
    receiver = can.Bus(interface="virtual", channel=channel)
    node = network.create_node(3, str(folder / "drive.eds"))
    node.tpdo.read(from_od=True)  # type: ignore[no-untyped-call]
    yield network, node, receiver
    receiver.shutdown()
    network.disconnect()


def received(receiver: Any) -> list[Frame]:
    frames = list[Frame]()
    while (message := receiver.recv(0)) is not None:
        t_us = 10_000 * (len(frames) // 4) + 100 * len(frames)
        frames.append(Frame(t_us, message.arbitration_id, False, bytes(message.data)))
    return frames


def test_a_node_of_the_canopen_package(folder: Path, drive: tuple[Any, Any, Any], seed: int) -> None:
    """Each value that it sends, as it decodes it itself; torque and motion of a SYNC are one sample."""
    network, node, receiver = drive
    rng, sent = random.Random(seed), list[dict[str, float]]()
    ranges = {"statusword": (0, 1 << 16), "position_actual_value": (-(1 << 31), 1 << 31)}
    for _ in range(20):
        network.sync.transmit()
        for number in (1, 2, 3):
            for variable in node.tpdo[number]:
                if variable.index >= 0x2000 and variable.name != "motor_voltage":
                    variable.raw = rng.randrange(*ranges.get(variable.name, (-(1 << 7), 1 << 7)))
            node.tpdo[number].transmit()
        torque, motion, other = (node.tpdo[n] for n in (1, 2, 3))
        sent.append(
            {
                "0x6041": torque["statusword"].raw,
                "0x6077": torque["torque_actual_value"].raw,
                "0x6078": torque["current_actual_value"].raw,
                "0x6064": motion["position_actual_value"].raw,
                "0x606C": motion["velocity_actual_value"].raw,
                "0x2030.1": other["record 2030.entry 1"].raw,
            }
        )
    frames = received(receiver)
    assert len(frames) == 80
    signals = [{"name": name.replace(".", "_"), "signal": name} for name in sent[0] if name not in ("0x6077", "0x6064")]
    listing = ", ".join(f'{{ name = "{s["name"]}", signal = "{s["signal"]}" }}' for s in signals)
    config = configured(folder, ("canopen = { node_id = 3 }", f"canopen = {{ node_id = 3 }}\nsignal = [{listing}]"))
    ingest = Ingest(config, "can0", {"r.a": config.axes[0].sources})
    assert {key.can_id for key in ingest.decoder.keys} == {0x80, 0x183, 0x283, 0x383}
    samples = fed(ingest, frames)["r.a"]
    assert len(samples) == 20
    assert not any(ingest.axes["r.a"].dropped.values())
    for k, (sample, values) in enumerate(zip(samples, sent, strict=True)):
        assert sample.t_us == 10_400 * k, "the time of the SYNC"
        assert sample.torque == pytest.approx(values["0x6077"] * RATED, rel=1e-15)
        assert sample.motion == pytest.approx(values["0x6064"] * COUNT, rel=1e-15)
        expected = [values[s["signal"]] for s in signals]
        if k:  # the third PDO comes after the sample is complete
            expected[-1] = sent[k - 1]["0x2030.1"]
            assert list(sample.signals) == expected


def test_what_is_sent_by_axiswatch_comes_back(folder: Path) -> None:
    """By simulate and play, which send no SYNC."""
    config = configured(folder)
    encoder, ingest = FrameEncoder(config, "can0"), Ingest(config, "can0")
    frames = [
        Frame(10_000 * k, key.can_id, key.extended, data)
        for k in range(3)
        for key, data in encoder.encode({"r.a": (0.5 * k, -2.0 * k)}, k)
    ]
    samples = fed(ingest, frames)["r.a"]
    assert [s.t_us for s in samples] == [0, 10_000, 20_000]
    assert [s.torque for s in samples] == pytest.approx([0, 0.5, 1.0], abs=RATED)
    assert [s.motion for s in samples] == pytest.approx([0, -2, -4], abs=COUNT)


# --- units ------------------------------------------------------------------------------------------------


def one_sample(folder: Path, *changes: tuple[str, str]) -> Sample:
    """Torque 200, current -100, position 1024 and velocity 300, as the drive sends them."""
    config = configured(folder, *changes)
    data = bytes(2) + (200).to_bytes(2, "little") + (-100).to_bytes(2, "little", signed=True)
    motion = (1024).to_bytes(4, "little") + (300).to_bytes(4, "little")
    frames = [Frame(0, 0x183, False, data), Frame(10, 0x283, False, motion)]
    (sample,) = fed(Ingest(config, "can0"), frames)["r.a"]
    return sample


@pytest.mark.parametrize(
    ("old", "new", "torque", "motion"),
    [
        ("rated", "rated", 0.25, math.pi / 2),
        ("counts_per", "torque_sign = -1, counts_per", -0.25, math.pi / 2),
        ("4096", '4096, side = "arm", motor_turns = 101', 0.25, 101 * math.pi / 2),
        ("4096", '4096, motion = "speed", speed_unit = "counts/s"', 0.25, 300 * COUNT),
        ("counts_per_turn = 4096", 'motion = "speed", speed_unit = "rpm"', 0.25, 10 * math.pi),
        ("rated_torque_Nm = 1.25", "rated_current_A = 2.0", -0.2 * 0.5, math.pi / 2),
    ],
)
def test_values_of_the_data_sheet(folder: Path, old: str, new: str, torque: float, motion: float) -> None:
    changes = [(old, new)]
    if "current" in new:
        changes.append(("node_id = 3 }", "node_id = 3 }\ntorque = { kT_Nm_per_A = 0.5 }"))
    sample = one_sample(folder, *changes)
    assert sample.torque == pytest.approx(torque)
    assert sample.motion == pytest.approx(motion)


def test_a_position_in_counts_has_their_resolution(folder: Path) -> None:
    motion = configured(folder).axes[0].config.motion
    assert (motion.resolution, motion.factor) == (1.0, pytest.approx(COUNT))


def test_an_axis_that_follows_a_drive_of_no_axis(folder: Path) -> None:
    """Where commissioning leaves an axis out, its angle is read where it is: the drive is one of the same file."""
    node = "canopen = { node_id = 3 }\n"
    other = '[[robot.axis]]\nname = "b"\ncanopen = { node_id = 4 }\n'
    text = CONFIG.replace(node, f'{node}signal = [{{ name = "pose", axis = "b" }}]\n{other}')
    (robot,) = tomllib.loads(commissioned(text, {"r.a": Found("nominal.toml", None, ["kT"])}))["robot"]
    ((signal,),) = (axis["signal"] for axis in robot["axis"])
    assert signal == {"name": "pose", "message": "node4", "signal": "0x6064", "factor": pytest.approx(COUNT)}
    listing = ", ".join(f"{key} = {value!r}" for key, value in signal.items())
    config = configured(folder, (node, f"{node}signal = [{{ {listing} }}]\n"))
    ingest = Ingest(config, "can0", {"r.a": config.axes[0].sources})
    assert {key.can_id for key in ingest.decoder.keys} == {0x80, 0x183, 0x283, 0x284}


def test_the_second_axis_of_a_drive(folder: Path) -> None:
    pdos = (Pdo(("68770010", "68640020"), "0x1C5"),)
    (folder / "drive.eds").write_text(eds(pdos), encoding="utf-8")
    axis = configured(folder, ("node_id = 3", "node_id = 3, device = 2")).axes[0].config
    assert (axis.torque.signal, axis.motion.signal) == ("0x6877", "0x6864")


# --- what is refused --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("rated_torque_Nm = 1.25, ", "", r"rated_torque_Nm: missing: object 0x6077 .* read object 0x6076 \(mN m\)"),
        ("1.25", "1.25, rated_current_A = 2", r"a\.toml:9: .*rated_current_A = 2: give the rated torque or"),
        ("rated_torque_Nm = 1.25", "rated_current_A = 2", r"torque\.kT_Nm_per_A: missing: .* no torque without"),
        (", counts_per_turn = 4096", "", r"canopen\.counts_per_turn: missing: .* object 0x608F"),
        ("4096", '4096, side = "arm"', r"canopen\.motor_turns: missing: with side = \"arm\""),
        ("4096", '4096, motion = "speed"', r"canopen\.speed_unit: missing: object 0x606C"),
        ("node_id = 3", "node_id = 128", r"node_id = 128: must be at most 127"),
        ("1.25", '"1.25 Nm"', r"rated_torque_Nm = \"1.25 Nm\": must be a number"),
        ("drive.eds", "none.eds", r"a\.toml:9: .*eds = \"none\.eds\": cannot read .*none\.eds: No such file"),
        ("drive.eds", "a.toml", r"describes no CANopen drive: its name must end with \.eds or \.dcf"),
        ("4096 }", '4096 }\nsignal = [{ name = "t", signal = "0x2032" }]', r"does not send 0x2032: no transmit PDO"),
    ],
)  # fmt: skip
def test_a_wrong_configuration(folder: Path, old: str, new: str, words: str) -> None:
    assert re.search(words, refused(folder, (old, new)))


def test_two_axes_of_one_node(folder: Path) -> None:
    node = "canopen = { node_id = 3 }\n"
    assert "node3.0x6077 is already used by" in refused(folder, (node, f'{node}[[robot.axis]]\nname = "b"\n{node}'))


TORQUE, MOTION = TWO_PDOS[:2]


@pytest.mark.parametrize(
    ("pdos", "words"),
    [
        ((MOTION,), r"does not send 0x6077 \(torque actual value\): no transmit PDO holds it in drive\.eds: map it"),
        (
            (TORQUE._replace(cob_id="0x80000183"), MOTION),
            r"0x6077 .*: TPDO1 holds it, but is disabled \(bit 31 of its COB-ID, object 0x1800\.1\): enable it",
        ),
        ((TORQUE._replace(transmission=253), MOTION), r"on request only \(transmission type 253, object 0x1800\.2\)"),
        ((TORQUE._replace(objects=["60770010", "60640020", "60640020"]),), r"its objects have 80 bits"),
        ((TORQUE,), r"does not send 0x6064 \(position actual value\): .* it sends 0x6041 \(statusword\), 0x6077"),
    ],
)  # fmt: skip
def test_a_drive_that_does_not_send_it(folder: Path, pdos: list[Pdo], words: str) -> None:
    (folder / "drive.eds").write_text(eds(pdos), encoding="utf-8")
    found = refused(folder)
    assert re.search(words, found)
    assert "a.toml:9: robot[1].defaults.canopen.eds" in found


def test_sent_by_events(folder: Path) -> None:
    assert not [words for words in remarks(configured(folder)) if "SYNC" in words]
    pdos = (TORQUE, MOTION._replace(transmission=255))
    (folder / "drive.eds").write_text(eds(pdos), encoding="utf-8")
    (words,) = (words for words in remarks(configured(folder)) if "SYNC" in words)
    assert words.startswith("r.a: node3.TPDO2 is sent by events")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r"there is no section \[DeviceInfo\]"),
        ("junk\n[DeviceInfo]\n", r"no section headers.*line: 1"),
        (eds().replace("DataType=0x0003\n", ""), r"line \d+: No option 'DataType' in section: '6077'"),
        (eds() + "\n[6041]\nParameterName=again\n", r"section '6041' already exists"),
        (eds().replace("DataType=0x0003", "DataType=three"), r"invalid literal"),
        (eds().replace("[1A00]", "[1B00]"), r"a section of the object is missing"),
    ],
)
def test_a_broken_file(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "a.eds"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DescriptionError, match=f"a.eds is no valid EDS or DCF: .*{words}"):
        read_drive(file, 3)


def test_standard_objects_have_a_sign_whatever_the_file_says(tmp_path: Path) -> None:
    """The torque has no entry, the position is said to be unsigned, the velocity is that of a second device."""
    pdos = [Pdo(("60770010", "60640020"), "$NODEID+0x180"), Pdo(("686C0020", "60410010"), "$NODEID+0x280")]
    text = eds(pdos).replace("[6077]", "[2077]")
    position = text.index("[6064]")
    text = text[:position] + text[position:].replace("DataType=0x0004", "DataType=0x0007", 1)
    (tmp_path / "drive.eds").write_text(text, encoding="utf-8")
    signals = [signal for message in read_drive(tmp_path / "drive.eds", 3).messages for signal in message.signals]
    assert {signal.name: signal.is_signed for signal in signals} == {
        **dict.fromkeys(("0x6077", "0x6064", "0x686C"), True),
        "0x6041": False,
    }


def test_the_shipped_file_is_the_one_that_is_tested() -> None:
    assert (ROOT / "config" / "drive.eds").read_text(encoding="utf-8") == eds()


def heard(*ids: int) -> FrameBlock:
    return FrameBlock.from_frames([Frame(1000 * k, can_id, False, bytes(8)) for k, can_id in enumerate(ids)])


def test_the_nodes_of_a_file_on_a_bus(tmp_path: Path) -> None:
    path, frames = tmp_path / "drive.dcf", heard(0x80, 0x183, 0x185, 0x706)
    path.write_text(eds(), encoding="utf-8")
    assert nodes_in(path, frames) == [3, 5]
    path.write_text(eds().replace("$NODEID+0x180", "0x185"), encoding="utf-8")  # the same for every node
    assert nodes_in(path, frames) == [5]
    path.write_text(eds() + settings(3, {}, (1, 1)), encoding="utf-8")  # saved for node 3
    assert nodes_in(path, frames) == [3]
    assert nodes_in(path, heard(0x185)) == []


@pytest.mark.records
def test_a_robot_that_can_be_bought(records_dir: Path, tmp_path: Path) -> None:
    """As configured it sends no torque; as delivered it does, after a SYNC."""
    dcf = records_dir / "can" / "pilz_prbt_0_1.dcf"
    with pytest.raises(DescriptionError, match=r"0x6077 .*TPDO1 holds it as delivered, but not as configured"):
        find_signal(read_drive(dcf, 5), "node5", "0x6077")
    message, _ = find_signal(read_drive(dcf, 5), "node5", "0x6064")
    assert (message.frame_id, message.length) == (0x385, 8)
    text = re.sub(r"^ParameterValue=.*\n", "", dcf.read_text(encoding="utf-8"), flags=re.MULTILINE)
    (tmp_path / "prbt.eds").write_text(text, encoding="utf-8")
    known = read_drive(tmp_path / "prbt.eds", 5)
    message, torque = find_signal(known, "node5", "0x6077")
    _, position = find_signal(known, "node5", "0x6064")
    assert [(s.start, s.length, s.is_signed) for s in (torque, position)] == [(16, 16, True), (32, 32, True)]
    assert (message.frame_id, message.length) == (0x185, 8)
    assert (0x185, False) in known.sync


# --- the time of a SYNC -----------------------------------------------------------------------------------


def test_each_frame_has_the_time_of_its_sync_in_any_blocks(seed: int) -> None:
    """Two messages of 60 cycles, of which some SYNCs and some frames are lost, in blocks of any size."""
    rng, frames, expected = random.Random(seed), list[Frame](), list[int]()
    sync_us, answered = None, set[int]()
    for k in range(60):
        if k > 2 and rng.random() > 0.2:
            sync_us, answered = 1000 * k, set()
            frames.append(Frame(1000 * k, 0x80, False, b""))
            expected.append(-1)
        for n, can_id in enumerate((0x181, 0x281)):
            if rng.random() > 0.2:
                own = 1000 * k + 10 + n
                expected.append(own if sync_us is None or can_id in answered else sync_us)
                answered.add(can_id)
                frames.append(Frame(own, can_id, False, b""))
    block = FrameBlock.from_frames(frames)
    for _ in range(20):
        cycle, at, found = SyncCycle(frames[-1]._replace(can_id=0x80).key), 0, list[int]()
        while at < block.size:
            part = block.select(slice(at, at := at + rng.randrange(1, 12)))
            cycle.take(part)
            times = np.full(part.size, -1)
            for can_id in (0x181, 0x281):
                places = np.flatnonzero(part.ids == can_id)
                if places.size:
                    times[places] = cycle.times_us(frames[0]._replace(can_id=can_id).key, part, places)
            found += times.tolist()
        assert found == expected
