"""Where the further signals of an axis come from: a message, a column, or the motion of another axis."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from service.config.schema import AxisConfig


class Source(NamedTuple):
    """A further signal: value = factor * signal + offset."""

    name: str
    message: str | None
    signal: str | None
    column: str | None
    factor: float
    offset: float
    max_age_s: float
    axis: str | None = None
    """The other axis of the robot whose motion it is"""


def sources_of(axis: AxisConfig, robot: Iterable[AxisConfig]) -> Iterator[Source]:
    """The further signals of an axis, those that are the motion of another axis of its robot among them."""
    axes = {other.name: other for other in robot}
    for s in axis.signal:
        if s.axis is None:
            yield Source(s.name, s.message, s.signal, s.column, s.factor, s.offset, s.max_age_s)
            continue
        other = axes[s.axis].motion
        factor, offset = s.factor * other.factor, s.factor * other.offset + s.offset
        column = s.column if s.column is not None else other.column
        # Without a bus a motion has no message.
        message, signal = other.message or None, other.signal or None
        yield Source(s.name, message, signal, column, factor, offset, s.max_age_s, s.axis)
