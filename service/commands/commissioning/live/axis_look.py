"""Findings from some seconds of the signals of an axis; shown on the terminal and on the page."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import moves
from monitor_core.wording import Sentence, listed, percent, sentence
from service.can.frames import FrameKey
from service.commands.commissioning.signals.signal_proposals import Review
from service.config import NamedAxis
from service.config.schema import SignalConfig
from service.config.unit_names import UNITS
from service.ingest.records.loaded_records import Loaded
from service.ingest.samples.axis_input import AxisInput
from service.ingest.samples.timestamp_jitter import Stamps, remarks

_MAX_MISSING_SHARE = 0.02
"""Share of missing samples above which it is reported"""
_STILL = sentence("move it", "let the robot work, or run a motion that `axiswatch excite` plans")


class ValueRange(NamedTuple):
    """The range of values of a signal."""

    signal: str
    """Message and signal on the bus"""
    unit: str
    low: float
    high: float


class AxisLook(NamedTuple):
    """Findings about an axis."""

    axis: NamedAxis
    loaded: Loaded | None
    """The samples; None: there are none"""
    stamps: Stamps
    problems: tuple[str, ...]
    """Faults that prevent an identification, and their remedies"""
    proposals: tuple[str, ...] = ()
    """Changes of the configuration that the samples suggest"""
    doubts: tuple[str, ...] = ()
    """Open questions about the samples, and how to settle them"""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Changes suggested by the time stamps."""
        return tuple(remarks(self.axis.config.sample_interval_s, self.stamps))

    @property
    def moves(self) -> bool:
        """Whether the axis moves."""
        return self.loaded is not None and moves(self.loaded.record.y, self.axis.config.output)

    @property
    def missing(self) -> float:
        """Share of the samples that were not received."""
        if self.loaded is None:
            return 1.0
        lost = self.loaded.source.dropped.get("missing", 0)
        return lost / (lost + self.loaded.source.samples)

    @property
    def ranges(self) -> tuple[ValueRange, ...]:
        """Ranges of torque and motion; empty without samples."""
        if self.loaded is None:
            return ()
        record, config = self.loaded.record, self.axis.config
        motion = _range(config.motion, UNITS[config.output], record.y[record.measured])
        return _range(config.torque, "N m", record.u), motion


def _range(source: SignalConfig, unit: str, values: Floats) -> ValueRange:
    return ValueRange(f"{source.message}.{source.signal}", unit, float(values.min()), float(values.max()))


def look_at_axis(
    axis: NamedAxis,
    stamps: Stamps,
    loaded: Loaded | str,
    problems: Sequence[str],
    review: Callable[[], Review],
) -> AxisLook:
    """Findings from the samples of an axis.

    ``loaded``: the samples, or the reason why there are none.  ``problems``: faults known before.  ``review``: runs the
    checks of ``commission`` on the samples; not called for an axis at rest.
    """
    if isinstance(loaded, str):
        return AxisLook(axis, None, stamps, tuple(problems) or (_no_samples(loaded),))
    look = AxisLook(axis, loaded, stamps, ())
    still = tuple(_unmoved(look, loaded))
    found = Review((), (), (), "") if still else review()
    return look._replace(
        problems=(*problems, *still, *found.faults, *_lossy(look)),
        proposals=tuple(
            sentence("proposal", "{reason}. -> {change}", reason=c.reason, change=c.change) for c in found.corrections
        ),
        doubts=found.doubts,
    )


def missing_messages(
    axis: NamedAxis, inputs: AxisInput, traffic: Mapping[FrameKey, int], seconds: float
) -> Iterator[Sentence]:
    """Messages that were never received; if there was no frame at all, the bus is named instead."""
    quantities: dict[tuple[FrameKey, str], list[str]] = {}
    for quantity in inputs.quantities:
        quantities.setdefault((quantity.key, quantity.message), []).append(quantity.name)
    for (key, message), names in quantities.items():
        if not traffic.get(key):
            yield sentence(
                "message absent",
                "no {names}: message {message} ({number}) was not received on bus {bus} in {seconds} s; is the axis on,"
                " and is this its message?",
                names=listed(names),
                message=message,
                number=f"0x{key.can_id:x}",
                bus=axis.config.bus,
                seconds=f"{seconds:.0f}",
            )


def _no_samples(reason: str) -> Sentence:
    """Advice for frames that were received but give no samples."""
    words = "its frames make no samples: {reason}; see sample_interval_s, pairing_tolerance_s and the messages"
    return sentence("no samples", words, reason=reason)


def _unmoved(look: AxisLook, loaded: Loaded) -> Iterator[Sentence]:
    """An axis at rest or a stuck signal; the other signal shows which."""
    record, output = loaded.record, look.axis.config.output
    torque, motion = (found.signal for found in look.ranges)
    constant = bool(np.ptp(record.u) == 0)
    if not look.moves and not constant and np.ptp(record.y[record.measured]) == 0:
        yield sentence(
            "motion constant",
            "the {output} is {value} all the time, while the torque changes: {motion} is stuck or another signal is the"
            " {output}; or the axis stands: {still}",
            output=output,
            value=f"{record.y[0]:.4g}",
            motion=motion,
            still=_STILL,
        )
    elif not look.moves:
        yield sentence("axis stands", "it does not move: {still}", still=_STILL)
    elif constant:
        yield sentence(
            "torque constant",
            "the torque is {value} all the time, while the axis moves: {torque} is stuck, or another signal is the"
            " torque",
            value=f"{record.u[0]:.4g}",
            torque=torque,
        )


def _lossy(look: AxisLook) -> Iterator[Sentence]:
    """Frames that were lost on the way to this machine or never sent."""
    if look.missing > _MAX_MISSING_SHARE:
        yield sentence(
            "lossy",
            "{share} of its samples are missing, which spoils an identification: are frames lost on the way, or is what"
            " sends them too busy?",
            share=percent(look.missing),
        )
