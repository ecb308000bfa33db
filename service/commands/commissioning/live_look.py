"""A first look at the buses before minutes are recorded: which axes have their signals, and what is wrong with them.

What is seen is a short record, looked at by the same checks as a long one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from threading import Event
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.wording import Sentence, listed, percent, sentence
from service.can.frames import FrameKey
from service.can.user_errors import RecordError
from service.commands.commissioning.bus_recording import Heard, Show, record_buses
from service.commands.commissioning.checked_axis import moves
from service.commands.commissioning.signal_proposals import exchanged, review
from service.config import Config, NamedAxis
from service.config.bus_messages import messages_of
from service.config.commissioned import corrected
from service.config.unit_names import UNITS
from service.ingest.axis_input import AxisInput
from service.ingest.bus_samples import Ingest
from service.ingest.loaded_records import Loaded, load
from service.ingest.timestamp_jitter import remarks

LOOK = "look.log"
"""Name of the record of the look"""
_LOSSY = 0.02
"""Of the samples, that are missing"""
_NAMED = 5
"""Identifiers of frames that are listed."""
_STILL = sentence("move it", "let the robot work, or run a motion that `axiswatch excite` plans")


class AxisLook(NamedTuple):
    """What was seen of an axis."""

    axis_id: str
    facts: str
    """Its frames, rate, values, and whether it moves"""
    has_signals: bool
    """Whether torque and motion came"""
    problems: tuple[str, ...]
    """What keeps it from being identified, and what to do"""
    proposals: tuple[str, ...]
    """What the record will show to be wrong in the configuration"""


class Look(NamedTuple):
    """What was seen in all."""

    buses: tuple[str, ...]
    """What is wrong with the buses, and what to do"""
    axes: tuple[AxisLook, ...]


def look_at(
    config: Config, text: str, folder: Path, seconds: float, stop: Event, show: Show = lambda *_: None
) -> Look:
    """Listen for so many seconds, or until ``stop``, and say what there is.

    ``text``: of the configuration, valid in ``folder``, where the record of the look is written.

    Raises:
        BusError: a bus cannot be opened.
        DescriptionError, IngestError: the configuration cannot be used.
        RecordError: the record cannot be written.
    """
    path = folder / LOOK
    path.unlink(missing_ok=True)
    heard = record_buses(config, path, seconds, stop, show)
    loaded, lost = _loaded(config, path) if heard.frames else ({}, {})
    proposals = _proposals(text, folder, str(path), loaded)
    axes = []
    for axis, inputs in _inputs(config):
        known = messages_of(config, axis.config.bus)
        traffic = known.counted(heard.traffic[axis.config.bus])
        missing = tuple(missing_messages(axis, inputs, traffic, heard.seconds))
        found = loaded.get(axis.id)
        facts = "" if found is None else _facts(axis, inputs, found)
        faults, corrections = proposals.get(axis.id, ((), ()))
        problems: tuple[str, ...] = missing or (no_samples(lost.get(axis.id, "")),)
        if found is not None:
            problems = missing or (*(tuple(unmoved(axis, found)) or faults), *lossy(found))
            facts = "; ".join([facts, *remarks(axis.config.sample_interval_s, heard.stamps[axis.id])])
        axes.append(AxisLook(axis.id, facts, found is not None, problems, corrections))
    return Look(tuple(_bus_problems(config, heard)), tuple(axes))


def _inputs(config: Config) -> Iterator[tuple[NamedAxis, AxisInput]]:
    ingests = {bus.name: Ingest(config, bus.name) for bus in config.bus}
    for axis in config.axes:
        yield axis, ingests[axis.config.bus].axes[axis.id]


def _loaded(config: Config, path: Path) -> tuple[dict[str, Loaded], dict[str, str]]:
    """The samples of each axis; and why there are none, of the others."""
    found, lost = dict[str, Loaded](), dict[str, str]()
    for axis in config.axes:
        try:
            found[axis.id] = load(str(path), config, axis.id)
        except RecordError as error:
            lost[axis.id] = str(error)
    return found, lost


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
            yield (
                f"{where} is silent: no frame in {heard.seconds:.0f} s; is the controller on, does it send, and are"
                " cable, termination and bit rate right?"
            )
        elif not any(described.counted(traffic).values()):
            yield (
                f"{where}: {traffic.total()} frames, and none of their messages is in {described.source}:"
                f" {_ids(traffic)}; does that describe this robot, and this bus?"
            )
        for reason, count in lost.items():
            if reason in ("queue_full", "kernel_overflow"):
                yield f"{where}: {count} frames were lost ({reason}): this machine is too busy"


def _ids(keys: Sequence[FrameKey] | Mapping[FrameKey, int]) -> str:
    names = [f"0x{key.can_id:x}" for key in sorted(keys)]
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


# --- An axis ----------------------------------------------------------------------------------------------------------


def missing_messages(
    axis: NamedAxis, inputs: AxisInput, traffic: Mapping[FrameKey, int], seconds: float
) -> Iterator[Sentence]:
    """Messages that never came; where no frame came at all the bus is named instead."""
    quantities: dict[tuple[FrameKey, str], list[str]] = {}
    for quantity in (*inputs.sampled, *(held.quantity for held in inputs.held)):
        quantities.setdefault((quantity.key, quantity.message), []).append(quantity.name)
    for (key, message), names in quantities.items():
        if not traffic.get(key):
            yield sentence(
                "message absent",
                "no {names}: message {message} ({number}) never came on bus {bus} in {seconds} s; is the axis on, and"
                " is this its message?",
                names=listed(names),
                message=message,
                number=f"0x{key.can_id:x}",
                bus=axis.config.bus,
                seconds=f"{seconds:.0f}",
            )


def no_samples(reason: str) -> Sentence:
    """What to do about frames that came and make no samples."""
    words = (
        "its frames make no samples: {reason}; see sample_interval_s, pairing_tolerance_s and the messages"
    )
    return sentence("no samples", words, reason=reason)


def _facts(axis: NamedAxis, inputs: AxisInput, found: Loaded) -> str:
    keys = sorted({inputs.torque.key, inputs.motion.key})
    record, output = found.record, axis.config.output
    moving = "it moves" if moves(record.y, output) else "it does not move"
    return (
        f"{1 / record.mean_interval_s:.4g} samples a second from {_ids(keys)} on {axis.config.bus};"
        f" torque {_range(record.u)} N m, {output} {_range(record.y[record.measured])} {UNITS[output]}; {moving}"
    )


def _range(values: Floats) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"


def unmoved(axis: NamedAxis, found: Loaded) -> Iterator[Sentence]:
    """An axis that stands, or a signal that is stuck: which of them, by the other signal."""
    record, config = found.record, axis.config
    torque, motion = (f"{s.message}.{s.signal}" for s in (config.torque, config.motion))
    stands, constant = not moves(record.y, config.output), bool(np.ptp(record.u) == 0)
    if stands and not constant and np.ptp(record.y[record.measured]) == 0:
        yield sentence(
            "motion constant",
            "the {output} is {value} all the time, while the torque changes: {motion} is stuck or another signal is the"
            " {output}; or the axis stands: {still}",
            output=config.output,
            value=f"{record.y[0]:.4g}",
            motion=motion,
            still=_STILL,
        )
    elif stands:
        yield sentence("axis stands", "it does not move: {still}", still=_STILL)
    elif constant:
        yield sentence(
            "torque constant",
            "the torque is {value} all the time, while the axis moves: {torque} is stuck, or another signal is the"
            " torque",
            value=f"{record.u[0]:.4g}",
            torque=torque,
        )


def lossy(found: Loaded) -> Iterator[Sentence]:
    """Frames that are lost on their way to this machine, or never sent."""
    lost = found.source.dropped.get("missing", 0)
    share = lost / (lost + found.source.samples)
    if share > _LOSSY:
        yield sentence(
            "lossy",
            "{share} of its samples never came, which spoils an identification: are frames lost on the way, or is what"
            " sends them too busy?",
            share=percent(share),
        )


# --- What the checks of a record find ---------------------------------------------------------------------------------


def _proposals(
    text: str, folder: Path, record: str, loaded: Mapping[str, Loaded]
) -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    """Faults, and changes of the configuration that will be proposed, by axis."""
    moving = [axis_id for axis_id, item in loaded.items() if moves(item.record.y, item.record.quantity)]
    others = exchanged(text, dict.fromkeys(moving, (record,)), folder) if moving else {}
    for axis_id, changes in others.items():
        text = corrected(text, axis_id, changes)
    found = {}
    for axis_id in moving:
        looked = review(text, axis_id, [record], folder)
        changes = (*others.get(axis_id, ()), *looked.corrections)
        found[axis_id] = (looked.faults, tuple(f"{c.reason}. -> {c.change}" for c in changes))
    return found
