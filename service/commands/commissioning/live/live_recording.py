"""``axiswatch commission --minutes``: checks the buses, then records them for some minutes."""

import sys
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

import typer
from rich.console import Console

from monitor_core.wording import duration
from service.can.frame_recorder import span_s
from service.can.user_errors import RecordError
from service.commands.command_line.progress import steps_bar
from service.commands.command_line.signal_handling import stopped_by_signals
from service.commands.commissioning.live.axis_look import AxisLook
from service.commands.commissioning.live.bus_recording import record_buses
from service.commands.commissioning.live.live_look import LiveLook, look_at
from service.config import Config
from service.config.written.commissioning_files import RECORDS, motion_file

LEAST_S, MOST_S = 30.0, 86400.0
"""Duration of a record: the shortest that may identify an axis, and a day"""
LOOK_S = 10.0
_LINES_S = 30.0


def recorded(folder: Path) -> list[Path]:
    """Earlier records in a folder that are long enough, the oldest first."""
    return sorted(path for path in (folder / RECORDS).glob("*.log") if span_s(path) >= LEAST_S)


def check_minutes(minutes: float) -> None:
    """Check the requested duration of a record.

    Raises:
        typer.BadParameter: the duration is too short or too long.
    """
    if not LEAST_S <= 60 * minutes <= MOST_S:
        raise typer.BadParameter(
            f"{minutes:g} minutes: half a minute (0.5) is the least for an identification, a day ({MOST_S / 60:g})"
            " the most; 10 are usual",
            param_hint="--minutes",
        )


def record_live(config: Config, text: str, folder: Path, seconds: float, yes: bool) -> None:
    """Check the buses, ask whether to go on, and record them.

    ``text``: the configuration, valid in ``folder``, where everything is written; ``yes``: go on without asking, if
    an axis has signals.

    Raises:
        typer.Exit: the user does not want to go on.
        BusError: a bus cannot be opened.
        RecordError: no axis has signals; the record is too short, or cannot be written.
        DescriptionError, IngestError: the configuration cannot be used.
    """
    console = Console(highlight=False, soft_wrap=True)
    look_s = min(LOOK_S, seconds)
    try:
        (folder / RECORDS).mkdir(exist_ok=True)
    except OSError as error:
        raise RecordError(f"cannot write {folder / RECORDS}: {error.strerror}") from None
    console.print(f"Looking at {', '.join(bus.name for bus in config.bus)} for {look_s:g} s ...", markup=False)
    with stopped_by_signals() as stop, steps_bar("look") as show:
        look = look_at(config, text, folder, look_s, stop, show)
    for words in _words(look):
        console.print(words, markup=False)
    if stop.is_set():
        raise typer.Exit
    if not any(axis.loaded for axis in look.axes):
        raise RecordError("nothing is recorded: no axis has its signals on the buses; see above what to do")
    paths = [folder / motion_file(axis.id) for axis in config.axes]
    motions = {path: _length_s(path) for path in paths if path.exists()}
    if motions:
        console.print(_planned_words(motions, seconds), markup=False)
    work = "The robot should then run what is planned." if motions else "The robot should work as usual."
    question = f"Record {duration(seconds)}? {work}"
    if not yes and sys.stdin.isatty() and not typer.confirm(question, default=True):
        raise typer.Exit
    _record(config, folder / RECORDS, seconds, console)


def _planned_words(motions: Mapping[Path, float], seconds: float) -> str:
    named = ", ".join(f"{path} ({duration(long_s)})" for path, long_s in motions.items())
    several = len(motions) > 1
    words = f"Planned: {named}. Let the controller run {'them, one after the other,' if several else 'it'} while this"
    short = "" if sum(motions.values()) < seconds else " That takes longer than the recording: see --minutes."
    return f"{words} records.{short}"


def _length_s(motion: Path) -> float:
    """Duration of a planned motion: the time in its last row."""
    row = motion.read_text(encoding="utf-8").rstrip().rpartition("\n")[2]
    return float(row.partition(",")[0])


def _words(look: LiveLook) -> Iterator[str]:
    yield from map(_sentence, look.buses)
    for axis in look.axes:
        proposals = (f"{words}; proposed after the recording" for words in axis.proposals)
        for words in (*_facts(axis), *axis.problems, *proposals):
            yield f"{axis.axis.id}: {_sentence(words)}"


def _facts(axis: AxisLook) -> Iterator[str]:
    if axis.loaded is not None:
        rate_hz, bus = 1 / axis.loaded.record.mean_interval_s, axis.axis.config.bus
        ranges = ", ".join(f"{r.signal} {r.low:.3g} to {r.high:.3g} {r.unit}" for r in axis.ranges)
        moving = "it moves" if axis.moves else "it does not move"
        yield "; ".join((f"{rate_hz:.4g} samples a second on {bus}", ranges, moving, *axis.remarks))


def _sentence(words: str) -> str:
    return words if words.endswith("?") else f"{words}."


def _record(config: Config, folder: Path, seconds: float, console: Console) -> None:
    path = folder / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}.log"
    console.print(f"Recording {duration(seconds)} into {path}; Ctrl-C ends it early.", markup=False)
    errors, line_s = Console(stderr=True, highlight=False, soft_wrap=True), 0.0
    with stopped_by_signals() as stop, steps_bar("record") as bar:

        def show(words: str, passed_s: float, total_s: float) -> None:
            nonlocal line_s
            minutes, left_s = divmod(int(total_s - passed_s), 60)
            left = f"{minutes}:{left_s:02d} left, {words}"
            bar(left, passed_s, total_s)
            if not errors.is_terminal and passed_s >= line_s:
                line_s += _LINES_S
                errors.print(left, markup=False)

        heard = record_buses(config, path, seconds, stop, show)
    if not heard.frames:
        states = ", ".join(f"{bus} is {state}" for bus, state in heard.states.items())
        raise RecordError(f"no frame came within {heard.seconds:.0f} s: {states}; nothing was recorded")
    lost = "".join(f", {n} {reason} on {bus}" for bus, d in heard.lost.items() for reason, n in d.items())
    down = "".join(f"; bus {bus} is {state}" for bus, state in heard.states.items() if state != "up")
    console.print(f"{path}: {heard.seconds:.0f} s, {heard.frames} frames{lost}{down}", markup=False)
    if (long_s := span_s(path)) < LEAST_S:
        raise RecordError(
            f"{long_s:.0f} s are too short: {LEAST_S:g} s are the least for an identification; {path} is kept and"
            " not used, call again with --minutes"
        )
