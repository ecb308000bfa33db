"""Receivers with a socket: many messages in one system call, into memory that is there."""

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
from service.can.frames import EXTENDED, FD_BYTES, ID_BITS, Frame, FrameBlock
from service.can.receivers import IDLE_S, NOTHING, Received, Receiver, Rejected

BLOCK_FRAMES = 256
"""Frames of a block at most: a kernel may keep only 555"""
_STANDARD_ID = 0x7FF
# Numbers that Python's socket module does not have (include/uapi/asm-generic/socket.h).
_SO_RCVBUFFORCE, _SO_TIMESTAMPNS, _SO_TIMESTAMPING, _SO_RXQ_OVFL = 33, 35, 37, 40
_HARDWARE = 1 << 2 | 1 << 6
"""SOF_TIMESTAMPING_RX_HARDWARE and _RAW_HARDWARE: only frames of a driver that has such stamps then carry them."""
_IP_MULTICAST_ALL, _IPV6_MULTICAST_ALL = 49, 29
_BUFFER_BYTES = 16 * 1024 * 1024
_REMOTE, _ERROR = 0x40000000, 0x20000000
_FDF = 0x04
"""The kernel marks CAN FD frames with this flag; the length of their record says as much."""

_FRAME = np.dtype(
    [("id", "<u4"), ("length", "u1"), ("flags", "u1"), ("_", "u1", (2,)), ("data", "u1", (64,))]
)
"""struct canfd_frame; a classic frame fills the first 16 bytes of it."""
_DATAGRAM = np.dtype([("data", "u1", (1024,))])
"""A frame as python-can packs it takes some 200 bytes."""
_NOTE = np.dtype(
    {"names": ["bytes", "level", "type"], "formats": ["<u8", "<i4", "<i4"], "offsets": [0, 8, 12]}
)
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
"""Ancillary data of a frame in the kernel's order: the time stamp; that of the hardware, where there is one, as the
last of three; the counter of drops, once there were some."""


_FITS = sys.platform == "linux" and sys.byteorder == "little" and ctypes.sizeof(ctypes.c_size_t) == 8
"""Whether these records are those of this machine; otherwise python-can reads SocketCAN, too."""


class _IoVec(ctypes.Structure):
    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _MsgHdr(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint32),
        ("vectors", ctypes.POINTER(_IoVec)),
        ("vectors_length", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _MMsgHdr(ctypes.Structure):
    _fields_ = (("header", _MsgHdr), ("length", ctypes.c_uint32))


class BlockReceiver(Receiver):
    """Reads the socket of a bus in blocks, with kernel time stamps and the kernel's counter of drops.

    Frames wait in the kernel while a block is collected, so this thread runs once in a block and not once for each
    frame; their time stamps are those of their receipt.  ``message``: what a message of the socket looks like.
    """

    def __init__(self, bus: can.BusABC, message: np.dtype[np.void]) -> None:
        super().__init__(bus)
        _prepare(bus.fileno())
        self._more = False  # frames may wait still
        self._clock = StampClock()
        self._poll = select.poll()
        self._poll.register(bus.fileno(), select.POLLIN)
        self._recvmmsg = ctypes.CDLL(None, use_errno=True).recvmmsg
        self._raw, self._notes = np.zeros(BLOCK_FRAMES, message), np.zeros(BLOCK_FRAMES, _NOTES)
        self._vectors, self._headers = (_IoVec * BLOCK_FRAMES)(), (_MMsgHdr * BLOCK_FRAMES)()
        for k, (vector, header) in enumerate(zip(self._vectors, self._headers, strict=True)):
            vector.base, vector.length = self._raw[k : k + 1].ctypes.data, message.itemsize
            header.header.vectors, header.header.vectors_length = ctypes.pointer(vector), 1
            header.header.control = self._notes[k : k + 1].ctypes.data
        headers = np.frombuffer(self._headers, np.uint8).reshape(BLOCK_FRAMES, -1)  # type: ignore[call-overload]
        at = _MMsgHdr.header.offset + _MsgHdr.control_length.offset
        self._control_lengths = headers[:, at : at + 8].view("<u8")[:, 0]
        self._lengths = headers[:, _MMsgHdr.length.offset :][:, :4].view("<u4")[:, 0]

    def read(self, most: int, stop: Event) -> Received:
        """See Receiver."""
        self._raise_fault()
        if not self._more:
            if not self._poll.poll(1000 * IDLE_S):
                return NOTHING
            stop.wait(self.block_s)
        return self._now(most)

    def _now(self, most: int) -> Received:
        """The frames that wait."""
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
        """What messages (N,) that were received then bring."""
        raise NotImplementedError


class SocketReceiver(BlockReceiver):
    """Reads a SocketCAN bus."""

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
    """Reads a multicast bus, whose datagrams each hold a frame as python-can packs it."""

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
        """The frame in a datagram; None: it is not wanted."""
        can_id, extended, data = packed["arbitration_id"], bool(packed["is_extended_id"]), packed["data"]
        if not 0 <= can_id <= (ID_BITS if extended else _STANDARD_ID) or len(data) > FD_BYTES:
            raise ValueError("no frame has such an id or length")
        if not self._passes(can_id, extended) or (self._classic and packed["is_fd"]):
            return None
        if packed["is_error_frame"]:
            return "error_frame"
        return "remote_frame" if packed["is_remote_frame"] else Frame(at_us, can_id, extended, bytes(data))


def _prepare(fileno: int) -> None:
    """Let a socket hold many messages, and note with each the time of its receipt and the drops before it."""
    with socket.socket(fileno=os.dup(fileno)) as same:
        try:
            same.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _BUFFER_BYTES)
        except PermissionError:  # not root: as much as net.core.rmem_max allows
            same.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        same.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        same.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)


def _only_own_group(fileno: int) -> None:
    """Let a socket get the datagrams of its own group only.

    Linux gives it those of every group that anybody on this machine has joined, as far as the port is the same: the
    frames of another robot.
    """
    with socket.socket(fileno=os.dup(fileno)) as same:
        if same.family == socket.AF_INET6:
            same.setsockopt(socket.IPPROTO_IPV6, _IPV6_MULTICAST_ALL, 0)
        else:
            same.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)


def _passes(bus: can.BusABC, can_id: int, extended: bool) -> bool:
    """Whether the filters of a bus let the frames of that id through."""
    return not bus.filters or any(
        wanted.get("extended", extended) == extended and not (can_id ^ wanted["can_id"]) & wanted["can_mask"]
        for wanted in bus.filters
    )


class StampClock:
    """Times of frames by the clock of the machine, as exact as the stamps of the hardware where there are some.

    A CAN controller stamps frames when they come, the kernel when it gets to them.  But the controller's clock is set
    once and then runs by its own crystal.  So its time is shifted by what the kernel needed at least; that is followed
    quickly where it is less than before, and slowly where it is more, as while the machine is busy.
    """

    def __init__(self) -> None:
        self._shift_ns: int | None = None

    def times_us(self, notes: NDArray[np.void]) -> Ints:
        """Whole microseconds of a block; the present time where the kernel gave none."""
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
"""Parts of a difference, of which one is followed with each block: at 30 blocks a second a clock that is off by 100 ppm
is behind by .2 ms at most."""


def _nanoseconds(at: NDArray[np.void]) -> Ints:
    found: Ints = at["s"] * 1_000_000_000 + at["ns"]
    return found


def _block(raw: NDArray[np.void], t_us: Ints) -> FrameBlock:
    ids, lengths, flags = raw["id"], raw["length"].astype(np.int64), raw["flags"] & ~np.uint8(_FDF)
    ids = np.where(ids & EXTENDED, ids & (EXTENDED | ID_BITS), ids & _STANDARD_ID)
    # Beyond its length the data are what an older frame has left.
    return FrameBlock.from_columns(t_us, ids.astype(np.int64), lengths, raw["data"], flags.astype(np.int64))


def receiver_of(bus: can.BusABC) -> Receiver:
    """The receiver for this kind of bus."""
    if _FITS and isinstance(bus, SocketcanBus):
        return SocketReceiver(bus)
    return DatagramReceiver(bus) if _FITS and isinstance(bus, UdpMulticastBus) else Receiver(bus)


def reader_of(interface: str) -> str:
    """How a bus of that interface is read, as shown to the user."""
    in_blocks = {"socketcan": SocketReceiver.name, "udp_multicast": DatagramReceiver.name}
    return in_blocks.get(interface, Receiver.name) if _FITS else Receiver.name
