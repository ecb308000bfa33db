"""``axiswatch commission --minutes``: the buses are looked at, then recorded for some minutes."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import typer
from rich.console import Console

from monitor_core.wording import duration
from service.can.frames import FrameKey
from service.can.log_files import FrameRecorder, span_s
from service.can.user_errors import RecordError
from service.commands.checked_axis import moves
from service.commands.exit_codes import stopped_by_signals
from service.commands.listen import LiveBus, live_buses, rounds
from service.commands.progress import steps_bar
from service.config import Config
from service.ingest.bus_samples import Value
from service.ingest.timestamp_jitter import Stamps

if TYPE_CHECKING:
    from service.commands.live_look import Look

RECORDS = "records"
"""Folder of the records, in that of all that is written"""
LEAST_S, MOST_S = 30.0, 86400.0
"""Of a record: the least that may identify an axis, and a day"""
LOOK_S = 10.0
_SHOW_S, _LINES_S = 1.0, 30.0


def recorded(folder: Path) -> list[Path]:
    """What was recorded into a folder before and is long enough, the oldest first."""
    return sorted(path for path in (folder / RECORDS).glob("*.log") if span_s(path) >= LEAST_S)


def check_minutes(minutes: float) -> None:
    """Check the length of a record.

    Raises:
        typer.BadParameter: it is too short, or too long.
    """
    if not LEAST_S <= 60 * minutes <= MOST_S:
        raise typer.BadParameter(
            f"{minutes:g} minutes: half a minute (0.5) is the least that may identify an axis, a day ({MOST_S / 60:g})"
            " the most; 10 are usual",
            param_hint="--minutes",
        )


def record_live(config: Config, text: str, folder: Path, seconds: float, yes: bool) -> None:
    """Look at the buses, ask whether to go on, and record them.

    Args:
        config: with its buses.
        text: of the same configuration, valid in ``folder``.
        folder: for everything that is written.
        seconds: length of the record.
        yes: go on without asking, if an axis has signals.

    Raises:
        typer.Exit: the user does not want to go on.
        BusError: a bus cannot be opened.
        RecordError: no axis has signals; the record is too short, or cannot be written.
        DbcError, IngestError: the configuration cannot be used.
    """
    from service.commands.live_look import look_at

    console = Console(highlight=False, soft_wrap=True)
    look_s = min(LOOK_S, seconds)
    try:
        (folder / RECORDS).mkdir(exist_ok=True)
    except OSError as error:
        raise RecordError(f"cannot write {folder / RECORDS}: {error.strerror}") from None
    console.print(
        f"Looking at {', '.join(bus.name for bus in config.bus)} for {look_s:g} s ...", markup=False
    )
    with stopped_by_signals() as stop, steps_bar("look") as show:
        look = look_at(config, text, folder, look_s, stop, show)
    for words in _words(look):
        console.print(words, markup=False)
    if stop.is_set():
        raise typer.Exit
    if not any(axis.has_signals for axis in look.axes):
        raise RecordError("nothing is recorded: no axis has its signals on the buses; see above what to do")
    motions = _motions(config, folder)
    if motions:
        console.print(_planned_words(motions, seconds), markup=False)
    work = "The robot should then run what is planned." if motions else "The robot should work as usual."
    question = f"Record {duration(seconds)}? {work}"
    if not yes and sys.stdin.isatty() and not typer.confirm(question, default=True):
        raise typer.Exit
    _record(config, folder / RECORDS, seconds, console)


def _motions(config: Config, folder: Path) -> dict[Path, float]:
    """Planned motions of the axes, with their length [s]."""
    from service.reports.commissioning_report import motion_file

    paths = [folder / motion_file(axis.id) for axis in config.axes]
    return {path: _length_s(path) for path in paths if path.exists()}


def _planned_words(motions: Mapping[Path, float], seconds: float) -> str:
    named = ", ".join(f"{path} ({duration(long_s)})" for path, long_s in motions.items())
    several = len(motions) > 1
    words = f"Planned: {named}. Let the controller run {'them, one after the other,' if several else 'it'} while this"
    short = "" if sum(motions.values()) < seconds else " That takes longer than the recording: see --minutes."
    return f"{words} records.{short}"


def _length_s(motion: Path) -> float:
    """Time in the last row."""
    row = motion.read_text(encoding="utf-8").rstrip().rpartition("\n")[2]
    return float(row.partition(",")[0])


def _words(look: Look) -> Iterator[str]:
    yield from map(_sentence, look.buses)
    for axis in look.axes:
        found = (
            axis.facts,
            *axis.problems,
            *(f"{words}; proposed after the recording" for words in axis.proposals),
        )
        yield from (f"{axis.axis_id}: {_sentence(words)}" for words in found if words)


def _sentence(words: str) -> str:
    return words if words.endswith("?") else f"{words}."


def _record(config: Config, folder: Path, seconds: float, console: Console) -> None:
    path = folder / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}.log"
    console.print(f"Recording {duration(seconds)} into {path}; Ctrl-C ends it early.", markup=False)
    errors, line_s = Console(stderr=True, highlight=False, soft_wrap=True), 0.0
    with stopped_by_signals() as stop, steps_bar("record") as bar:

        def show(words: str, passed_s: float, total_s: float) -> None:
            nonlocal line_s
            left = f"{_clock(total_s - passed_s)} left, {words}"
            bar(left, passed_s, total_s)
            if not errors.is_terminal and passed_s >= line_s:
                line_s += _LINES_S
                errors.print(left, markup=False)

        heard = record_buses(config, path, seconds, stop, show)
    if not heard.frames:
        raise RecordError(
            f"no frame came within {heard.seconds:.0f} s: {_states(heard)}; nothing was recorded"
        )
    lost = "".join(f", {n} {reason} on {bus}" for bus, d in heard.lost.items() for reason, n in d.items())
    down = "".join(f"; bus {bus} is {state}" for bus, state in heard.states.items() if state != "up")
    console.print(f"{path}: {heard.seconds:.0f} s, {heard.frames} frames{lost}{down}", markup=False)
    if (long_s := span_s(path)) < LEAST_S:
        raise RecordError(
            f"{long_s:.0f} s are too short: {LEAST_S:g} s are the least that may identify an axis; {path} is kept and"
            " not used, call again with --minutes"
        )


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def _states(heard: Heard) -> str:
    return ", ".join(f"{bus} is {state}" for bus, state in heard.states.items())


# --- A record of all frames -------------------------------------------------------------------------------------------


class Heard(NamedTuple):
    """What was recorded."""

    seconds: float
    """As long was listened"""
    traffic: Mapping[str, Counter[FrameKey]]
    """Frames by bus and identifier"""
    states: Mapping[str, str]
    """Of the buses at the end, as the reader has them"""
    lost: Mapping[str, Mapping[str, int]]
    """Frames dropped, by bus and reason"""
    stamps: Mapping[str, Stamps]
    """Time stamps of each axis"""

    @property
    def frames(self) -> int:
        """Of all buses."""
        return sum(counts.total() for counts in self.traffic.values())


Show = Callable[[str, float, float], None]
"""Called about once a second with words on the recording, the seconds that have passed and those that are wanted."""


def record_buses(config: Config, path: Path, seconds: float, stop: Event, show: Show) -> Heard:
    """Record everything on the buses, as received, until the time is over or ``stop`` is set.

    All frames, since a signal that is corrected later must be in the record, too.  No file stays where none came.

    Raises:
        BusError: a bus cannot be opened.
        DbcError, IngestError: the configuration cannot be used.
        RecordError: the file cannot be written; what was written is kept.
    """
    traffic = {bus.name: Counter[FrameKey]() for bus in config.bus}
    began = shown = time.monotonic()
    with live_buses(config, everything=True) as buses, FrameRecorder(path) as recorder:
        motions = _Motions(config)
        for block in rounds([bus.reader for bus in buses], seconds, stop):
            for bus, frames in zip(buses, block, strict=True):
                recorder.write(bus.name, frames)
                traffic[bus.name].update(frame.key for frame in frames)
                motions.add(bus.ingest.feed_values(frames))
            now = time.monotonic()
            if now - shown >= _SHOW_S:
                shown = now
                heard = sum(counts.total() for counts in traffic.values())
                words = (
                    f"{heard} frames, {motions.take()} of {len(config.axes)} axes move{_lost_words(buses)}"
                )
                show(words, now - began, seconds)
        states = {bus.name: bus.reader.stats().state for bus in buses}
        lost = {bus.name: bus.lost for bus in buses}
        stamps = {axis_id: axis.stamps for bus in buses for axis_id, axis in bus.ingest.axes.items()}
    found = Heard(min(seconds, time.monotonic() - began), traffic, states, lost, stamps)
    if not found.frames:
        path.unlink(missing_ok=True)
    return found


def _lost_words(buses: Sequence[LiveBus]) -> str:
    counts = sum((Counter(bus.lost) for bus in buses), Counter[str]())
    down = [f"; {bus.name} is {bus.reader.stats().state}" for bus in buses if not bus.reader.stats().up]
    lost = ", ".join(f"{n} {reason}" for reason, n in counts.items())
    return (f"; dropped: {lost}" if lost else "") + "".join(down)


class _Motions:
    """Which axes move, by the motion since it was looked last."""

    def __init__(self, config: Config) -> None:
        self._quantities = {axis.id: axis.config.output for axis in config.axes}
        self._values: dict[str, list[float]] = {}

    def add(self, values: Iterator[Value]) -> None:
        for value in values:
            if value.quantity == self._quantities[value.axis_id]:
                self._values.setdefault(value.axis_id, []).append(value.si)

    def take(self) -> int:
        """How many axes move."""
        found = sum(moves(np.array(values), self._quantities[a]) for a, values in self._values.items())
        self._values.clear()
        return found
