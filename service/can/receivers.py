"""Receives blocks of frames from an open bus with python-can; see socket_receivers for faster receivers."""

import time
from collections.abc import Mapping
from threading import Event
from typing import Literal, NamedTuple

import can

from service.can.frames import FD_BYTES, ID_BITS, NO_FRAMES, Frame, FrameBlock

Rejected = Literal["error_frame", "remote_frame"]

BLOCK_S = 0.03
"""Longest time in which frames are collected to a block"""
IDLE_S = 0.1
# A time stamp before 2000 does not count from 1970: some adapters count from power-on.
_EARLIEST_S = 946_684_800
_LATEST_US = 2**62


class Received(NamedTuple):
    """The result of one read from a bus."""

    frames: FrameBlock
    rejected: Mapping[Rejected, int]
    """Number of rejected frames by reason"""


NOTHING = Received(NO_FRAMES, {})


class FrameReceiver:
    """Receives from any bus of python-can; frames that the interface drops are not counted."""

    name = "python-can"
    """Name for the user"""
    block_s = BLOCK_S
    """Time in which frames are collected [s]"""
    overflow = 0
    """Number of frames that the kernel dropped because they were not read fast enough"""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._fault: Exception | None = None

    def read(self, most: int, stop: Event) -> Received:
        """Wait for frames and collect a block; empty if none came within ``IDLE_S``, or ``stop`` was set.

        Args:
            most: most frames in the block.
            stop: ends the wait.

        Raises:
            can.CanOperationError, OSError: the bus is down or gone; frames received before have been returned.
        """
        self._raise_fault()
        frames, rejected = list[Frame](), dict[Rejected, int]()
        left_s, end = IDLE_S, 0.0
        while len(frames) < most and left_s > 0 and not stop.is_set():
            try:
                message = self._bus.recv(left_s)
            except (can.CanError, OSError) as error:
                if not frames and not rejected:
                    raise
                self._fault = error
                break
            if message is None:
                break
            frame = frame_of(message)
            if isinstance(frame, str):
                rejected[frame] = rejected.get(frame, 0) + 1
            else:
                frames.append(frame)
            now = time.monotonic()
            end = end or now + self.block_s
            left_s = end - now
        return Received(FrameBlock.from_frames(frames), rejected)

    def _raise_fault(self) -> None:
        """Raise the error that ended the last block."""
        fault, self._fault = self._fault, None
        if fault is not None:
            raise fault


def frame_of(message: can.Message, stored: bool = False) -> Frame | Rejected:
    """The frame in a message of python-can, with its time rounded to whole microseconds.

    ``stored``: the message is from a file, and its time is used as it is.  Otherwise a time that does not count from
    1970 is replaced by the present time.

    Raises:
        ValueError, OverflowError: the time, id or length is impossible, as in a damaged file.
    """
    if message.is_error_frame:
        return "error_frame"
    if message.is_remote_frame:
        return "remote_frame"
    use_own = stored or message.timestamp > _EARLIEST_S
    t_us = round(message.timestamp * 1e6) if use_own else time.time_ns() // 1000
    fits = abs(t_us) < _LATEST_US and 0 <= message.arbitration_id <= ID_BITS and len(message.data) <= FD_BYTES
    if not fits:
        raise ValueError("no frame has such a time, id or length")
    return Frame(t_us, message.arbitration_id, message.is_extended_id, bytes(message.data))
