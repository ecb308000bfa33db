"""``axiswatch listen``: a live table of the decoded signals on the buses."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.markup import escape
from rich.table import Table

from service.commands.command_line.exit_codes import explained
from service.commands.command_line.live_buses import bus_lines, live_buses, rounds
from service.commands.command_line.options import ConfigPath, Seconds, configuration
from service.commands.command_line.signal_handling import stopped_by_signals
from service.config import Config
from service.config.unit_names import UNITS
from service.ingest.samples.bus_samples import Carried, QuantityValues
from service.ingest.samples.timestamp_jitter import Stamps, in_words, remarks
from service.texts.instants import now_us

_LINES_S = 1.0
_OLD_S = 1.0
_COLUMNS = ("axis", "quantity", "value", "signal", "raw value", "rate", "age")
Stamped = Mapping[str, Stamps]


def listen(config: ConfigPath, seconds: Seconds = None) -> None:
    """Show the values on the buses, decoded to SI units by the configuration.

    On a terminal this is a live table; elsewhere one line for each value, once a second.
    """
    read = configuration(config)
    with explained(), ExitStack() as stack:
        stop = stack.enter_context(stopped_by_signals())
        buses = stack.enter_context(live_buses(read, carried=_on_buses(read)))
        console = Console(highlight=False)
        live = None
        if console.is_terminal:
            live = stack.enter_context(Live(console=console, auto_refresh=False, transient=False))
        latest, due = LatestValues(read), time.monotonic() + _LINES_S
        readers = [bus.reader for bus in buses]
        for block in rounds(readers, math.inf if seconds is None else seconds, stop):
            for bus, frames in zip(buses, block, strict=True):
                for values in bus.ingest.feed_values(frames):
                    latest.add(values)
            stamps = {axis_id: axis.stamps for bus in buses for axis_id, axis in bus.ingest.axes.items()}
            words = [*bus_lines(buses), *_remarks(read, stamps)]
            if live is not None:
                live.update(table(latest, now_us(), words, stamps), refresh=True)
            elif time.monotonic() >= due:
                due += _LINES_S
                print(*lines(latest, now_us(), words, stamps), sep="\n", flush=True)


def _on_buses(config: Config) -> Carried:
    """The auxiliary signals of each axis on its bus, including those that its monitoring does not need yet."""
    return {axis.id: [source for source in axis.sources if source.message] for axis in config.axes}


# --- What is shown ----------------------------------------------------------------------------------------------------


def _remarks(config: Config, stamps: Mapping[str, Stamps]) -> list[str]:
    return [
        f"{axis.id}: {words}"
        for axis in config.axes
        if axis.id in stamps
        for words in remarks(axis.config.sample_interval_s, stamps[axis.id])
    ]


@dataclass
class _ReceivedValues:
    values: QuantityValues
    count: int
    first_us: int

    @property
    def last_us(self) -> int:
        return int(self.values.t_us[-1])

    @property
    def rate_hz(self) -> float:
        span_us = self.last_us - self.first_us
        return (self.count - 1) / span_us * 1e6 if span_us > 0 else 0.0


class LatestValues:
    """The latest received value of each quantity of each axis."""

    def __init__(self, config: Config) -> None:
        self._seen: dict[tuple[str, str], _ReceivedValues | None] = {}
        signals = _on_buses(config)
        for axis in config.axes:
            counter = ("counter",) if axis.config.time.counter_signal else ()
            further = (f"signal {source.name}" for source in signals[axis.id])
            for quantity in ("torque", axis.config.output, *counter, *further):
                self._seen[axis.id, quantity] = None

    def add(self, values: QuantityValues) -> None:
        """Store newer values."""
        key, count = (values.axis_id, values.quantity), len(values.t_us)
        seen = self._seen.get(key)
        if seen is None:
            self._seen[key] = _ReceivedValues(values, count, int(values.t_us[0]))
        else:
            seen.values, seen.count = values, seen.count + count

    def rows(self, at_us: int) -> Iterator[tuple[str, ...]]:
        """Rows of the table: axis, quantity, value with unit, signal, raw value, rate, age."""
        for (axis_id, quantity), seen in self._seen.items():
            if seen is None:
                yield (axis_id, quantity, "not received", "", "", "", "")
                continue
            v = seen.values
            age_s = max(0, at_us - seen.last_us) / 1e6
            si = f"{v.si[-1]:.6g} {UNITS.get(quantity, '')}".rstrip()
            signal = f"{v.message}.{v.signal}"
            old = f"{age_s:.1f} s" if age_s >= _OLD_S else "now"
            yield (axis_id, quantity, si, signal, f"{v.physical[-1]:.6g}", f"{seen.rate_hz:.1f} Hz", old)


def table(latest: LatestValues, at_us: int, buses: Sequence[str], stamped: Stamped) -> RenderableType:
    """The table for a terminal."""
    rows = Table(*_COLUMNS)
    for row in latest.rows(at_us):
        rows.add_row(*map(escape, row), style=None if row[-1] == "now" else "yellow")
    for row in _stamp_rows(stamped):
        rows.add_row(*map(escape, row))
    return Group(rows, *map(escape, buses))


def lines(latest: LatestValues, at_us: int, buses: Sequence[str], stamped: Stamped) -> Iterator[str]:
    """Lines for a file or a pipe; tabulators separate the columns."""
    yield from buses
    for row in (*latest.rows(at_us), *_stamp_rows(stamped)):
        yield "\t".join(row)


def _stamp_rows(stamped: Stamped) -> Iterator[tuple[str, ...]]:
    """Scatter of the time stamps of each axis, its clock, and the measured interval."""
    for axis_id, stamps in stamped.items():
        scatter, interval = in_words(stamps)
        yield (axis_id, "stamps", f"scatter {scatter}", stamps.clock, interval, "", "")
