"""Receivers: single frames from an open bus, by its socket on SocketCAN, otherwise by python-can."""

from __future__ import annotations

import select
import socket
import struct
import time
from typing import Literal

import can
from can.interfaces.socketcan import SocketcanBus

from service.can.frames import Frame

Rejected = Literal["error_frame", "remote_frame"]

# Numbers that Python's socket module does not have (include/uapi/asm-generic/socket.h).
_SO_RCVBUFFORCE, _SO_TIMESTAMPNS, _SO_RXQ_OVFL = 33, 35, 40
_BUFFER_BYTES = 16 * 1024 * 1024
_CANFD_MTU = 72
_HEADER = struct.Struct("=IB3x")  # id with flags, length; then the data
_TIMESPEC = struct.Struct("@ll")
_DROPS = struct.Struct("=I")
_EXTENDED, _REMOTE, _ERROR = 0x80000000, 0x40000000, 0x20000000
# A clock that says a time before 2000 does not count from 1970 (some adapters count from power-on).
_EARLIEST_S = 946_684_800


class Receiver:
    """Reads any bus of python-can; frames dropped by the interface are not reported."""

    overflow = 0
    """Frames that the kernel dropped because they were not read fast enough"""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus

    def read(self, timeout_s: float) -> Frame | Rejected | None:
        """The next frame; the reason if it carries no data; or None when there was none in time.

        Raises:
            can.CanOperationError, OSError: the bus is down or gone.
        """
        message = self._bus.recv(timeout_s)
        return None if message is None else frame_of(message)


class SocketReceiver(Receiver):
    """Reads the socket of a SocketCAN bus, with kernel timestamps in nanoseconds and the drop counter of the kernel.

    python-can's own ``recv`` has no counter of drops and leaves the default buffer of 278 frames.
    """

    def __init__(self, bus: SocketcanBus) -> None:
        super().__init__(bus)
        self._socket = bus.socket
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _BUFFER_BYTES)
        except PermissionError:  # not root: as much as net.core.rmem_max allows
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)

    def read(self, timeout_s: float) -> Frame | Rejected | None:
        """See Receiver."""
        try:
            return self._receive()
        except BlockingIOError:
            ready, _, _ = select.select([self._socket], [], [], timeout_s)
        try:
            return self._receive() if ready else None
        except BlockingIOError:  # the kernel may report data and then discard it
            return None

    def _receive(self) -> Frame | Rejected:
        raw, ancillary, _, _ = self._socket.recvmsg(_CANFD_MTU, 128, socket.MSG_DONTWAIT)
        t_ns = 0
        for level, kind, value in ancillary:
            if level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS:
                seconds, nanoseconds = _TIMESPEC.unpack_from(value)
                t_ns = seconds * 1_000_000_000 + nanoseconds
            elif level == socket.SOL_SOCKET and kind == _SO_RXQ_OVFL:
                (self.overflow,) = _DROPS.unpack_from(value)
        can_id, length = _HEADER.unpack_from(raw)
        if can_id & _ERROR:
            return "error_frame"
        if can_id & _REMOTE:
            return "remote_frame"
        extended = bool(can_id & _EXTENDED)
        t_us = ((t_ns or time.time_ns()) + 500) // 1000
        return Frame(t_us, can_id & (0x1FFFFFFF if extended else 0x7FF), extended, raw[8 : 8 + length])


def receiver_of(bus: can.BusABC) -> Receiver:
    """The receiver for this kind of bus."""
    return SocketReceiver(bus) if isinstance(bus, SocketcanBus) else Receiver(bus)


def frame_of(message: can.Message, stored: bool = False) -> Frame | Rejected:
    """The frame in a message of python-can, with its time rounded to whole microseconds once.

    Args:
        message: as received or read from a file.
        stored: from a file: its time is used as it is; otherwise a time that does not count from 1970 is replaced by
            now.
    """
    if message.is_error_frame:
        return "error_frame"
    if message.is_remote_frame:
        return "remote_frame"
    use_own = stored or message.timestamp > _EARLIEST_S
    t_us = round(message.timestamp * 1e6) if use_own else time.time_ns() // 1000
    return Frame(t_us, message.arbitration_id, message.is_extended_id, bytes(message.data))
