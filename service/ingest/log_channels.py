"""Which channel of a log is which bus of the configuration."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from service.config.schema import BusConfig

_LAST_NUMBER = re.compile(r"\d+$")


class LogChannels:
    """The bus of each channel in a log, at whose beginning these were ``seen``.

    A channel is the bus of that channel or that name.  Formats that number channels do not know names: there channel 0
    is can0, or whichever bus has a channel that ends with its number, as python-can writes such files.  Where a log
    begins with one channel only, which no bus has, and there is one bus, that is it: a log of another plant.
    """

    def __init__(self, buses: Sequence[BusConfig], seen: Sequence[str]) -> None:
        self._known = {bus.channel: bus.name for bus in buses} | {bus.name: bus.name for bus in buses}
        numbers = [_number(bus.channel) for bus in buses]
        self._numbered = {
            number: bus.name for bus, number in zip(buses, numbers, strict=True) if numbers.count(number) == 1
        }
        if len(buses) == 1 and len(seen) == 1 and self.bus(seen[0]) is None:
            self._known[seen[0]] = buses[0].name

    def bus(self, channel: str) -> str | None:
        """Name of the bus; None: the configuration has none for it."""
        if channel in self._known:
            return self._known[channel]
        return self._numbered.get(int(channel)) if channel.isdecimal() else None


def _number(channel: str) -> int | None:
    found = _LAST_NUMBER.search(channel)
    return None if found is None else int(found[0])


def no_bus_words(path: Path, buses: Sequence[BusConfig], frames: Mapping[str, int]) -> str:
    """Why none of the frames, of which there are so many by channel, is used, and what would be right."""
    found = ", ".join(f"{channel} ({count} frames)" for channel, count in frames.items())
    known = ", ".join(f'name = "{bus.name}", channel = "{bus.channel}"' for bus in buses)
    return (
        f"{path}: none of its channels is a bus of the configuration: it has {found}, [[bus]] has {known};"
        f' give the bus that was recorded the channel of the log, channel = "{next(iter(frames))}"'
    )
