"""Candump logs are read many lines at once, to the frames that python-can reads line by line."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.can import log_files
from service.can.candump import parse_lines
from service.can.frames import Frame
from service.can.log_files import CanLog
from service.can.receivers import frame_of
from service.can.user_errors import RecordError
from service.ingest.records.record_files import is_table

Entry = tuple[str, Frame]

good_stamps = st.integers(0, 4_000_000_000_000_000).map(lambda us: f"({us // 10**6}.{us % 10**6:06d})")
odd_stamps = st.sampled_from(
    ["(1.5)", "(1760000000)", "(0.0)", "(12345678901.000000)", "(-1.000000)", "1.000000", "(1.00000x)"]
)
names = st.sampled_from(["can0", "can0", "vcan1", "3", "a-bus-with-a-long-name", "x"])
good_ids = st.one_of(
    st.integers(0, 0x7FF).map(lambda n: f"{n:03X}"), st.integers(0, 0x1FFFFFFF).map(lambda n: f"{n:08x}")
)
odd_ids = st.sampled_from(["20000044", "200000A0", "FFF", "1234", "12", "", "12G", "80000123", "C0000123"])
good_content = st.one_of(
    st.binary(max_size=8).map(lambda data: "#" + data.hex()),
    st.binary(max_size=64).map(lambda data: "##1" + data.hex()),
)
odd_content = st.sampled_from(
    ["#R", "#R8", "#0", "#012", "##", "##A00", "#" + "00" * 9, "##3" + "11" * 65, "#0g", "", "#11#22", "#."]
)
good_ends = st.sampled_from(["", " R", " T", " t"])
odd_ends = st.sampled_from([" X", "  ", "\r", " R\r", " 1 2"])
good_blanks, odd_blanks = st.sampled_from([" ", "\t"]), st.just("  ")


@st.composite
def lines(draw: st.DrawFn) -> str:
    """A line of candump; often with an odd part, seldom with none that is right."""
    if draw(st.integers(0, 29)) == 0:
        return draw(st.text(max_size=30)).replace("\n", "").replace("\r", "")
    good = (good_stamps, good_blanks, names, good_blanks, good_ids, good_content, good_ends)
    odd = (odd_stamps, odd_blanks, names, odd_blanks, odd_ids, odd_content, odd_ends)
    wrong = draw(st.integers(0, 20))
    return "".join(draw(odd[k] if k == wrong else part) for k, part in enumerate(good))


def one_by_one(text: bytes) -> tuple[list[Entry], list[int], int]:
    """The frames by python-can, the lines from 1 that it does not understand, and how many are error frames."""
    found, wrong, errors = list[Entry](), list[int](), 0
    for number, line in enumerate(text.split(b"\n"), 1):
        try:
            for message in entries(line):
                frame = frame_of(message, stored=True)
                if frame == "error_frame" or is_error(line):
                    errors += 1
                elif isinstance(frame, Frame):
                    found.append((str(message.channel), frame))
        except (ValueError, LookupError, OverflowError):
            wrong.append(number)
    return found, wrong, errors


def is_error(line: bytes) -> bool:
    """python-can takes some error frames for data."""
    name = line.decode("utf-8", "replace").split()[2].partition("#")[0]
    return len(name) > 3 and int(name, 16) & 0x20000000 != 0


def entries(line: bytes) -> Iterator[can.Message]:
    text = line.decode("utf-8", "replace").replace("\t", " ")
    return iter(can.CanutilsLogReader(io.StringIO(text + "\n")))


@settings(max_examples=40)
@given(content=st.lists(lines(), max_size=20), piece=st.integers(1, 300), ended=st.booleans())
def test_all_lines_are_read_as_one_by_one(
    content: list[str], piece: int, ended: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("candump") / "a.log"
    text = ("\n".join(content) + "\n" * ended).encode()
    path.write_bytes(text)
    expected, wrong, errors = one_by_one(text)
    torn = not ended and wrong[-1:] == [len(text.split(b"\n"))]
    log, found, problem = CanLog(path), list[Entry](), ""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(log_files, "PIECE", piece)
        try:
            for block in log.blocks():
                channels = (block.names[channel] for channel in block.channels.tolist())
                found += zip(channels, block.frames.frames(), strict=True)
        except RecordError as error:
            problem = str(error)
    assert found == expected
    assert [int(place.split(":")[0].removeprefix("line ")) for place in log.left_out] == wrong
    assert log.dropped["error_frame"] == errors
    assert log.dropped["unreadable"] == len(wrong)
    if len(wrong) > torn:  # of so few lines each is more than one in a hundred
        assert f", line {wrong[0]}: not understood: " in problem
        assert f"({len(expected)} frames were read)" in problem
    else:
        assert problem.endswith("no CAN frames in it") == (not expected)


def test_lines_as_programs_write_them_need_no_second_look(tmp_path: Path) -> None:
    text = [
        "(1629633295.088890)\tcan0\t0D2#00000000000CD18B",
        "(1629633295.088891) can0 123#",
        "(1629633295.088892) vcan12 18FF0100#0011aaBB T",
        "(0000000005.000001) can0 7FF##1" + "0F" * 64 + " R",
        "(1629633295.088893) can0 20000044#0030000000008081",
    ]
    parsed = parse_lines("\n".join([*text, ""]).encode())
    assert parsed.odd.size == 0
    assert parsed.lines.tolist() == [0, 1, 2, 3]
    assert parsed.errors.tolist() == [4]
    assert parsed.frames.records["flags"].tolist() == [0, 0, 0, 1]
    assert list(parsed.frames.frames()) == [
        Frame(1629633295_088890, 0x0D2, False, bytes.fromhex("00000000000CD18B")),
        Frame(1629633295_088891, 0x123, False, b""),
        Frame(1629633295_088892, 0x18FF0100, True, bytes.fromhex("0011AABB")),
        Frame(5_000001, 0x7FF, False, b"\x0f" * 64),
    ]


SHOWN = """\
 (1436509052.249713)  vcan0  044   [8]  2A 36 6A 9B 00 00 00 01
 (1436509052.449847)  vcan0  RX - -  0F6   [2]  DB F3   '..'
 (2015-07-10 06:17:32.649713)  vcan0  1F334455   [4]  2A 36 6A 9B
 (1436509052.749713)  vcan0  TX B -  123   [0]  remote request
 (1436509052.749713)  vcan0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME
 (1436509052.759713)  vcan0  124  [12]  00 04 00 00 00 00 00 00 01 02 03 04
 (1436509052.769713)  vcan0  125   [0]
 (1436509052.869713)  vcan0  125   [3]  01 02"""
SAVVYCAN = """\
Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8
166064000,0000021A,false,Rx,0,8,FE,36,12,FE,69,05,07,AD,
166064010,1000021A,true,Tx,1,2,FE,36,
166064030,0000021A,false,Rx,0,0,,,,,,,,
166064040,0000021A,false,Rx,0,2,FE"""


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_lines_as_candump_shows_them(tmp_path: Path, ending: str) -> None:
    """Three bytes are said to be in the last one, which has two of them, as where its writer was killed."""
    (tmp_path / "a.log").write_bytes(SHOWN.replace("\n", ending).encode())
    log = CanLog(tmp_path / "a.log")
    (block,) = log.blocks()
    assert [(f.t_us - 1_436_509_052_000_000, f.can_id, f.extended, f.data.hex()) for f in block.frames.frames()] == [
        (249_713, 0x44, False, "2a366a9b00000001"),
        (449_847, 0xF6, False, "dbf3"),
        (649_713, 0x1F334455, True, "2a366a9b"),
        (759_713, 0x124, False, "000400000000000001020304"),
        (769_713, 0x125, False, ""),
    ]
    assert block.names == ("vcan0",)
    assert (log.dropped["error_frame"], log.dropped["remote_frame"], log.dropped["unreadable"]) == (1, 1, 1)
    assert log.left_out[0].startswith("line 8: not understood: '(1436509052.869713)  vcan0  125")


def test_a_table_of_savvycan_is_a_log(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(SAVVYCAN, encoding="utf-8")
    assert not is_table(path)
    log = CanLog(path)
    (block,) = log.blocks()
    assert list(block.frames.frames()) == [
        Frame(166_064_000, 0x21A, False, bytes.fromhex("FE3612FE690507AD")),
        Frame(166_064_010, 0x1000021A, True, b"\xfe6"),
        Frame(166_064_030, 0x21A, False, b""),
    ]
    assert [block.names[channel] for channel in block.channels] == ["0", "1", "0"]
    assert log.left_out == ["line 5: not understood: '166064040,0000021A,false,Rx,0,2,FE'"]
    path.write_text("t,torque\n0,1\n", encoding="utf-8")
    assert is_table(path)
