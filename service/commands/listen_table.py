"""The newest value of each quantity, as a table and as lines."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table

from service.config import Config, needed
from service.ingest.bus_samples import Value
from service.ingest.timestamp_jitter import Stamps, in_words

_UNITS = {"torque": "N m", "angle": "rad", "speed": "rad/s", "counter": ""}
_OLD_S = 1.0


@dataclass
class _Seen:
    value: Value
    count: int = 1
    first_us: int = 0

    @property
    def rate_hz(self) -> float:
        span_us = self.value.t_us - self.first_us
        return (self.count - 1) / span_us * 1e6 if span_us > 0 else 0.0


class Latest:
    """The newest value of each quantity of each axis, or that there was none."""

    def __init__(self, config: Config) -> None:
        self._seen: dict[tuple[str, str], _Seen | None] = {}
        for axis in config.axes:
            counter = ("counter",) if axis.config.time.counter_signal else ()
            further = (f"signal {source.name}" for source in needed(axis))
            beside = ("speed",) if axis.config.both else ()
            for quantity in ("torque", axis.config.output, *beside, *counter, *further):
                self._seen[axis.id, quantity] = None

    def add(self, value: Value) -> None:
        """Take a newer value."""
        key = (value.axis_id, value.quantity)
        seen = self._seen.get(key)
        if seen is None:
            self._seen[key] = _Seen(value, 1, value.t_us)
        else:
            seen.value, seen.count = value, seen.count + 1

    def rows(self, now_us: int) -> Iterator[tuple[str, ...]]:
        """axis, quantity, value with unit, signal, value of the signal, rate, age."""
        for (axis_id, quantity), seen in self._seen.items():
            if seen is None:
                yield (axis_id, quantity, "nothing yet", "", "", "", "")
                continue
            v = seen.value
            age_s = max(0, now_us - v.t_us) / 1e6
            si = f"{v.si:.6g} {_UNITS.get(quantity, '')}".rstrip()
            signal = f"{v.message}.{v.signal}"
            old = f"{age_s:.1f} s" if age_s >= _OLD_S else "now"
            yield (axis_id, quantity, si, signal, f"{v.physical:.6g}", f"{seen.rate_hz:.1f} Hz", old)


_COLUMNS = ("axis", "quantity", "value", "signal", "as sent", "rate", "age")


Stamped = Mapping[str, Stamps]


def table(latest: Latest, now_us: int, buses: Sequence[str], stamped: Stamped) -> RenderableType:
    """For a terminal."""
    found = Table(*_COLUMNS)
    for row in latest.rows(now_us):
        found.add_row(*map(escape, row), style=None if row[-1] == "now" else "yellow")
    for row in _stamp_rows(stamped):
        found.add_row(*map(escape, row))
    return Group(found, *map(escape, buses))


def lines(latest: Latest, now_us: int, buses: Sequence[str], stamped: Stamped) -> Iterator[str]:
    """For a file or a pipe: columns set apart by tabulators."""
    yield from buses
    for row in (*latest.rows(now_us), *_stamp_rows(stamped)):
        yield "\t".join(row)


def _stamp_rows(stamped: Stamped) -> Iterator[tuple[str, ...]]:
    """How far the time stamps of each axis scatter, by which clock, and the interval by it."""
    for axis_id, stamps in stamped.items():
        scatter, interval = in_words(stamps)
        yield (axis_id, "stamps", f"scatter {scatter}", stamps.clock, interval, "", "")
