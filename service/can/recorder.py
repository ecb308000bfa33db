"""Records frames as received; reading the file gives exactly the same frames."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Self

import can

from service.can.frames import Frame
from service.can.user_errors import RecordError


class FrameRecorder:
    """Writes a candump log (.log): times to the microsecond, the name of the bus, CAN FD.

    The other formats of python-can lose some of this and are refused: .asc rounds the start to milliseconds, .trc has
    no CAN FD, .blf has no names of buses and writes nothing to the disk before 128 KiB.

    Raises:
        RecordError: another format, or a file that exists or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        if path.suffix.lower() != ".log":
            raise RecordError(f"{path}: frames are recorded as .log, which keeps them exactly; name it so")
        try:
            self._file = path.open("x", encoding="utf-8", newline="\n")
        except FileExistsError:
            raise RecordError(f"{path} exists already: choose another name, or remove it") from None
        except OSError as error:
            raise RecordError(f"cannot write {path}: {error.strerror}") from None
        self.path = path
        self._writer = can.CanutilsLogWriter(self._file)
        self._writer.last_timestamp = 0.0  # otherwise times before that of the first frame are changed
        self._failed = False

    def write(self, bus: str, frames: Iterable[Frame]) -> None:
        """Write frames of a bus; they are in the file when this returns.

        Raises:
            RecordError: the disk does not take them.
        """
        try:
            for frame in frames:
                self._writer.on_message_received(_message(bus, frame))
            self._file.flush()
        except OSError as error:
            self._failed = True
            raise self._error(error) from None

    def close(self) -> None:
        """Close the file; a second time does nothing.

        Raises:
            RecordError: the disk does not take what is left, and ``write`` has not said so already.
        """
        try:
            self._writer.stop()
        except OSError as error:  # flush the buffer and close the file in any case
            if not self._failed:
                raise self._error(error) from None

    def _error(self, error: OSError) -> RecordError:
        return RecordError(f"cannot write {self.path}: {error.strerror}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _1: type[BaseException] | None, _2: object, _3: TracebackType | None) -> None:
        self.close()


def _message(bus: str, frame: Frame) -> can.Message:
    return can.Message(
        timestamp=frame.t_us / 1e6,
        channel=bus,
        arbitration_id=frame.can_id,
        is_extended_id=frame.extended,
        is_fd=len(frame.data) > 8,
        data=frame.data,
    )
