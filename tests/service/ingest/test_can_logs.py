"""CAN logs: read as frames, recorded exactly, and named by line when they are damaged."""

import os
import random
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.can.frames import Frame, FrameBlock
from service.can.log_files import LOG_SUFFIXES, CanLog, FrameRecorder, span_s
from service.can.user_errors import RecordError
from service.config.schema import Config
from service.ingest.bus_samples import Ingest
from service.ingest.records import read_record
from tests.service.ingest.plant import axis1, axis2, fed, make_config
from tests.service.ingest.test_pipeline import both2

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


def test_what_cannot_be_recorded(tmp_path: Path) -> None:
    (tmp_path / "there.log").touch()
    with pytest.raises(RecordError, match=r"there\.log exists already"):
        FrameRecorder(tmp_path / "there.log")
    with pytest.raises(RecordError, match=r"a\.blf: frames are recorded as \.log"):
        FrameRecorder(tmp_path / "a.blf")
    with pytest.raises(RecordError, match=r"cannot write .*No such file or directory"):
        FrameRecorder(tmp_path / "no" / "a.log")


def fill_the_disk(recorder: FrameRecorder) -> None:
    """From now on the disk takes nothing more."""
    full = os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, recorder._file.fileno())
    os.close(full)


def test_a_full_disk(tmp_path: Path) -> None:
    """It is said when frames are written, and again when the file is closed, which it is in any case."""
    recorder, full = FrameRecorder(tmp_path / "a.log"), r"cannot write .*a\.log: No space left on device"
    fill_the_disk(recorder)
    with pytest.raises(RecordError, match=full):
        recorder.write("bus0", FrameBlock.from_frames(traffic(0, 1)))
    recorder._file.write("what a disk took only into its buffer")
    with pytest.raises(RecordError, match=full):
        recorder.close()
    recorder.close()
    assert recorder._file.closed


@pytest.mark.parametrize("suffix", LOG_SUFFIXES)
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


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_error_and_remote_frames_are_counted(tmp_path: Path, suffix: str) -> None:
    with can.Logger(str(tmp_path / f"a{suffix}")) as writer:
        for kind in ({}, {"is_error_frame": True}, {"is_remote_frame": True}, {}):
            writer.on_message_received(
                can.Message(timestamp=START_US / 1e6, arbitration_id=0x10, channel=0, **kind)
            )
    log = CanLog(tmp_path / f"a{suffix}")
    assert len(all_frames(log)) == 2
    assert (log.dropped["error_frame"], log.dropped["remote_frame"]) == (1, 1)


def fault(path: Path) -> str:
    with pytest.raises(RecordError) as caught:
        all_frames(CanLog(path))
    assert str(path) in str(caught.value)
    return str(caught.value).removeprefix(str(path))


@pytest.mark.parametrize(
    "line", ["(1760000000.5) can0", "garbage", "(x) can0 123#00", "(1) can0 12Z#00", "\x00"]
)
def test_a_damaged_line_of_a_candump_log(tmp_path: Path, line: str) -> None:
    write(tmp_path / "a.log", traffic(0, 300))
    with (tmp_path / "a.log").open("a", encoding="utf-8") as file:
        file.write(line + "\n")
    assert (
        fault(tmp_path / "a.log") == f", line 301: not understood: {line!r} (300 frames were read before it)"
    )


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
    assert log.dropped["not_a_frame"] == 1
    assert span_s(path) == seconds
    path.write_text("(1760000000.5", encoding="utf-8")
    assert span_s(path) == 0


@pytest.mark.parametrize("suffix", LOG_SUFFIXES)
@pytest.mark.parametrize("content", [b"", b"\n\n", b"\x80\x81garbage\n" * 100, b"LOGG" + bytes(200)])
def test_a_file_that_is_no_log(tmp_path: Path, suffix: str, content: bytes) -> None:
    (tmp_path / f"a{suffix}").write_bytes(content)
    assert fault(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("kept", [0.001, 0.5, 0.99, None])
def test_a_blf_that_is_cut_off_or_has_a_wrong_byte(tmp_path: Path, kept: float | None, seed: int) -> None:
    path = tmp_path / "a.blf"
    write(path, traffic(seed, 20_000))
    data = bytearray(path.read_bytes())
    if kept is None:
        data[len(data) // 2] ^= 0xFF
    else:
        del data[int(kept * len(data)) :]
    path.write_bytes(data)
    assert "is damaged or no .blf file: " in fault(path)


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


@pytest.mark.parametrize("suffix", LOG_SUFFIXES)
def test_a_log_gives_the_samples_of_the_pipeline(tmp_path: Path, suffix: str) -> None:
    config = make_config(tmp_path, axis2())
    write(tmp_path / f"a{suffix}", plant_frames())
    steps = list(read_record(tmp_path / f"a{suffix}", config).steps())
    live = fed(Ingest(config, "bus0"), plant_frames())["r.two"]
    assert [x for step in steps for x in step.samples["r.two"].u] == [s.torque for s in live]
    assert [x for step in steps for x in step.samples["r.two"].y] == [s.motion for s in live]
    times = [int(t) for step in steps for t in step.samples["r.two"].t_us]
    assert [t - times[0] for t in times] == [s.t_us - live[0].t_us for s in live]
    assert steps[-1].done == 1.0


def two_buses(folder: Path) -> Config:
    config = make_config(folder, axis1(), {**axis2(), "bus": "bus1"})
    second = config.bus[0].model_copy(update={"name": "bus1", "channel": "can1"})
    return config.model_copy(update={"bus": (config.bus[0], second)})


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
    assert record.quality.bus_dropped["a.log"]["other_bus"] == 1
    assert set(record.quality.axis_dropped["r.two"].values()) == {0}


def test_a_log_with_another_name_goes_with_the_only_bus(tmp_path: Path) -> None:
    write(tmp_path / "a.log", plant_frames(), channel="somewhere")
    steps = list(read_record(tmp_path / "a.log", make_config(tmp_path, axis2())).steps())
    assert sum(len(step.samples["r.two"].t_us) for step in steps) == 600


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
