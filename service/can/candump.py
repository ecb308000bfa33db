"""Parses lines of candump logs to frames, all lines of a piece of the file at once.

A line is ``(1760000000.123456) can0 123#0011``, with ``##`` and a digit for CAN FD.  `` R`` or `` T`` may follow, and
the parts may be separated by tabs.  Lines of any other form are odd and left to the caller.
"""

import re
from base64 import b64decode
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Ints
from service.can.frames import CLASSIC_BYTES, EXTENDED, FD_BYTES, ID_BITS, FrameBlock

ERROR = 0x20000000
"""Flag in the id of an error frame"""
_NAME = 16
_DIGITS = 10
"""Most digits of the whole seconds"""
_NO_DIGIT = 255
_HEX = np.full(256, _NO_DIGIT, np.uint8)
_HEX[np.frombuffer(b"0123456789", np.uint8)] = np.arange(10)
_HEX[np.frombuffer(b"abcdef", np.uint8)] = _HEX[np.frombuffer(b"ABCDEF", np.uint8)] = np.arange(10, 16)
_DIRECTIONS = np.frombuffer(b"RTrt", np.uint8)

CSV_HEAD = b"timestamp,arbitration_id,extended,remote,error,dlc,data"
SAVVYCAN_HEAD = b"Time Stamp,ID,Extended,"
"""First lines of the .csv logs that python-can and SavvyCAN write"""
_SHOWN = re.compile(
    rb"^ *\((\d[\d :.-]*)\) +(\S+) +(?:[RT]X +[-A-Z] [-A-Z] +)?([0-9A-F]{3}|[0-9A-F]{8}) +\[(\d+)\]"
    rb" *(?:(remote request)|((?:[0-9A-F]{2} ?)*)) *(?:'.*'|ERRORFRAME)?\r?$",
    re.MULTILINE,
)
_CSV = re.compile(rb"^(\d+\.?\d*),0x([\da-f]+),([01]),([01]),([01]),(\d+),([\w+/=]*)\r?$", re.MULTILINE)
_SAVVYCAN = re.compile(
    rb"^(\d+),([\dA-F]{8}),(true|false),(?:[RT]x,)?(\d+),(\d+),((?:[\dA-F]{2},?)*),*\r?$",
    re.MULTILINE | re.IGNORECASE,
)
TextBytes = NDArray[np.uint8]


class Parsed(NamedTuple):
    """The frames in some lines, in the order of the lines."""

    frames: FrameBlock
    lines: Ints
    """Line of each frame (N,)"""
    channels: Ints
    """Index of the bus name of each frame (N,)"""
    names: tuple[str, ...]
    errors: Ints
    """Lines that are error frames (E,)"""
    odd: Ints
    """Lines of any other form (M,)"""


class _Marks(NamedTuple):
    """Positions of the parts of lines in a text; each (N,)."""

    start: Ints
    stamp_end: Ints
    name_end: Ints
    id_end: Ints
    data: Ints
    end: Ints


def rewritten(text: bytes, head: bytes) -> bytes:
    """Rewrite lines to the form of a candump log; ``head``: first line of the file.  Unknown lines stay as they are.

    Handled are the form that candump displays, ``(1760000000.123456)  can0  123   [2]  00 11``, and the tables of
    python-can and SavvyCAN with a frame in each row.
    """
    for start, (form, line_of) in _FORMS.items():
        if head.startswith(start):
            return form.sub(line_of, text)
    return _SHOWN.sub(_of_shown, text) if b"[" in text else text


def _line(time_s: float, channel: bytes, frame_id: bytes, data: bytes, fd: bool = False) -> bytes:
    return b"(%.6f) %b %b#%b%b" % (time_s, channel, frame_id, b"#0" if fd or len(data) > 16 else b"", data)


def _of_shown(line: re.Match[bytes]) -> bytes:
    stamp, channel, frame_id, length, remote, shown = line.groups()
    data = b"R" if remote else shown.replace(b" ", b"")
    if not remote and len(data) != 2 * int(length):
        return line[0]
    try:
        time_s = float(stamp) if b" " not in stamp else datetime.fromisoformat(f"{stamp.decode()}+00:00").timestamp()
    except ValueError:
        return line[0]
    return _line(time_s, channel, frame_id, data, len(length) > 1)


def _of_csv(line: re.Match[bytes]) -> bytes:
    stamp, number, extended, remote, error, length, coded = line.groups()
    try:
        frame_id, data = int(number, 16), b64decode(coded, validate=True).hex().encode()
    except ValueError:
        return line[0]
    if remote == b"0" and len(data) != 2 * int(length):
        return line[0]
    is_long, marks = extended == b"1" or error == b"1", ERROR if error == b"1" else 0
    return _line(
        float(stamp),
        b"0",
        b"%0*X" % (8 if is_long else 3, frame_id | marks),
        b"R" if remote == b"1" else data,
    )


def _of_savvycan(line: re.Match[bytes]) -> bytes:
    stamp, frame_id, extended, channel, length, shown = line.groups()
    data = shown.replace(b",", b"")
    if len(data) != 2 * int(length):
        return line[0]
    return _line(int(stamp) / 1e6, channel, frame_id if extended.lower() == b"true" else frame_id[-3:], data)


_FORMS: Mapping[bytes, tuple[re.Pattern[bytes], Callable[[re.Match[bytes]], bytes]]] = {
    CSV_HEAD: (_CSV, _of_csv),
    SAVVYCAN_HEAD: (_SAVVYCAN, _of_savvycan),
}


def parse_lines(text: bytes) -> Parsed:
    """The frames in complete lines, each with its line break."""
    letters = np.frombuffer(text, np.uint8)
    letters = np.where(letters == ord("\t"), np.uint8(ord(" ")), letters)
    ends = np.flatnonzero(letters == ord("\n"))
    starts = np.concatenate(([0], ends[:-1] + 1))
    lines, marks = _marked(letters, starts, ends)
    t_us, timed = _times(letters, marks)
    ids, known = _ids(letters, marks)
    length = marks.end - marks.data
    wide = letters[marks.data - 2] == ord("#")
    sound = timed & known & (length % 2 == 0) & (length >= 0)
    sound &= length <= np.where(wide, 2 * FD_BYTES, 2 * CLASSIC_BYTES)
    width = FD_BYTES if (length[sound] > 2 * CLASSIC_BYTES).any() else CLASSIC_BYTES
    data, paired = _bytes(letters, marks.data, np.minimum(length, 2 * width), width)
    name, named = _names(letters, marks)
    sound &= paired & named
    errors = sound & (ids & ERROR != 0) & (marks.id_end - marks.name_end > 4)
    good = sound & ~errors
    ids = np.where(marks.id_end - marks.name_end > 4, ids & ID_BITS | EXTENDED, ids)
    flags = np.where(wide, _HEX[letters[marks.data - 1]], 0)
    frames = FrameBlock.from_columns(t_us[good], ids[good], length[good] // 2, data[good], flags[good])
    odd = np.ones(len(ends), np.bool_)
    odd[lines[sound]] = False
    names, channels = _numbered(name[good])
    return Parsed(frames, lines[good], channels, names, lines[errors], np.flatnonzero(odd))


def _marked(letters: TextBytes, starts: Ints, ends: Ints) -> tuple[Ints, _Marks]:
    """The lines with the right number of spaces and "#", and the positions of their parts."""
    blanks, hashes = np.flatnonzero(letters == ord(" ")), np.flatnonzero(letters == ord("#"))
    blank, mark = np.searchsorted(blanks, starts), np.searchsorted(hashes, starts)
    ends = ends - (letters[ends - 1] == ord("\r"))
    of_blanks, of_hashes = np.diff(blank, append=len(blanks)), np.diff(mark, append=len(hashes))
    lines = np.flatnonzero(((of_blanks == 2) | (of_blanks == 3)) & ((of_hashes == 1) | (of_hashes == 2)))
    start, end, blank, mark = starts[lines], ends[lines], blank[lines], mark[lines]
    with_direction, wide = of_blanks[lines] == 3, of_hashes[lines] == 2
    stamp_end, name_end, id_end = blanks[blank], blanks[blank + 1], hashes[mark]
    direction = blanks[np.where(with_direction, blank + 2, blank)]
    good = np.where(with_direction, (direction == end - 2) & np.isin(letters[end - 1], _DIRECTIONS), True)
    end = np.where(with_direction, direction, end)
    good &= np.where(wide, hashes[np.where(wide, mark + 1, mark)] == id_end + 1, True)
    data = id_end + np.where(wide, 3, 1)
    good &= np.where(wide, _HEX[letters[np.minimum(id_end + 2, len(letters) - 1)]] < 10, True)
    good &= (letters[start] == ord("(")) & (stamp_end >= start + 10) & (id_end > name_end) & (end >= data)
    return lines[good], _Marks(*(part[good] for part in (start, stamp_end, name_end, id_end, data, end)))


def _times(letters: TextBytes, marks: _Marks) -> tuple[Ints, Bools]:
    """Times (N,) [us], and a mask of the lines whose time is in seconds with six decimals."""
    t_us = np.zeros(len(marks.start), np.int64)
    good = (letters[marks.stamp_end - 1] == ord(")")) & (letters[marks.stamp_end - 8] == ord("."))
    good &= marks.stamp_end - 9 - marks.start <= _DIGITS
    # From the last digit on; place by place is faster than all digits of all lines.
    for place in range(6 + _DIGITS):
        at = marks.stamp_end - 2 - place - (place >= 6)
        digit = np.where(at > marks.start, _HEX[letters[np.maximum(at, 0)]], np.uint8(0))
        good &= digit < 10
        t_us += digit.astype(np.int64) * 10**place
    return t_us, good


def _ids(letters: TextBytes, marks: _Marks) -> tuple[Ints, Bools]:
    """Ids (N,), and a mask of those with three or eight hexadecimal digits."""
    ids, length = np.zeros(len(marks.start), np.int64), marks.id_end - marks.name_end - 1
    good = (length == 3) | (length == 8)
    for place in range(8):
        digit = np.where(place < length, _HEX[letters[marks.id_end - 1 - place]], np.uint8(0))
        good &= digit < 16
        ids += digit.astype(np.int64) << 4 * place
    return ids, good


def _bytes(letters: TextBytes, start: Ints, length: Ints, width: int) -> tuple[TextBytes, Bools]:
    """Data (N, width), zero beyond its length, and a mask of the lines with only hexadecimal digits in it."""
    places = np.arange(2 * width)
    at = np.minimum(start[:, np.newaxis] + places, len(letters) - 1)
    digits = np.where(places < length[:, np.newaxis], _HEX[letters[at]], 0).astype(np.uint8)
    good = np.asarray((digits < 16).all(axis=1), np.bool_)
    return (digits[:, ::2] << 4 | digits[:, 1::2]).astype(np.uint8), good


def _names(letters: TextBytes, marks: _Marks) -> tuple[NDArray[np.bytes_], Bools]:
    """Names of the buses (N,), and a mask of those that are neither empty nor too long."""
    length, places = marks.name_end - marks.stamp_end - 1, np.arange(_NAME)
    at = np.minimum(marks.stamp_end[:, np.newaxis] + 1 + places, len(letters) - 1)
    name = np.where(places < length[:, np.newaxis], letters[at], np.uint8(0))
    return np.ascontiguousarray(name).view(f"S{_NAME}")[:, 0], (length > 0) & (length <= _NAME)


def _numbered(name: NDArray[np.bytes_]) -> tuple[tuple[str, ...], Ints]:
    """The distinct names, and the index of each line's name (N,)."""
    if len(name) and (name == name[0]).all():
        return (_as_text(name[0]),), np.zeros(len(name), np.int64)
    names, channels = np.unique(name, return_inverse=True)
    return tuple(map(_as_text, names)), channels.astype(np.int64)


def _as_text(name: bytes) -> str:
    text = name.decode("utf-8", "replace")
    return str(int(text)) if text.isdigit() else text  # python-can uses numbers there
