"""A first check of the buses before the long recording: which axes have their signals, and what is wrong with them.

The frames form a short record, and the same checks are applied as to a long one.
"""

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from threading import Event
from typing import NamedTuple

from monitor_core.identification import moves
from monitor_core.wording import first_of
from service.can.frames import FrameKey
from service.can.user_errors import RecordError, silent_words, undescribed_words
from service.commands.commissioning.live.axis_look import AxisLook, look_at_axis, missing_messages
from service.commands.commissioning.live.bus_recording import Heard, Show, record_buses
from service.commands.commissioning.signals.exchanged_torques import exchanged
from service.commands.commissioning.signals.signal_proposals import Review, review
from service.config import Config
from service.config.bus_messages import messages_of
from service.config.written.commissioned import corrected
from service.ingest.records.loaded_records import Loaded, load
from service.ingest.samples.bus_samples import Ingest

RECORD_NAME = "look.log"
"""Name of the record of this check"""
_MAX_NAMED = 5
"""Most identifiers of frames that are listed"""


class LiveLook(NamedTuple):
    """Findings about all buses and axes."""

    buses: tuple[str, ...]
    """Faults of the buses, and their remedies"""
    axes: tuple[AxisLook, ...]


def look_at(config: Config, text: str, folder: Path, seconds: float, stop: Event, show: Show) -> LiveLook:
    """Listen for this time, or until ``stop``, and report what was received.

    ``text``: the configuration, valid in ``folder``, where the short record is written.

    Raises:
        BusError: a bus cannot be opened.
        DescriptionError, IngestError: the configuration cannot be used.
        RecordError: the record cannot be written.
    """
    path = folder / RECORD_NAME
    path.unlink(missing_ok=True)
    heard = record_buses(config, path, seconds, stop, show)
    loaded = {axis.id: _loaded(config, axis.id, path, heard) for axis in config.axes}
    reviews = _reviews(text, folder, str(path), loaded)
    ingests = {bus.name: Ingest(config, bus.name) for bus in config.bus}
    axes = []
    for axis in config.axes:
        inputs = ingests[axis.config.bus].axes[axis.id]
        traffic = messages_of(config, axis.config.bus).counted(heard.traffic[axis.config.bus])
        missing = tuple(missing_messages(axis, inputs, traffic, heard.seconds))
        made = partial(reviews.__getitem__, axis.id)
        axes.append(look_at_axis(axis, heard.stamps[axis.id], loaded[axis.id], missing, made))
    return LiveLook(tuple(_bus_problems(config, heard)), tuple(axes))


def _loaded(config: Config, axis_id: str, path: Path, heard: Heard) -> Loaded | str:
    """The samples of an axis, or the reason why there are none."""
    try:
        return load(str(path), config, axis_id) if heard.frames else ""
    except RecordError as error:
        return str(error)


# --- The buses --------------------------------------------------------------------------------------------------------


def _bus_problems(config: Config, heard: Heard) -> Iterator[str]:
    for bus in config.bus:
        traffic, state, lost = heard.traffic[bus.name], heard.states[bus.name], heard.lost[bus.name]
        where = f"bus {bus.name} ({bus.interface} {bus.channel})"
        described = messages_of(config, bus.name)
        if state != "up":
            yield f"{where} is {state}"
        elif errors := lost.get("error_frame", 0):
            yield f"{where}: {errors} error frames: the bit rate is wrong, or a cable or its termination is bad"
        elif not traffic:
            yield silent_words(where, f"{heard.seconds:.0f}")
        elif not any(described.counted(traffic).values()):
            yield undescribed_words(f"{where}: {traffic.total()} frames", described.source, _ids(traffic))
        for reason, count in lost.items():
            if reason in ("queue_full", "kernel_overflow"):
                yield f"{where}: {count} frames were lost ({reason}): this machine is too busy"


def _ids(keys: Iterable[FrameKey]) -> str:
    return first_of([f"0x{key.can_id:x}" for key in sorted(keys)], _MAX_NAMED)


# --- What the checks of a record find ---------------------------------------------------------------------------------


def _reviews(text: str, folder: Path, record: str, loaded: Mapping[str, Loaded | str]) -> dict[str, Review]:
    """Faults of the signals of each axis that moves."""
    samples = {axis_id: item.record for axis_id, item in loaded.items() if isinstance(item, Loaded)}
    moving = [axis_id for axis_id, found in samples.items() if moves(found.y, found.quantity)]
    others = exchanged(text, dict.fromkeys(moving, (record,)), folder) if moving else {}
    for axis_id, changes in others.items():
        text = corrected(text, axis_id, changes)
    reviews = {axis_id: review(text, axis_id, [record], folder) for axis_id in moving}
    return {
        axis_id: found._replace(corrections=(*others.get(axis_id, ()), *found.corrections))
        for axis_id, found in reviews.items()
    }
