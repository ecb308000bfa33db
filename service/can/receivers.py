"""Receivers: blocks of frames from an open bus, by python-can; those with a socket of their own: socket_receivers."""

import time
from collections.abc import Mapping
from threading import Event
from typing import Literal, NamedTuple

import can

from service.can.frames import FD_BYTES, ID_BITS, NO_FRAMES, Frame, FrameBlock

Rejected = Literal["error_frame", "remote_frame"]

BLOCK_S = 0.03
"""The longest time in which frames are collected"""
IDLE_S = 0.1
# A clock that says a time before 2000 does not count from 1970 (some adapters count from power-on).
_EARLIEST_S = 946_684_800
_LATEST_US = 2**62


class Received(NamedTuple):
    """What a bus brought."""

    frames: FrameBlock
    rejected: Mapping[Rejected, int]
    """Frames without data, by reason"""


NOTHING = Received(NO_FRAMES, {})


class Receiver:
    """Reads any bus of python-can; frames dropped by the interface are not reported."""

    name = "python-can"
    """As shown to the user"""
    block_s = BLOCK_S
    """Time in which frames are collected"""
    overflow = 0
    """Frames that the kernel dropped because they were not read fast enough"""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._fault: Exception | None = None

    def read(self, most: int, stop: Event) -> Received:
        """The frames of the next moment; none when there were none for a while, or ``stop`` was set.

        Args:
            most: frames at most.
            stop: ends the wait.

        Raises:
            can.CanOperationError, OSError: the bus is down or gone; what came before has been returned.
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
        """Raise what has ended the last block."""
        fault, self._fault = self._fault, None
        if fault is not None:
            raise fault


def frame_of(message: can.Message, stored: bool = False) -> Frame | Rejected:
    """The frame in a message of python-can, with its time rounded to whole microseconds once.

    The time of a message that is ``stored`` in a file is used as it is; else one that does not count from 1970 is
    replaced by now.

    Raises:
        ValueError, OverflowError: of a damaged file: no frame has such a time, id or length.
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
