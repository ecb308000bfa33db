"""Reads a bus: a thread that owns the bus and puts received frames into a bounded queue."""

import errno
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import can

from monitor_core.wording import sentence
from service.can.bus import BusSettings, open_bus, reaches_hardware
from service.can.frames import NO_FRAMES, FrameBlock, FrameFilter, concatenate_frames
from service.can.receivers import BLOCK_S, FrameReceiver
from service.can.socket_receivers import BLOCK_FRAMES, reader_of, receiver_of
from service.can.user_errors import BusError

READER_REASONS = ("queue_full", "kernel_overflow", "error_frame", "remote_frame")
"""Why a frame did not reach the worker.  kernel_overflow is counted for socketcan and udp_multicast only."""

RETRY_S = 0.25
"""Time until the next try to open a bus, at first"""
LONGEST_RETRY_S = 5.0
"""Longest time between two tries to open a bus"""
_IFF_UP = 1
_MOST_ERRORS = 100
"""After this number of error frames without a data frame, a bus counts as down"""
_ONLY_ERRORS = sentence(
    "only errors",
    "down: nothing but error frames since the last data; are bit rate, cable and termination right?",
)
_GONE = sentence("interface gone", "down: the interface is gone; trying to open it again")


class FrameQueue:
    """Queue of blocks of frames from the reader to the worker, with at most ``most`` frames.

    A block that does not fit is refused as a whole, so that the loss is a single gap.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._blocks: deque[FrameBlock] = deque()
        self._frames = 0
        self._lock = threading.Lock()

    def put(self, block: FrameBlock) -> bool:
        """Add a block; returns False, and adds nothing, if it does not fit."""
        with self._lock:
            if self._frames + block.size > self._most:
                return False
            self._blocks.append(block)
            self._frames += block.size
        return True

    def take(self, most: int) -> FrameBlock:
        """Take the oldest blocks until they have ``most`` frames or more; empty if none wait."""
        taken, count = list[FrameBlock](), 0
        with self._lock:
            while self._blocks and count < most:
                taken.append(self._blocks.popleft())
                count += taken[-1].size
            self._frames -= count
        return concatenate_frames(taken)


@dataclass(frozen=True, slots=True)
class BusSnapshot:
    """One bus: state in words ("up", "down: ...", "closed"), number of received frames, dropped frames by reason."""

    name: str
    state: str
    frames: int
    dropped: Mapping[str, int]
    reader: str = ""
    """How the frames are received, in words"""

    @property
    def up(self) -> bool:
        """Whether frames can be received."""
        return self.state == "up"


class CanReader:
    """Reads one bus until ``close``; recovers when the bus goes down, disappears or comes back.

    Call ``open`` first if a bus that cannot be opened is an error; otherwise the thread keeps trying.  ``wanted``:
    filters of the frames to receive; None: all frames.  ``block_s``: time in which frames are collected, shortened to
    what the kernel can buffer.
    """

    def __init__(self, config: BusSettings, wanted: Iterable[FrameFilter] | None, block_s: float = BLOCK_S) -> None:
        self._config, self._wanted = config, None if wanted is None else tuple(wanted)
        self._queue, self._block_s = FrameQueue(config.queue_frames), min(block_s, BLOCK_S)
        self._block_frames = min(BLOCK_FRAMES, config.queue_frames // 4)
        self._bus: can.BusABC | None = None
        self._receiver: FrameReceiver | None = None
        self._state: str = sentence("not opened", "down: not opened yet")
        self._frames = 0
        self._dropped = dict.fromkeys(READER_REASONS, 0)
        self._overflow_before = self._frames_before = 0
        """Counts up to the last time that the bus was opened"""
        self._errors = 0
        """Error frames since the last frame with data"""
        self._retry_s = RETRY_S
        self.turns = 0
        """Number of loops of the thread, to see that it is alive; it also loops on a silent bus"""
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._arrived: Callable[[], object] = lambda: None

    def open(self) -> None:
        """Open the bus now.

        Raises:
            BusError: the bus cannot be opened.
        """
        self._bus = open_bus(self._config, self._wanted)
        self._receiver = receiver_of(self._bus)
        self._receiver.block_s = self._block_s
        self._overflow_before, self._frames_before = self._dropped["kernel_overflow"], self._frames
        self._state = "up" if self._interface_up() is not False else self._down()

    def start(self, arrived: Callable[[], object] = lambda: None) -> None:
        """Start reading, also after ``close``; the reader's thread calls ``arrived`` when frames have come."""
        self._arrived = arrived
        self._stop.clear()
        self._thread = threading.Thread(target=self._run, name=f"reader-{self._config.name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop reading and close the bus; frames that wait can still be taken."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        self._close_bus()
        self._state = sentence("closed", "closed")

    def take(self, most: int = 4096) -> FrameBlock:
        """Take about ``most`` of the waiting frames, oldest first; empty if there are none."""
        return self._queue.take(most)

    def stats(self) -> BusSnapshot:
        """The present state and counts."""
        return BusSnapshot(
            self._config.name,
            self._state,
            self._frames,
            MappingProxyType(self._dropped.copy()),
            reader_of(self._config.interface),
        )

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                if self._receiver is None:
                    self._reopen()
                else:
                    self._read(self._receiver)
                self.turns += 1
        finally:
            self._state = (
                sentence("closed", "closed")
                if self._stop.is_set()
                else sentence("reader stopped", "down: the reader has stopped, which is a fault")
            )

    def _read(self, receiver: FrameReceiver) -> None:
        """Put one block of frames into the queue."""
        block = NO_FRAMES
        try:
            block, rejected = receiver.read(self._block_frames, self._stop)
            for reason, count in rejected.items():
                self._dropped[reason] += count
            self._errors = 0 if block else self._errors + rejected.get("error_frame", 0)
        except (can.CanError, OSError) as error:
            self._fault(error)
        self._dropped["kernel_overflow"] = self._overflow_before + receiver.overflow
        self._frames += block.size
        if block and not self._queue.put(block):
            self._dropped["queue_full"] += block.size
        if block:
            self._arrived()
        # Check after each block, as frames may come again without a pause.  A bus closed after a fault is not up.
        if self._receiver is not None and (self._state != "up" or self._errors >= _MOST_ERRORS):
            self._check_interface()

    def _fault(self, error: Exception) -> None:
        code = getattr(error, "error_code", None) or getattr(error, "errno", None)
        if code == errno.ENETDOWN:  # the socket stays valid and works again when the interface is up
            self._state = self._down()
            return
        self._close_bus()
        gone = code in (errno.ENODEV, errno.ENXIO)
        self._state = _GONE if gone else sentence("bus fault", "down: {why}; trying to open it again", why=error)
        if self._frames == self._frames_before:  # at a broken bus, an adapter may fail as soon as it is open
            self._stop.wait(RETRY_S)

    def _check_interface(self) -> None:
        """While the bus is down: set it to up if its interface is up; close it if the interface is gone."""
        up = self._interface_up()
        if up:
            self._state = "up" if self._errors < _MOST_ERRORS else _ONLY_ERRORS
        elif up is None:
            self._close_bus()
            self._state = _GONE

    def _reopen(self) -> None:
        try:
            self.open()
            self._retry_s = RETRY_S
        except BusError as error:
            self._state = sentence("down", "down: {why}", why=error.why)
            self._stop.wait(self._retry_s)
            self._retry_s = min(2 * self._retry_s, LONGEST_RETRY_S)

    def _interface_up(self) -> bool | None:
        """Whether the network interface is up; None: it does not exist."""
        if self._config.interface != "socketcan":
            return True
        try:
            flags = Path("/sys/class/net", self._config.channel, "flags").read_text(encoding="ascii")
        except OSError:
            return None
        return bool(int(flags, 16) & _IFF_UP)

    def _down(self) -> str:
        channel = self._config.channel
        if reaches_hardware(self._config):
            words = (
                "down: the interface is down; bring it up with the bit rate of the bus, for 500 kbit/s:"
                " `ip link set {channel} up type can bitrate 500000`"
            )
            return sentence("adapter down", words, channel=channel)
        words = "down: the interface is down; bring it up with `ip link set {channel} up`"
        return sentence("interface down", words, channel=channel)

    def _close_bus(self) -> None:
        bus, self._bus, self._receiver = self._bus, None, None
        if bus is not None:
            bus.shutdown()
