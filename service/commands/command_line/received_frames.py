"""The frames that a command looks at: heard on a bus, or in a CAN log."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from service.can.bus_reader import CanReader
from service.can.frames import FrameBlock, concatenate_frames
from service.can.log_files import CanLog
from service.can.user_errors import RecordError, left_out_words, silent_words
from service.commands.command_line.live_buses import rounds
from service.commands.command_line.signal_handling import stopped_by_signals
from service.config.schema import BusConfig

if TYPE_CHECKING:
    pass


def heard_on(bus: BusConfig, seconds: float) -> FrameBlock:
    """All frames received from a bus in that time; Ctrl-C ends it early.

    Raises:
        BusError: the bus cannot be opened.
        RecordError: no frame was received.
    """
    where = f"{bus.interface} {bus.channel}"
    print(f"Listening to {where} for {seconds:g} s; the robot should move ...", flush=True)
    reader = CanReader(bus, None)
    reader.open()
    try:
        reader.start()
        with stopped_by_signals() as stop:
            frames = concatenate_frames([block for (block,) in rounds([reader], seconds, stop)])
    finally:
        reader.close()
    if not frames:
        raise RecordError(silent_words(where, f"{seconds:g}"))
    return frames


def logged(log: Path) -> Mapping[str, FrameBlock]:
    """The frames of each bus in a CAN log, by the name of its channel.

    Raises:
        RecordError: the log cannot be read.
    """
    found = CanLog(log)
    blocks: dict[str, list[FrameBlock]] = {}
    for block in found.blocks():
        for number, name in enumerate(block.names):
            if part := block.frames.select(block.channels == number):
                blocks.setdefault(name, []).append(part)
    if found.left_out:
        print(left_out_words(log, found.left_out))
    return {name: concatenate_frames(parts) for name, parts in blocks.items()}
