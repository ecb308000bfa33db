"""Records raw frames to files: all frames with ``run --record``, and the minutes around each alarm.

The frames of the last minutes are kept in memory.  An alarm starts an extract: when the time after the alarm has
passed, a thread writes the frames before and after it to a candump log or a .blf file.  A replay of that file raises
the same alarm again.  A person can also request an extract.
"""

import queue
import threading
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path

import structlog

from monitor_core.wording import sentence
from service.can.frame_recorder import FrameRecorder
from service.can.frames import FrameBlock
from service.can.user_errors import RecordError
from service.pipeline.axes.axis_alarms import AxisAlarm
from service.pipeline.persistence.recording_folder import Frames, RecordingFolder

MOST_RING_BYTES = 64_000_000
"""Memory of the kept frames: two minutes at 20 000 frames/s"""
_SILENT_US = 5_000_000
"""Longest wait for frames after the end of an extract, as the bus may have become silent."""
RETRY_S = 5.0
"""Time until the next try to write what the disk refused"""

log = structlog.get_logger(__name__)


class FrameRing:
    """The last frames of all buses, bounded by time and by memory.

    Args:
        length_s: how long a frame is kept [s].
        most_bytes: memory of the frames.
    """

    def __init__(self, length_s: float, most_bytes: int = MOST_RING_BYTES) -> None:
        self._length_us, self._most_bytes = round(length_s * 1e6), most_bytes
        self._blocks = deque[tuple[str, FrameBlock]]()
        self._bytes = 0

    def add(self, bus: str, frames: FrameBlock) -> None:
        """Add the next frames of a bus, at least one."""
        kept = FrameBlock(frames.records.copy())  # a view would keep the whole larger array in memory
        self._blocks.append((bus, kept))
        self._bytes += kept.records.nbytes
        newest = int(kept.t_us[-1])
        # The absolute value, as frames from before a clock was set back have later times.
        while self._bytes > self._most_bytes or abs(newest - self._last_us(0)) > self._length_us:
            _, oldest = self._blocks.popleft()
            self._bytes -= oldest.records.nbytes

    @property
    def oldest_us(self) -> int | None:
        """Time of the oldest frame; None: there are no frames."""
        return int(self._blocks[0][1].t_us[0]) if self._blocks else None

    @property
    def newest_us(self) -> int | None:
        """Time of the newest frame; None: there are no frames."""
        return self._last_us(-1) if self._blocks else None

    def between(self, from_us: int, until_us: int) -> Frames:
        """The frames from ``from_us`` to ``until_us``."""
        found = []
        for bus, frames in self._blocks:
            part = frames.select((frames.t_us >= from_us) & (frames.t_us <= until_us))
            if part:
                found.append((bus, part))
        return found

    def _last_us(self, block: int) -> int:
        return int(self._blocks[block][1].t_us[-1])


@dataclass(slots=True)
class _Extract:
    from_us: int
    until_us: int
    written: Future[Path] = field(default_factory=Future)
    requested: bool = False
    """Whether a person has requested it, who then gets the error"""


_Job = tuple[_Extract, Frames]


class Extracts:
    """Writes the frames around alarms, and on request the frames of the last minutes.

    An alarm that is raised within a started extract gets no file of its own, so many alarms at once cost one file.

    Args:
        folder: the folder of the files.
        before_s: recorded time before an alarm [s].
        after_s: recorded time after an alarm [s].
        now_us: wall clock.
    """

    def __init__(self, folder: RecordingFolder, before_s: float, after_s: float, now_us: Callable[[], int]) -> None:
        self.folder, self._now_us = folder, now_us
        self._before_us, self._after_us = round(before_s * 1e6), round(after_s * 1e6)
        self._ring = FrameRing(before_s + after_s + 2 * _SILENT_US / 1e6)
        self._started: _Extract | None = None
        self._last_us = 0  # end of the last extract
        self._requests = queue.SimpleQueue[Future[Path]]()
        self._latest_requests = queue.SimpleQueue[tuple[float, Future[Frames]]]()
        self._jobs = queue.SimpleQueue[_Job | None]()
        self._writer = threading.Thread(target=self._write_all, name="recordings", daemon=True)
        self._writer.start()
        self.problem: str | None = None
        """Message to the operator: why an extract is not written yet; None: all are written."""

    def add(self, bus: str, frames: FrameBlock) -> None:
        """Keep the next frames of a bus."""
        self._ring.add(bus, frames)

    def alarm(self, raised_us: int) -> None:
        """Start an extract for an alarm, unless one has started or covers the alarm, or the frames are gone."""
        oldest = self._ring.oldest_us
        if self._started is None and oldest is not None and raised_us >= oldest and not self._covers(raised_us):
            self._started = _Extract(raised_us - self._before_us, raised_us + self._after_us)

    def request(self) -> Future[Path]:
        """Request a file with the frames of the last minutes; the future gets its path or a RecordError.

        From any thread.
        """
        answer = Future[Path]()
        self._requests.put(answer)
        return answer

    def latest(self, seconds: float) -> Future[Frames]:
        """Request the frames of the last ``seconds`` before the newest frame.  From any thread."""
        answer = Future[Frames]()
        self._latest_requests.put((seconds, answer))
        return answer

    def tick(self) -> None:
        """Pass complete extracts to the writer's thread, and answer requests."""
        now_us = self._now_us()
        while not self._latest_requests.empty():
            seconds, answer = self._latest_requests.get()
            until_us = self._ring.newest_us or now_us
            answer.set_result(self._ring.between(until_us - round(seconds * 1e6), until_us))
        while not self._requests.empty():
            until_us = self._ring.newest_us or now_us
            self._hand_over(_Extract(until_us - self._before_us, until_us, self._requests.get(), requested=True))
        if (extract := self._started) is not None:
            newest = self._ring.newest_us
            if (newest is not None and newest > extract.until_us) or now_us > extract.until_us + _SILENT_US:
                self._started = None
                self._last_us = extract.until_us
                self._hand_over(extract)

    def close(self) -> None:
        """Write a started extract with the frames received so far, and end the thread."""
        if self._started is not None:
            self._hand_over(self._started)
        self._jobs.put(None)
        self._writer.join()
        while not self._requests.empty():
            self._requests.get().set_exception(RecordError("the daemon has stopped"))
        while not self._latest_requests.empty():
            self._latest_requests.get()[1].set_exception(RecordError("the daemon has stopped"))

    def _covers(self, t_us: int) -> bool:
        return self._last_us - self._after_us - self._before_us <= t_us <= self._last_us

    def _hand_over(self, extract: _Extract) -> None:
        self._jobs.put((extract, self._ring.between(extract.from_us, extract.until_us)))

    def _write_all(self) -> None:
        """Write extracts as they come.  The newest one around an alarm that the disk refuses is tried again."""
        refused: _Job | None = None
        going_on = True
        while going_on:
            job, going_on = self._next_job(None if refused is None else RETRY_S)
            if job is None:
                job, refused = refused, None
            if job is not None and not self._write(*job):
                self._give_up(refused)
                refused = job
        self._give_up(refused)

    def _next_job(self, timeout_s: float | None) -> tuple[_Job | None, bool]:
        """The next extract, None: none within the time; and whether more may follow."""
        try:
            job = self._jobs.get(timeout=timeout_s)
        except queue.Empty:
            return None, True
        return job, job is not None

    def _give_up(self, refused: _Job | None) -> None:
        if refused is not None:
            refused[0].written.set_exception(RecordError(self.problem or ""))

    def _write(self, extract: _Extract, blocks: Frames) -> bool:
        """Write an extract; returns False if the disk refuses one around an alarm, which must be retried."""
        try:
            if not blocks:
                raise RecordError("no frames in that time: there is nothing to record")
            path = self.folder.write(blocks)
        except RecordError as error:
            if extract.requested or not blocks:
                extract.written.set_exception(error)
                return True
            if self.problem is None:
                log.error("frames around an alarm are not recorded", reason=str(error))
            self.problem = sentence(
                "frames not recorded", "frames around an alarm are not recorded yet: {why}", why=error
            )
            return False
        if not extract.requested:
            self.problem = None
        log.info("frames recorded", file=path.name)
        extract.written.set_result(path)
        return True


class Recording:
    """Records frames: all to one file until the disk refuses it, and those around alarms to extracts.

    Args:
        recorder: gets all frames.
        extracts: get the frames around alarms.
    """

    def __init__(self, recorder: FrameRecorder | None = None, extracts: Extracts | None = None) -> None:
        self._recorder, self._extracts = recorder, extracts
        self._ended: str | None = None

    @property
    def problems(self) -> tuple[str, ...]:
        """Messages to the operator: what is not recorded, and why."""
        found = (self._ended, self._extracts and self._extracts.problem)
        return tuple(problem for problem in found if problem)

    def write(self, bus: str, frames: FrameBlock) -> None:
        """Write frames as received; a failure ends the recording, not the monitoring."""
        if self._extracts is not None:
            self._extracts.add(bus, frames)
        if self._recorder is None or self._ended is not None:
            return
        try:
            self._recorder.write(bus, frames)
        except RecordError as error:
            self._ended = sentence("recording ended", "recording has ended: {why}", why=error)
            log.error("recording has ended", reason=str(error))

    def follow(self, changes: Iterable[AxisAlarm]) -> None:
        """Start extracts for the alarms that were raised."""
        if self._extracts is None:
            return
        for change in changes:
            alarm = change.alarm
            if alarm.ended_us is None and alarm.kind != "forecast":
                self._extracts.alarm(alarm.reopened_us or alarm.raised_us)

    def tick(self) -> None:
        """Write complete extracts and answer requests."""
        if self._extracts is not None:
            self._extracts.tick()

    def close(self) -> None:
        """Write a started extract, and close the files."""
        if self._extracts is not None:
            self._extracts.close()
        if self._recorder is None:
            return
        try:
            self._recorder.close()
        except RecordError as error:
            if self._ended is None:
                log.error("the end of the recording is lost", reason=str(error))
