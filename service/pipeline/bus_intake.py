"""Input of frames: the reader of each bus, and the file that frames are recorded to."""

from typing import Protocol

import structlog

from service.can.bus_reader import ReaderStats
from service.can.frames import Frame
from service.can.recorder import FrameRecorder
from service.can.user_errors import RecordError
from service.ingest.bus_samples import Ingest
from service.pipeline.snapshot import BusSnapshot

log = structlog.get_logger(__name__)


class Reader(Protocol):
    """Interface of service.can.bus_reader.CanReader as the worker uses it."""

    def take(self, most: int = 4096) -> list[Frame]:
        """About that many of the waiting frames, oldest first."""

    def stats(self) -> ReaderStats:
        """State and counters."""


class Recording:
    """Recording of frames to a file, until the disk refuses them."""

    def __init__(self, recorder: FrameRecorder | None) -> None:
        self._recorder = recorder
        self.problem: str | None = None
        """Why recording has ended, for the operator."""

    def write(self, bus: str, frames: list[Frame]) -> None:
        """Write frames as received; a failure ends the recording, not the monitoring."""
        if self._recorder is None or self.problem is not None:
            return
        try:
            self._recorder.write(bus, frames)
        except RecordError as error:
            self.problem = f"recording has ended: {error}"
            log.error("recording has ended", reason=str(error))

    def close(self) -> None:
        """Close the file."""
        if self._recorder is None:
            return
        try:
            self._recorder.close()
        except RecordError as error:
            log.error("the end of the recording is lost", reason=str(error))


class BusIntake:
    """One bus: its frames, and its state, which is shown and logged."""

    def __init__(self, name: str, reader: Reader, ingest: Ingest, recording: Recording) -> None:
        self.name = name
        self._reader, self._ingest, self._recording = reader, ingest, recording
        self._state = "up"

    def take(self, most: int) -> list[Frame]:
        """The waiting frames, recorded."""
        frames = self._reader.take(most)
        if frames:
            self._recording.write(self.name, frames)
        return frames

    def snapshot(self) -> BusSnapshot:
        """State of the bus now; a change is logged."""
        stats = self._reader.stats()
        if stats.state != self._state:
            self._state = stats.state
            say = log.info if stats.up or stats.state == "closed" else log.error
            say("bus", bus=self.name, state=stats.state)
        dropped = {**stats.dropped, **self._ingest.dropped}
        return BusSnapshot(self.name, stats.state, stats.up, stats.frames, dropped)
