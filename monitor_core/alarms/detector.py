"""What every detector has: a name, and a book of the alarms that are open by what it says."""

from __future__ import annotations

from typing import Literal, Protocol, TypeVar

from monitor_core.alarms.episodes import Episode

DetectorName = Literal["cusum", "bank"]
"""cusum: the paper's two tests of each parameter; bank: hypotheses side by side (monitor_core.detection)."""

E_contra = TypeVar("E_contra", contravariant=True)


class Book(Protocol[E_contra]):
    """The open episodes of one axis: the events of a detector in, alarms raised, named, corrected and ended out."""

    @property
    def open(self) -> tuple[Episode, ...]:
        """The open episodes, the oldest first."""

    def is_open(self, parameter: str) -> bool:
        """Whether a parameter, or another cause, has an open episode."""

    def apply(self, event: E_contra) -> list[Episode]:
        """Take one event; returns the episodes that it raised, changed or ended, as they are now."""
