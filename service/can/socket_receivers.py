"""Receivers for buses with a socket: one system call receives many messages into preallocated memory."""

import ctypes
import errno
import os
import select
import socket
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache, partial
from threading import Event
from typing import Any

import can
import msgpack
import numpy as np
from can.interfaces.socketcan import SocketcanBus
from can.interfaces.udp_multicast import UdpMulticastBus
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Ints
from service.can.frames import EXTENDED, FD_BYTES, ID_BITS, STANDARD_BITS, Frame, FrameBlock
from service.can.receivers import IDLE_S, NOTHING, FrameReceiver, Received, Rejected

BLOCK_FRAMES = 256
"""Most frames of a block; a kernel may buffer only 555"""
# Constants that Python's socket module lacks (include/uapi/asm-generic/socket.h).
_SO_RCVBUFFORCE, _SO_TIMESTAMPNS, _SO_TIMESTAMPING, _SO_RXQ_OVFL = 33, 35, 37, 40
_HARDWARE = 1 << 2 | 1 << 6
"""SOF_TIMESTAMPING_RX_HARDWARE and _RAW_HARDWARE; without effect if the driver has no hardware time stamps."""
_IP_MULTICAST_ALL, _IPV6_MULTICAST_ALL = 49, 29
_BUFFER_BYTES = 16 * 1024 * 1024
_REMOTE, _ERROR = 0x40000000, 0x20000000
_FDF = 0x04
"""Flag by which the kernel marks CAN FD frames; not needed here, as the length of the record shows it."""

_FRAME = np.dtype([("id", "<u4"), ("length", "u1"), ("flags", "u1"), ("_", "u1", (2,)), ("data", "u1", (64,))])
"""struct canfd_frame; a classic frame fills its first 16 bytes."""
_DATAGRAM = np.dtype([("data", "u1", (1024,))])
"""A datagram; a frame packed by python-can takes about 200 bytes."""
_NOTE = np.dtype({"names": ["bytes", "level", "type"], "formats": ["<u8", "<i4", "<i4"], "offsets": [0, 8, 12]})
"""struct cmsghdr"""
_TIME = np.dtype([("s", "<i8"), ("ns", "<i8")])
"""struct timespec"""
_NOTES = np.dtype(
    {
        "names": ["first", "time", "second", "drops", "hardware", "third", "later_drops"],
        "formats": [_NOTE, _TIME, _NOTE, "<u4", _TIME, _NOTE, "<u4"],
        "offsets": [0, 16, 32, 48, 80, 96, 112],
        "itemsize": 128,
    }
)
"""Ancillary data of a frame in the kernel's order: time stamp; hardware time stamps, if any, of which the last of three
is used; counter of dropped frames, once some were dropped."""


_FITS = sys.platform == "linux" and sys.byteorder == "little" and ctypes.sizeof(ctypes.c_size_t) == 8
"""Whether these record layouts are right for this machine; otherwise python-can also receives from SocketCAN."""


class IoVec(ctypes.Structure):
    """``struct iovec``: where the content of a message lies."""

    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _MsgHdr(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint32),
        ("vectors", ctypes.POINTER(IoVec)),
        ("vectors_length", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class MMsgHdr(ctypes.Structure):
    """``struct mmsghdr``: a message among many, and its length."""

    _fields_ = (("header", _MsgHdr), ("length", ctypes.c_uint32))


class BlockReceiver(FrameReceiver):
    """Receives blocks from the socket of a bus, with the kernel's time stamps and counter of dropped frames.

    While a block is collected, frames wait in the kernel, with time stamps of their receipt.  So the thread runs once
    for each block and not for each frame.  ``message``: record type of a message of the socket.
    """

    def __init__(self, bus: can.BusABC, message: np.dtype[np.void]) -> None:
        super().__init__(bus)
        _prepare(bus.fileno())
        self._more = False  # whether more frames may wait
        self._clock = StampClock()
        self._poll = select.poll()
        self._poll.register(bus.fileno(), select.POLLIN)
        self._recvmmsg = ctypes.CDLL(None, use_errno=True).recvmmsg
        self._raw, self._notes = np.zeros(BLOCK_FRAMES, message), np.zeros(BLOCK_FRAMES, _NOTES)
        self._vectors, self._headers = (IoVec * BLOCK_FRAMES)(), (MMsgHdr * BLOCK_FRAMES)()
        for k, (vector, header) in enumerate(zip(self._vectors, self._headers, strict=True)):
            vector.base, vector.length = self._raw[k : k + 1].ctypes.data, message.itemsize
            header.header.vectors, header.header.vectors_length = ctypes.pointer(vector), 1
            header.header.control = self._notes[k : k + 1].ctypes.data
        headers = np.frombuffer(self._headers, np.uint8).reshape(BLOCK_FRAMES, -1)  # type: ignore[call-overload]
        at = MMsgHdr.header.offset + _MsgHdr.control_length.offset
        self._control_lengths = headers[:, at : at + 8].view("<u8")[:, 0]
        self._lengths = headers[:, MMsgHdr.length.offset :][:, :4].view("<u4")[:, 0]

    def read(self, most: int, stop: Event) -> Received:
        """See ``FrameReceiver``."""
        self._raise_fault()
        if not self._more:
            if not self._poll.poll(1000 * IDLE_S):
                return NOTHING
            stop.wait(self.block_s)
        return self._now(most)

    def _now(self, most: int) -> Received:
        """The waiting frames."""
        self._more = False
        self._control_lengths[:] = _NOTES.itemsize
        for older in ("second", "third"):
            self._notes[older]["type"] = 0
        wanted = min(most, BLOCK_FRAMES)
        count = self._recvmmsg(self._bus.fileno(), self._headers, wanted, socket.MSG_DONTWAIT, None)
        if count < 0:
            code = ctypes.get_errno()
            if code in (errno.EAGAIN, errno.EWOULDBLOCK, errno.EINTR):
                return NOTHING
            raise OSError(code, os.strerror(code))
        self._more = count == wanted
        notes = self._notes[:count]
        for note, value in (("second", "drops"), ("third", "later_drops")):
            counted = notes[note]["type"] == _SO_RXQ_OVFL
            if counted.any():
                self.overflow = max(self.overflow, int(notes[value][counted][-1]))
        return self._received(self._raw[:count], self._clock.times_us(notes))

    def _received(self, raw: NDArray[np.void], t_us: Ints) -> Received:
        """The frames in messages (N,) received at these times (N,)."""
        raise NotImplementedError


class SocketReceiver(BlockReceiver):
    """Receives from a SocketCAN bus."""

    name = "socketcan in blocks"

    def __init__(self, bus: SocketcanBus) -> None:
        super().__init__(bus, _FRAME)
        with socket.socket(fileno=os.dup(bus.fileno())) as same, suppress(OSError):
            same.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPING, _HARDWARE)

    def _received(self, raw: NDArray[np.void], t_us: Ints) -> Received:
        ids = raw["id"]
        error, remote = (ids & _ERROR) != 0, (ids & (_ERROR | _REMOTE)) == _REMOTE
        rejected: dict[Rejected, int] = {}
        if error.any():
            rejected["error_frame"] = int(np.count_nonzero(error))
        if remote.any():
            rejected["remote_frame"] = int(np.count_nonzero(remote))
        sound = ~(error | remote)
        return Received(_block(raw[sound], t_us[sound]), rejected)


class DatagramReceiver(BlockReceiver):
    """Receives from a multicast bus; each datagram has a frame packed by python-can."""

    name = "udp_multicast in blocks"

    def __init__(self, bus: UdpMulticastBus) -> None:
        super().__init__(bus, _DATAGRAM)
        _only_own_group(bus.fileno())
        self._classic = bus.protocol is can.CanProtocol.CAN_20
        self._passes = lru_cache(4096)(partial(_passes, bus))

    def _received(self, raw: NDArray[np.void], t_us: Ints) -> Received:
        frames, rejected = list[Frame](), dict[Rejected, int]()
        packed = zip(raw["data"], self._lengths.tolist(), t_us.tolist(), strict=False)
        try:
            for message, length, at_us in packed:
                found = self._frame(msgpack.unpackb(message[:length], raw=False), at_us)
                if isinstance(found, Frame):
                    frames.append(found)
                elif found is not None:
                    rejected[found] = rejected.get(found, 0) + 1
        except (ValueError, TypeError, KeyError, msgpack.exceptions.UnpackException) as error:
            self._fault = can.CanOperationError("a datagram holds no frame")
            self._fault.__cause__ = error
        return Received(FrameBlock.from_frames(frames), rejected)

    def _frame(self, packed: Mapping[str, Any], at_us: int) -> Frame | Rejected | None:
        """The frame in a datagram; None: the filters refuse it."""
        can_id, extended, data = packed["arbitration_id"], bool(packed["is_extended_id"]), packed["data"]
        if not 0 <= can_id <= (ID_BITS if extended else STANDARD_BITS) or len(data) > FD_BYTES:
            raise ValueError("no frame has such an id or length")
        if not self._passes(can_id, extended) or (self._classic and packed["is_fd"]):
            return None
        if packed["is_error_frame"]:
            return "error_frame"
        return "remote_frame" if packed["is_remote_frame"] else Frame(at_us, can_id, extended, bytes(data))


def _prepare(fileno: int) -> None:
    """Let a socket buffer many messages, and report the time of receipt and the drops before with each."""
    with socket.socket(fileno=os.dup(fileno)) as same:
        try:
            same.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _BUFFER_BYTES)
        except PermissionError:  # not root: net.core.rmem_max limits the size
            same.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        same.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        same.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)


def _only_own_group(fileno: int) -> None:
    """Let a socket receive only the datagrams of its own group.

    By default, Linux also gives it the datagrams for the same port of every group that any process on this machine has
    joined: frames of another robot.
    """
    with socket.socket(fileno=os.dup(fileno)) as same:
        if same.family == socket.AF_INET6:
            same.setsockopt(socket.IPPROTO_IPV6, _IPV6_MULTICAST_ALL, 0)
        else:
            same.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)


def _passes(bus: can.BusABC, can_id: int, extended: bool) -> bool:
    """Whether the filters of a bus accept frames with this id."""
    return not bus.filters or any(
        wanted.get("extended", extended) == extended and not (can_id ^ wanted["can_id"]) & wanted["can_mask"]
        for wanted in bus.filters
    )


class StampClock:
    """Times of frames by the clock of the machine, with the accuracy of hardware time stamps if there are some.

    A CAN controller stamps frames when they arrive; the kernel stamps them when it handles them, which is later.  But
    the controller's clock is set once and then runs on its own crystal.  So the hardware time is shifted by the
    smallest difference of the two stamps.  The shift follows quickly if the difference gets smaller, and slowly if it
    gets larger, as when the machine is busy.
    """

    def __init__(self) -> None:
        self._shift_ns: int | None = None

    def times_us(self, notes: NDArray[np.void]) -> Ints:
        """Times of a block (N,) [us]; the present time for frames without a kernel time stamp."""
        kernel_ns = _nanoseconds(notes["time"])
        stamped: Bools = notes["first"]["type"] == _SO_TIMESTAMPNS
        if not stamped.all():
            kernel_ns = np.where(stamped, kernel_ns, time.time_ns())
        hardware_ns = _nanoseconds(notes["hardware"])
        exact: Bools = (notes["second"]["type"] == _SO_TIMESTAMPING) & (hardware_ns != 0)
        if exact.any():
            least_ns = int((kernel_ns - hardware_ns)[exact].min())
            if self._shift_ns is None or abs(more_ns := least_ns - self._shift_ns) > _STEP_NS:
                self._shift_ns = least_ns  # one of the clocks was set
            else:
                self._shift_ns += more_ns // (_SLOWLY if more_ns > 0 else _QUICKLY)
            kernel_ns = np.where(exact, hardware_ns + self._shift_ns, kernel_ns)
        return (kernel_ns + 500) // 1000


_STEP_NS = 10_000_000
_QUICKLY, _SLOWLY = 4, 64
"""The shift follows a difference by one such part in each block.  At 30 blocks/s, a clock that is off by 100 ppm then
has an error of at most 0.2 ms."""


def _nanoseconds(at: NDArray[np.void]) -> Ints:
    found: Ints = at["s"] * 1_000_000_000 + at["ns"]
    return found


def _block(raw: NDArray[np.void], t_us: Ints) -> FrameBlock:
    ids, lengths, flags = raw["id"], raw["length"].astype(np.int64), raw["flags"] & ~np.uint8(_FDF)
    ids = np.where(ids & EXTENDED, ids & (EXTENDED | ID_BITS), ids & STANDARD_BITS)
    # Data beyond the length is from an older frame; from_columns replaces it by zeros.
    return FrameBlock.from_columns(t_us, ids.astype(np.int64), lengths, raw["data"], flags.astype(np.int64))


def receiver_of(bus: can.BusABC) -> FrameReceiver:
    """The receiver for this kind of bus."""
    if _FITS and isinstance(bus, SocketcanBus):
        return SocketReceiver(bus)
    return DatagramReceiver(bus) if _FITS and isinstance(bus, UdpMulticastBus) else FrameReceiver(bus)


def reader_of(interface: str) -> str:
    """How frames of this interface are received, in words."""
    in_blocks = {"socketcan": SocketReceiver.name, "udp_multicast": DatagramReceiver.name}
    return in_blocks.get(interface, FrameReceiver.name) if _FITS else FrameReceiver.name
