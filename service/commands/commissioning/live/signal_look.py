"""Checks the signals of one axis while the daemon runs: its last frames, with the checks of ``commission``.

It uses the frames that the daemon keeps for recordings, so that it costs nothing until it is requested.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import TimeoutError as NotGivenError
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from monitor_core.wording import replaced, sentence
from service.can.frame_recorder import FrameRecorder
from service.can.frames import FrameBlock, concatenate_frames
from service.can.messages import MessageSet
from service.can.user_errors import RecordError
from service.config import Config, NamedAxis
from service.pipeline.persistence.recording import Extracts
from service.pipeline.persistence.recording_folder import Frames
from service.web.models import sentence_bodies
from service.web.robot_setup import NoLookError, SignalCheck, SignalRange
from service.web.routes.recording_routes import NO_FRAMES_KEPT

if TYPE_CHECKING:
    from service.commands.commissioning.live.axis_look import AxisLook
    from service.ingest.records.loaded_records import Loaded
    from service.ingest.samples.axis_input import AxisInput

LOOK_S = 10.0
_WAIT_S = 10.0
"""Time to wait for the frames, which the worker hands over between two blocks, and for another check in progress"""
_OLD_S = 5.0
_NOTHING = sentence(
    "no frames yet",
    "no frame has been taken from any bus yet: they are silent, or the daemon is still starting",
)


class SignalLook:
    """Checks the signals of an axis, one check at a time.

    ``config`` returns the configuration in force; ``extracts`` keep the last frames; None: no frames are kept.
    """

    def __init__(self, config: Callable[[], Config], extracts: Extracts | None, now_us: Callable[[], int]) -> None:
        self._config, self._extracts, self._now_us = config, extracts, now_us
        self._lock = threading.Lock()

    def __call__(self, axis_id: str) -> SignalCheck:
        """Findings from the last frames of an axis.

        Raises:
            NoLookError: no frames are kept, or the worker does not hand them over.
        """
        if self._extracts is None:
            raise NoLookError(NO_FRAMES_KEPT)
        config = self._config()
        axis = next((axis for axis in config.axes if axis.id == axis_id), None)
        if axis is None:
            words = "the configuration has no axis {axis} any more"
            raise NoLookError(sentence("axis gone", words, axis=axis_id))
        if not self._lock.acquire(timeout=_WAIT_S):
            raise NoLookError(sentence("look busy", "another check is in progress; try again"))
        try:
            kept = self._extracts.latest(LOOK_S).result(_WAIT_S)
            return _checked(config, axis, kept, self._now_us())
        except NotGivenError:
            words = "the worker has not handed over frames within {wait_s} s"
            raise NoLookError(sentence("frames late", words, wait_s=f"{_WAIT_S:.0f}")) from None
        except RecordError as error:
            raise NoLookError(str(error)) from None
        finally:
            self._lock.release()


def _checked(config: Config, axis: NamedAxis, kept: Frames, now_us: int) -> SignalCheck:
    from service.commands.commissioning.live.axis_look import look_at_axis, missing_messages
    from service.commands.commissioning.signals.signal_proposals import Review, first_review
    from service.config.conditions import needed
    from service.ingest.samples.bus_samples import Ingest

    ingest = Ingest(config, axis.config.bus, {axis.id: needed(axis)})
    inputs, known = ingest.axes[axis.id], ingest.decoder.known
    own = _own(concatenate_frames([frames for bus, frames in kept if bus == axis.config.bus]), inputs, known)
    problems: list[str] = [_NOTHING]
    if kept:  # the daemon may have begun a moment ago
        times = [int(t_us) for _, frames in kept for t_us in (frames.t_us.min(), frames.t_us.max())]
        span_s = (max(times) - min(times)) / 1e6
        problems = [*missing_messages(axis, inputs, known.counted(own.counts()), span_s)]
    for _ in ingest.feed_values(own):
        pass
    if own and (age_s := (now_us - int(own.t_us.max())) / 1e6) > _OLD_S:
        words = "nothing has come for {age_s} s: the findings are older than that"
        problems.insert(0, sentence("frames old", words, age_s=f"{age_s:.0f}"))
    with TemporaryDirectory(prefix="axiswatch-look-") as folder:
        path = Path(folder) / "look.log"

        def review() -> Review:
            found = first_review(config, axis, str(path))
            # The name of the temporary file means nothing to the reader.
            faults = (replaced(words, str(path), "the last seconds") for words in found.faults)
            return found._replace(faults=tuple(faults))

        return _signal_check(look_at_axis(axis, inputs.stamps, _loaded(config, axis, own, path), problems, review))


def _own(frames: FrameBlock, inputs: AxisInput, known: MessageSet) -> FrameBlock:
    """The frames that carry signals of the axis."""
    keys = {q.key for q in inputs.quantities}
    wanted = [number for number in np.unique(frames.ids) if any(known.carries(key, number) for key in keys)]
    return frames.select(np.isin(frames.ids, wanted))


def _loaded(config: Config, axis: NamedAxis, own: FrameBlock, path: Path) -> Loaded | str:
    """The samples of the axis, or the reason why there are none."""
    from service.ingest.records.loaded_records import load

    try:
        with FrameRecorder(path) as recorder:
            recorder.write(axis.config.bus, own)
        return load(str(path), config, axis.id)
    except RecordError as error:
        return str(error).replace(str(path), "the last seconds")


def _signal_check(look: AxisLook) -> SignalCheck:
    """The findings in the form of the API, for the page."""
    record = None if look.loaded is None else look.loaded.record
    proposals = () if record is None else (*look.remarks, *look.proposals)
    return SignalCheck(
        axis=look.axis.id,
        seconds=0.0 if record is None else record.duration_s,
        samples=0 if record is None else len(record),
        rate_hz=None if record is None else 1 / record.mean_interval_s,
        scatter_s=None if record is None else look.stamps.scatter_s,
        missing=None if record is None else look.missing,
        moves=None if record is None else look.moves,
        signals=[SignalRange(**found._asdict()) for found in look.ranges],
        problems=list(look.problems),
        proposals=list(proposals),
        doubts=list(look.doubts),
        sentences=sentence_bodies([*look.problems, *proposals, *look.doubts]),
    )
