"""Blocks of frames from the reader to the worker, bounded in frames."""

from __future__ import annotations

import threading
from collections import deque

from service.can.frames import Frame


class FrameQueue:
    """First in, first out.  A block that does not fit is refused as a whole, so that there is a single gap.

    Args:
        most: number of frames that may wait.
        ready: set whenever frames are put in; may be shared by queues that one worker empties.
    """

    def __init__(self, most: int, ready: threading.Event | None = None) -> None:
        self.ready = ready or threading.Event()
        self._most = most
        self._blocks: deque[list[Frame]] = deque()
        self._frames = 0
        self._lock = threading.Lock()

    def put(self, block: list[Frame]) -> bool:
        """Add a block; False, and nothing added, when it does not fit."""
        with self._lock:
            if self._frames + len(block) > self._most:
                return False
            self._blocks.append(block)
            self._frames += len(block)
        self.ready.set()
        return True

    def take(self, most: int) -> list[Frame]:
        """The oldest frames, whole blocks until there are ``most`` or more; empty when none wait."""
        frames: list[Frame] = []
        with self._lock:
            while self._blocks and len(frames) < most:
                frames += self._blocks.popleft()
            self._frames -= len(frames)
        return frames

    def __len__(self) -> int:
        """Frames that wait."""
        return self._frames
