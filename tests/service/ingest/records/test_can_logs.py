"""CAN logs: read as frames, recorded exactly, and named by line when they are damaged."""

import gzip
import os
import random
from pathlib import Path

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.can.frame_recorder import FrameRecorder, span_s, write_blf
from service.can.frames import Frame, FrameBlock
from service.can.log_files import LOG_SUFFIXES, CanLog
from service.can.user_errors import RecordError
from service.config.schema import Config
from service.ingest.records.loaded_records import load
from service.ingest.records.record_files import read_record
from tests.service.can.full_disk import fill_the_disk
from tests.service.ingest.plant import angle1, axis1, axis2, both2, make_config, torque1
from tests.shares import soaked

SUFFIXES = [suffix for suffix in LOG_SUFFIXES if suffix != ".mf4"]  # that has a test of its own
START_US = 1_760_000_000_123_456

frames = st.builds(
    Frame,
    t_us=st.integers(1_000_000, 4_000_000_000_000_000),
    can_id=st.integers(0, 0x7FF),
    extended=st.booleans(),
    data=st.one_of(st.binary(max_size=8), st.sampled_from([12, 20, 64]).map(bytes)),
)


def all_frames(log: CanLog) -> list[tuple[str, Frame]]:
    return [
        (block.names[channel], frame)
        for block in log.blocks()
        for channel, frame in zip(block.channels.tolist(), block.frames.frames(), strict=True)
    ]


def traffic(seed: int, count: int) -> list[Frame]:
    rng, t_us = random.Random(seed), START_US
    result = []
    for _ in range(count):
        t_us += rng.randrange(1, 5000)
        extended = rng.random() < 0.5
        can_id = rng.randrange(0x20000000 if extended else 0x800)
        result.append(Frame(t_us, can_id, extended, rng.randbytes(rng.randrange(9))))
    return result


def write(path: Path, sent: list[Frame], channel: str | int = "can0") -> None:
    with can.Logger(str(path)) as writer:
        for frame in sent:
            writer.on_message_received(message(frame, channel))


def message(frame: Frame, channel: str | int = "can0") -> can.Message:
    return can.Message(
        timestamp=frame.t_us / 1e6,
        arbitration_id=frame.can_id,
        is_extended_id=frame.extended,
        data=frame.data,
        channel=channel,
        is_rx=False,
    )


@settings(max_examples=40)
@given(st.lists(frames, min_size=1, max_size=20))
def test_what_is_recorded_is_read_again_to_the_microsecond(
    tmp_path_factory: pytest.TempPathFactory, sent: list[Frame]
) -> None:
    path = tmp_path_factory.mktemp("recorder") / "a.log"
    with FrameRecorder(path) as recorder:
        recorder.write("left", FrameBlock.from_frames(sent[:7]))
        recorder.write("right", FrameBlock.from_frames(sent[7:]))
    assert all_frames(CanLog(path)) == [("left" if i < 7 else "right", f) for i, f in enumerate(sent)]


def test_recorded_frames_are_in_the_file_at_once(tmp_path: Path) -> None:
    sent = traffic(0, 3)
    with FrameRecorder(tmp_path / "a.log") as recorder:
        recorder.write("bus0", FrameBlock.from_frames(sent))
        assert [frame for _, frame in all_frames(CanLog(tmp_path / "a.log"))] == sent


def test_a_blf_keeps_each_frame_to_the_microsecond(tmp_path: Path, seed: int) -> None:
    """Of two buses, the second one with earlier frames; by its reader, times are as in a candump log."""
    rng, path = random.Random(seed), tmp_path / "a.blf"
    lengths = [*range(9), 12, 16, 20, 24, 32, 48, 64]
    first, second = (
        FrameBlock.from_frames(
            [
                Frame(begin_us + rng.randrange(10**9), rng.randrange(0x800), False, rng.randbytes(length))
                for length in lengths * 20
            ]
            + [Frame(begin_us, rng.randrange(1 << 29), True, b"")]
        )
        for begin_us in (START_US + 999, START_US - 7_200_000_001)
    )
    write_blf(path, [("right", first), ("left", second)], {"left": 0, "right": 4})
    found = {"0": list[Frame](), "4": list[Frame]()}
    for block in CanLog(path).blocks():
        for frame, channel in zip(block.frames.frames(), block.channels, strict=True):
            found[block.names[channel]].append(frame)
    assert found == {"0": list(second.frames()), "4": list(first.frames())}
    with pytest.raises(RecordError, match=r"cannot write .*a\.blf: No such file"):
        write_blf(tmp_path / "gone" / "a.blf", [("left", first)], {"left": 0})


def test_a_folder_that_is_missing_and_a_full_disk(tmp_path: Path) -> None:
    """It is said when frames are written, and again when the file is closed, which it is in any case."""
    with pytest.raises(RecordError, match=r"cannot write .*No such file or directory"):
        FrameRecorder(tmp_path / "no" / "a.log")
    recorder, full = FrameRecorder(tmp_path / "a.log"), r"cannot write .*a\.log: No space left on device"
    descriptor = fill_the_disk(tmp_path / "a.log")
    with pytest.raises(RecordError, match=full):
        recorder.write("bus0", FrameBlock.from_frames(traffic(0, 1)))
    with pytest.raises(RecordError, match=full):  # the frames are still in its buffer
        recorder.close()
    recorder.close()
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(descriptor)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_logs_of_python_can(tmp_path: Path, suffix: str, seed: int) -> None:
    sent = traffic(seed, 1000)
    write(tmp_path / f"a{suffix}", sent)
    log = CanLog(tmp_path / f"a{suffix}")
    blocks = list(log.blocks())
    read = [frame for block in blocks for frame in block.frames.frames()]
    # The .asc writer rounds the start of the log to milliseconds; intervals stay.
    shift = read[0].t_us - sent[0].t_us
    assert abs(shift) < (1000 if suffix == ".asc" else 1)
    assert [frame._replace(t_us=frame.t_us - shift) for frame in read] == sent
    assert blocks[-1].done == 1.0
    assert log.frames == 1000
    assert sum(log.dropped.values()) == (suffix == ".asc")  # its line "Start of measurement"


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".csv"])
def test_error_and_remote_frames_are_counted(tmp_path: Path, suffix: str) -> None:
    with can.Logger(str(tmp_path / f"a{suffix}")) as writer:
        for kind in ({}, {"is_error_frame": True}, {"is_remote_frame": True}, {}):
            writer.on_message_received(can.Message(timestamp=START_US / 1e6, arbitration_id=0x10, channel=0, **kind))
    log = CanLog(tmp_path / f"a{suffix}")
    assert len(all_frames(log)) == 2
    assert (log.dropped["error_frame"], log.dropped["remote_frame"]) == (1, 1)


def fault(path: Path) -> str:
    with pytest.raises(RecordError) as caught:
        all_frames(CanLog(path))
    assert str(path) in str(caught.value)
    return str(caught.value).removeprefix(str(path))


def test_a_torn_last_line_is_left_out(tmp_path: Path) -> None:
    """Its writer was killed, or the disk was full."""
    path, sent = tmp_path / "a.log", traffic(0, 300)
    write(path, sent)
    seconds = span_s(path)
    assert seconds == pytest.approx((sent[-1].t_us - sent[0].t_us) * 1e-6, abs=1e-6)
    with path.open("a", encoding="utf-8") as file:
        file.write("(1760000099.12")
    log = CanLog(path)
    assert [frame for _, frame in all_frames(log)] == sent
    assert log.left_out == ["line 301: not understood: '(1760000099.12'"]
    assert log.dropped["unreadable"] == 1
    assert span_s(path) == seconds
    path.write_text("(1760000000.5", encoding="utf-8")
    assert span_s(path) == 0


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("content", [b"", b"\n\n", b"\x80\x81garbage\n" * 100, b"LOGG" + bytes(200)])
def test_a_file_that_is_no_log(tmp_path: Path, suffix: str, content: bytes) -> None:
    (tmp_path / f"a{suffix}").write_bytes(content)
    assert fault(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", [".log", ".asc", ".trc"])
def test_damaged_lines_are_left_out_up_to_a_share(tmp_path: Path, suffix: str, seed: int) -> None:
    """All other frames are given, at their times; what the head says holds behind the damage, too."""
    path, sent = tmp_path / f"a{suffix}", traffic(seed, 1000)
    write(path, sent)
    expected = [frame for _, frame in all_frames(CanLog(path))]
    lines = path.read_bytes().splitlines()
    first = len(lines) - 1001 if lines[-1].startswith(b"End") else len(lines) - 1000
    for k in range(100, 1000, 100):
        lines[first + k] = lines[first + k].rstrip()[:-1] + b"Z"
    path.write_bytes(b"\n".join([*lines, b""]))
    log = CanLog(path)
    assert [f for _, f in all_frames(log)] == [f for k, f in enumerate(expected) if k % 100 or not k]
    assert log.dropped["unreadable"] == 9
    numbers = [int(place.split(":")[0].removeprefix("line ")) for place in log.left_out]
    assert numbers == [first + k + 1 for k in range(100, 1000, 100)]


@pytest.mark.parametrize("suffix", [".log", ".asc", ".trc"])
def test_a_log_with_more_damaged_lines_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    write(path, traffic(0, 1000))
    damaged = {
        ".log": b"(1) can0 12Z#00",
        ".asc": b" 1.5 1 12Z Rx d 1 00",
        ".trc": b"1 1.5 DT 1 12Z Rx - 1 00",
    }
    lines = path.read_bytes().splitlines()
    path.write_bytes(b"\n".join([*lines[:500], *[damaged[suffix]] * 11, *lines[500:], b""]))
    log, read, problem = CanLog(path), 0, ""
    try:
        for block in log.blocks():
            read += block.frames.size
    except RecordError as error:
        problem = str(error)
    assert problem.startswith(f"{path}, line 501: ")
    assert ", and 10 further lines: more than 1 in 100 lines cannot be read (1000 frames were read)" in problem
    assert read == log.frames == 1000
    assert log.dropped["unreadable"] == 11


@pytest.mark.parametrize(
    ("kind", "name"),
    [(".asc", "a.log"), (".log", "a.blf"), (".blf", "a.asc"), (".log", "a.trc"), (".trc", "a.log.gz")],
)
def test_a_log_with_the_name_of_another_kind(
    tmp_path: Path, kind: str, name: str, caplog: pytest.LogCaptureFixture
) -> None:
    with can.Logger(str(tmp_path / f"right{kind}")) as writer:
        for k in range(20):
            writer(can.Message(timestamp=1.76e9 + k, arbitration_id=0x123, is_extended_id=False, data=b"ab"))
    (tmp_path / f"right{kind}").rename(tmp_path / name)
    assert fault(tmp_path / name).endswith(f"; its content is that of a {kind} file: let its name end so")
    assert not caplog.records


def test_a_compressed_log_without_its_ending(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_bytes(gzip.compress(b"(1760000000.000000) can0 123#00\n"))
    assert fault(tmp_path / "a.log").endswith("; its content is compressed: let its name end with .log.gz")


def test_a_line_without_all_its_bytes_is_no_frame(tmp_path: Path) -> None:
    write(tmp_path / "a.asc", [Frame(START_US, 0x123, False, bytes(8))])
    text = (tmp_path / "a.asc").read_text(encoding="utf-8")
    torn = text[: text.index(" 00 00 00 00 00 00 00") + 9]
    (tmp_path / "a.asc").write_text(torn, encoding="utf-8")
    assert fault(tmp_path / "a.asc") == ": no CAN frames in it"


def test_zeros_as_after_a_power_failure_are_one_torn_line(tmp_path: Path) -> None:
    path, sent = tmp_path / "a.log", traffic(0, 1000)
    write(path, sent)
    path.write_bytes(path.read_bytes() + bytes(1_000_000))
    log = CanLog(path)
    assert [frame for _, frame in all_frames(log)] == sent
    assert {place.split(":")[0] for place in log.left_out} == {"line 1001"}


@pytest.mark.parametrize("kept", soaked([0.3, 0.5, 0.99], 0.5))
def test_a_blf_that_is_cut_off_gives_its_complete_containers(tmp_path: Path, kept: float, seed: int) -> None:
    path, sent = tmp_path / "a.blf", traffic(seed, 20_000)
    write(path, sent)
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    log = CanLog(path)
    read = [frame for _, frame in all_frames(log)]
    assert [frame._replace(t_us=0) for frame in read] == [frame._replace(t_us=0) for frame in sent[: len(read)]]
    containers = [k for k in range(int(kept * len(data))) if data[k : k + 16].startswith(b"LOBJ")]
    assert len(read) > 2000 * (len(containers) - 1)
    (place,) = log.left_out
    assert place == f"cut off after byte {int(place.split()[4])} of {len(data)}"
    assert int(place.split()[4]) <= kept * len(data)
    assert log.dropped["unreadable"] == 1


def test_a_blf_whose_writer_was_killed_does_not_know_its_size(tmp_path: Path) -> None:
    path = tmp_path / "a.blf"
    write(path, traffic(0, 20_000))
    data = bytearray(path.read_bytes())
    data[16:24] = (144).to_bytes(8, "little")  # as at the start
    path.write_bytes(data[: len(data) // 2])
    log = CanLog(path)
    assert 5000 < len(all_frames(log)) < 10_000
    (place,) = log.left_out
    assert 144 < int(place.removeprefix("cut off after byte ")) < len(data) // 2


def test_a_blf_of_which_hardly_anything_is_left_or_with_a_wrong_byte(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "a.blf"
    write(path, traffic(seed, 20_000))
    data = bytearray(path.read_bytes())
    path.write_bytes(data[:300])
    assert fault(path) == ": no CAN frames in it"
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    assert "is damaged or no .blf file: " in fault(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_compressed_log_gives_the_same_frames(tmp_path: Path, suffix: str, seed: int) -> None:
    path = tmp_path / f"a{suffix}"
    write(path, traffic(seed, 3000))
    (tmp_path / f"B{suffix.upper()}.GZ").write_bytes(gzip.compress(path.read_bytes()))
    plain, packed = CanLog(path), CanLog(tmp_path / f"B{suffix.upper()}.GZ")
    blocks = list(packed.blocks())
    assert [f for b in blocks for f in b.frames.frames()] == [f for _, f in all_frames(plain)]
    assert packed.dropped == plain.dropped
    assert 0 < blocks[0].done <= blocks[-1].done == 1.0


def test_compressed_logs_behind_each_other_are_one(tmp_path: Path) -> None:
    write(tmp_path / "a.log", traffic(0, 100))
    text = (tmp_path / "a.log").read_bytes()
    packed = gzip.compress(text[:1000]) + gzip.compress(text[1000:]) + bytes(100)
    (tmp_path / "a.log.gz").write_bytes(packed)
    log = CanLog(tmp_path / "a.log.gz")
    assert [frame for _, frame in all_frames(log)] == traffic(0, 100)
    assert log.left_out == []


@pytest.mark.parametrize("suffix", soaked(SUFFIXES, ".log", ".blf"))
def test_compressed_data_whose_writer_was_killed(tmp_path: Path, suffix: str, seed: int) -> None:
    path = tmp_path / f"a{suffix}"
    write(path, traffic(seed, 20_000))
    expected = [frame for _, frame in all_frames(CanLog(path))]
    packed = gzip.compress(path.read_bytes())[:-20_000]
    (tmp_path / f"a{suffix}.gz").write_bytes(packed)
    log = CanLog(tmp_path / f"a{suffix}.gz")
    read = [frame for _, frame in all_frames(log)]
    assert 0.5 * len(expected) < len(read) < len(expected)
    assert read == expected[: len(read)]
    assert log.left_out[-1] == f"the compressed data ends too early, at byte {len(packed)}"
    assert log.dropped["unreadable"] == len(log.left_out) <= 2


def test_damaged_compressed_data(tmp_path: Path) -> None:
    write(tmp_path / "a.log", traffic(0, 3000))
    packed = bytearray(gzip.compress((tmp_path / "a.log").read_bytes()))
    packed[-6] ^= 1  # of the check sum
    (tmp_path / "a.log.gz").write_bytes(packed)
    assert " is damaged: damaged before byte " in fault(tmp_path / "a.log.gz")
    (tmp_path / "b.log.gz").write_bytes((tmp_path / "a.log").read_bytes())
    assert "or no gzip" in fault(tmp_path / "b.log.gz")


def test_lines_that_are_no_frames_are_counted(tmp_path: Path) -> None:
    write(tmp_path / "a.asc", traffic(0, 10))
    text = (tmp_path / "a.asc").read_text(encoding="utf-8")
    (tmp_path / "a.asc").write_text(text + "   5.000 nonsense\n", encoding="utf-8")
    log = CanLog(tmp_path / "a.asc")
    assert len(all_frames(log)) == 10
    assert log.dropped["not_a_frame"] == 2  # the other one is "Start of measurement"


# --- as records ---------------------------------------------------------------------------------------


def plant_frames() -> list[Frame]:
    return [both2(START_US + 5000 * k, k % 50 / 2, -k / 16) for k in range(600)]


def two_buses(folder: Path) -> Config:
    config = make_config(folder, {**axis1(), "bus": "bus0"}, {**axis2(), "bus": "bus1"})
    first = config.bus[0].model_copy(update={"channel": "can0"})
    second = config.bus[0].model_copy(update={"name": "bus1", "channel": "can1"})
    return config.model_copy(update={"bus": (first, second)})


def test_buses_are_told_apart_by_their_names(tmp_path: Path) -> None:
    with FrameRecorder(tmp_path / "a.log") as recorder:
        recorder.write("bus0", FrameBlock.from_frames(plant_frames()[:10]))  # wanted on the other bus
        recorder.write("bus1", FrameBlock.from_frames(plant_frames()[10:30]))
        recorder.write("can1", FrameBlock.from_frames(plant_frames()[30:40]))
        recorder.write("can2", FrameBlock.from_frames(plant_frames()[40:41]))
    record = read_record(tmp_path / "a.log", two_buses(tmp_path))
    (step,) = record.steps()
    assert len(step.samples["r.two"].t_us) == 30
    assert record.quality.bus_dropped["bus0"]["unwanted"] == 10
    assert record.quality.bus_dropped["a.log, channel can2"] == {"other_bus": 1}
    assert set(record.quality.axis_dropped["r.two"].values()) == {0}


@pytest.mark.parametrize("suffix", [s for s in SUFFIXES if s != ".csv"])  # it knows no channels
def test_a_log_of_two_channels_serves_two_buses(tmp_path: Path, suffix: str) -> None:
    """Most formats have numbers only; a third channel is counted by its name."""
    with can.Logger(str(tmp_path / f"a{suffix}")) as writer:
        for k in range(300):
            writer.on_message_received(message(torque1(START_US + 5000 * k, 1.0, k), "can0"))
            writer.on_message_received(message(angle1(START_US + 5000 * k, k / 64, k), "can0"))
            writer.on_message_received(message(both2(START_US + 5000 * k, k % 50 / 2, -k / 16), "can1"))
            if k % 3 == 0:
                writer.on_message_received(message(Frame(START_US + 5000 * k, 0x7, False, b""), "can2"))
    record = read_record(tmp_path / f"a{suffix}", two_buses(tmp_path))
    samples = [step.samples for step in record.steps()]
    assert sum(step["r.one"].size for step in samples if "r.one" in step) == 300
    assert sum(step["r.two"].size for step in samples if "r.two" in step) == 300
    third = "can2" if suffix == ".log" else "2"
    others = {name: dict(n) for name, n in record.quality.bus_dropped.items() if "channel" in name}
    assert others == {f"a{suffix}, channel {third}": {"other_bus": 100}}


def test_a_log_with_another_name_goes_with_the_only_bus(tmp_path: Path) -> None:
    write(tmp_path / "a.log", plant_frames(), channel="somewhere")
    steps = list(read_record(tmp_path / "a.log", make_config(tmp_path, axis2())).steps())
    assert sum(len(step.samples["r.two"].t_us) for step in steps) == 600


@pytest.mark.parametrize("both", [False, True])
def test_a_log_whose_channels_are_no_bus_is_refused(tmp_path: Path, both: bool) -> None:
    """With two channels nobody knows which is that of the only bus, with one channel which of two buses it is."""
    with FrameRecorder(tmp_path / "a.log") as recorder:
        recorder.write("left", FrameBlock.from_frames(plant_frames()[:10]))
        recorder.write("right", FrameBlock.from_frames(plant_frames()[10:] if not both else []))
    config = two_buses(tmp_path) if both else make_config(tmp_path, axis2())
    found = "left (10 frames)" if both else "left (10 frames), right (590 frames)"
    with pytest.raises(RecordError) as caught:
        list(read_record(tmp_path / "a.log", config).steps())
    assert f"a.log: none of its channels is a bus of the configuration: it has {found}" in str(caught.value)
    assert 'name = "bus0"' in str(caught.value)
    assert 'channel = "left"' in str(caught.value)


def test_what_is_left_out_of_a_log_is_in_its_origin(tmp_path: Path) -> None:
    write(tmp_path / "a.log", plant_frames())
    with (tmp_path / "a.log").open("a", encoding="utf-8") as file:
        file.write("garbage")
    config = make_config(tmp_path, axis2())
    source = load(str(tmp_path / "a.log"), config, "r.two").source
    assert source.words.endswith("dropped: 1 unreadable (line 601: not understood: 'garbage')")


def test_values_that_wait_at_the_end_are_counted(tmp_path: Path) -> None:
    write(tmp_path / "a.log", [Frame(START_US, 0x100, False, bytes(4))])
    record = read_record(tmp_path / "a.log", make_config(tmp_path, axis1()))
    assert [step.samples for step in record.steps()] == [{}]
    assert record.quality.axis_dropped["r.one"]["unpaired"] == 1


@pytest.mark.records
def test_the_log_of_a_real_bus(records_dir: Path) -> None:
    log = CanLog(records_dir / "can" / "inverter_idle.log")
    read = all_frames(log)
    assert len(read) == 52_585
    assert read[0] == ("can0", Frame(1629633295_088890, 0x0D2, False, bytes.fromhex("00000000000CD18B")))
    assert read[-1][1].t_us - read[0][1].t_us == pytest.approx(30.2e6, abs=1e5)
    assert set(log.dropped.values()) == {0}
