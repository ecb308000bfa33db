"""The folder of the extracts: files of raw frames with their times in the names, and their replay reports."""

import os
import re
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path

import structlog

from service.can.frame_recorder import FrameRecorder, write_blf
from service.can.frames import FrameBlock
from service.can.user_errors import RecordError

_FORMAT = "%Y%m%dT%H%M%SZ"
_NAME = re.compile(r"frames-(\d{8}T\d{6}Z)-(\d{8}T\d{6}Z)\.(?:log|blf)")

Frames = list[tuple[str, FrameBlock]]
"""Blocks of frames with the name of their bus, in order of receipt."""

log = structlog.get_logger(__name__)


class RecordingFolder:
    """The folder of the extracts.  A file name contains the times of the first and the last frame.

    Args:
        path: the folder; made when the first file is written.
        most_bytes: if all files take more, the oldest are removed with their reports.
        blf_channels: write .blf files in which the buses have these channel numbers; None: write candump logs.
    """

    def __init__(self, path: Path, most_bytes: int, blf_channels: Mapping[str, int] | None = None) -> None:
        self.path, self._most_bytes, self._blf_channels = path, most_bytes, blf_channels

    def add_channels(self, numbers: Mapping[str, int]) -> None:
        """Add channel numbers of new buses; those of former buses stay, as their frames may still be in memory."""
        if self._blf_channels is not None:
            self._blf_channels = {**self._blf_channels, **numbers}

    def files(self) -> list[Path]:
        """All extracts, oldest first."""
        try:
            return sorted(file for file in self.path.iterdir() if _NAME.fullmatch(file.name))
        except FileNotFoundError:
            return []

    def file(self, name: str) -> Path | None:
        """Path of the extract with this name; None: there is none."""
        path = self.path / name
        return path if _NAME.fullmatch(name) and path.is_file() else None

    def report(self, name: str, alarm_id: int) -> Path:
        """Path of the replay report of an extract and an alarm; the report is removed with the extract."""
        return self.path / f"{Path(name).stem}-alarm{alarm_id}.html"

    def holding(self, t_us: int, files: Iterable[Path] | None = None) -> str | None:
        """Name of the oldest extract that covers the time; None: there is none.

        ``files``: those to search; None: all.
        """
        for file in self.files() if files is None else files:
            times = _NAME.fullmatch(file.name)
            if times is not None and _seconds(times[1]) * 1_000_000 <= t_us < (_seconds(times[2]) + 1) * 1_000_000:
                return file.name
        return None

    def write(self, blocks: Frames) -> Path:
        """Write an extract, then remove the oldest extracts if all take too much space.

        Raises:
            RecordError: the file cannot be written; nothing of it stays.
        """
        times = [(int(frames.t_us.min()), int(frames.t_us.max())) for _, frames in blocks]
        first, last = min(t for t, _ in times), max(t for _, t in times)
        kind = "log" if self._blf_channels is None else "blf"
        path = self.path / f"frames-{_stamp(first)}-{_stamp(last)}.{kind}"
        unfinished = self.path / f"unfinished.{kind}"
        try:
            # Do not make the state directory: if it has been moved away, it must be put back.
            self.path.mkdir(exist_ok=True)
            unfinished.unlink(missing_ok=True)
            self._write_frames(unfinished, blocks)
            os.replace(unfinished, path)
        except OSError as error:
            raise RecordError(f"cannot write {path}: {error.strerror}") from None
        except RecordError:
            unfinished.unlink(missing_ok=True)
            raise
        self._remove_oldest()
        return path

    def _write_frames(self, path: Path, blocks: Frames) -> None:
        if self._blf_channels is not None:
            write_blf(path, blocks, self._blf_channels)
            return
        with FrameRecorder(path) as recorder:
            for bus, frames in blocks:
                recorder.write(bus, frames)

    def _remove_oldest(self) -> None:
        files = self.files()
        reports = [list(self.path.glob(f"{file.stem}-alarm*.html")) for file in files]
        sizes = [sum(f.stat().st_size for f in (file, *own)) for file, own in zip(files, reports, strict=True)]
        while len(files) > 1 and sum(sizes) > self._most_bytes:  # the newest file always stays
            for file in (files[0], *reports[0]):
                file.unlink(missing_ok=True)
            log.info("the oldest recording is removed: all of them exceed recordings_mb", file=files[0].name)
            del files[0], reports[0], sizes[0]


def _stamp(t_us: int) -> str:
    return datetime.fromtimestamp(t_us // 1_000_000, UTC).strftime(_FORMAT)


def _seconds(stamp: str) -> int:
    return int(datetime.strptime(stamp, _FORMAT).replace(tzinfo=UTC).timestamp())
