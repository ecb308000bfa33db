"""Types of ingest: frames as received, their identifiers, and samples of one axis."""

from typing import NamedTuple


class FrameKey(NamedTuple):
    """Identifies the messages of a bus."""

    can_id: int
    extended: bool


class Frame(NamedTuple):
    """A CAN frame as received.  Time in whole microseconds since 1970, rounded once, here."""

    t_us: int
    can_id: int
    extended: bool
    data: bytes

    @property
    def key(self) -> FrameKey:
        """The messages that it belongs to."""
        return FrameKey(self.can_id, self.extended)


class Sample(NamedTuple):
    """Torque and motion of one axis at one time, SI units on the motor side."""

    t_us: int
    torque: float  # N m
    motion: float  # rad or rad/s
    signals: tuple[float, ...] = ()  # auxiliary ones, as last received; NaN: unknown
