"""``axiswatch listen``: what the buses carry, decoded."""

import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Annotated

import typer
from rich.console import Console
from rich.live import Live

from service.can.bus_reader import CanReader
from service.commands.configuration import ConfigPath, configuration
from service.commands.exits import explained
from service.commands.listen_table import Latest, lines, table
from service.commands.stopping import stop_on_signals
from service.config import Config
from service.ingest.bus_samples import Ingest
from service.ingest.timestamp_jitter import Stamps, remarks

_TAKE_S = 0.1

Seconds = Annotated[
    float | None, typer.Option("--seconds", min=0.0, metavar="N", help="End after so long. [default: never]")
]


def listen(config: ConfigPath, seconds: Seconds = None) -> None:
    """Show the values on the buses as the configuration decodes them: is every signal where it should be?

    On a terminal a table that is kept up to date; elsewhere a line for each value, once a second.
    """
    read = configuration(config)
    stop = stop_on_signals()
    with explained(), ExitStack() as stack:
        sources = _open(read, stack)
        end = None if seconds is None else time.monotonic() + seconds
        console = Console(highlight=False)
        if console.is_terminal:
            _show(console, read, sources, stop, end)
        else:
            _print(read, sources, stop, end)


_Sources = list[tuple[CanReader, Ingest]]


def _open(config: Config, stack: ExitStack) -> _Sources:
    sources = []
    for bus in config.bus:
        ingest = Ingest(config, bus.name)
        reader = CanReader(bus, ingest.keys)
        reader.open()
        stack.callback(reader.close)
        sources.append((reader, ingest))
    for reader, _ in sources:
        reader.start()
    return sources


def _show(
    console: Console, config: Config, sources: _Sources, stop: threading.Event, end: float | None
) -> None:
    latest = Latest(config)
    with Live(console=console, auto_refresh=False, transient=False) as live:
        while not _over(stop, end):
            _take(latest, sources)
            stamps = _stamps(sources)
            words = [*_buses(config, sources), *_remarks(config, stamps)]
            live.update(table(latest, _now_us(), words, stamps), refresh=True)


def _print(config: Config, sources: _Sources, stop: threading.Event, end: float | None) -> None:
    latest = Latest(config)
    due = time.monotonic() + 1
    while not _over(stop, end):
        _take(latest, sources)
        if time.monotonic() >= due:
            due += 1
            stamps = _stamps(sources)
            words = [*_buses(config, sources), *_remarks(config, stamps)]
            print(*lines(latest, _now_us(), words, stamps), sep="\n", flush=True)


def _take(latest: Latest, sources: _Sources) -> None:
    for reader, ingest in sources:
        for value in ingest.feed_values(reader.take()):
            latest.add(value)


def _buses(config: Config, sources: _Sources) -> list[str]:
    """The state of each bus and what was dropped, in words."""
    words = []
    for bus, (reader, ingest) in zip(config.bus, sources, strict=True):
        stats = reader.stats()
        dropped = {reason: n for reason, n in {**stats.dropped, **ingest.dropped}.items() if n}
        lost = "".join(f", {n} {reason}" for reason, n in dropped.items())
        words.append(f"{bus.name}: {stats.state}, {stats.frames} frames{lost}")
    return words


def _stamps(sources: _Sources) -> dict[str, Stamps]:
    return {axis_id: ingest.axis_stamps(axis_id) for _, ingest in sources for axis_id in ingest.axis_ids}


def _remarks(config: Config, stamps: Mapping[str, Stamps]) -> list[str]:
    """What the time stamps say about the configuration."""
    return [
        words
        for axis in config.axes
        if axis.id in stamps
        for words in remarks(axis.id, axis.config.sample_interval_s, stamps[axis.id])
    ]


def _over(stop: threading.Event, end: float | None) -> bool:
    """Wait a little; whether it is time to end."""
    return stop.wait(_TAKE_S) or (end is not None and time.monotonic() >= end)


def _now_us() -> int:
    return time.time_ns() // 1000
