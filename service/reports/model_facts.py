"""What there is to say about a drive, found once for all reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from monitor_core.modeling.statespace import StateSpace

if TYPE_CHECKING:
    from monitor_core.modeling.resonances import Resonances

_MOST_STATES = 100
"""Beyond that it takes minutes to find what can be identified."""


@dataclass(frozen=True, slots=True)
class Facts:
    """A drive, the ``nominal`` values that are known, and what follows.

    ``missing``: parameters without a nominal value; with any of them there is no ``motion``.
    ``motion``: poles [1/s], resonances and anti-resonances from the torque to the first output.
    ``identifiability``: sentences.
    """

    space: StateSpace
    nominal: Mapping[str, float]
    missing: tuple[str, ...]
    motion: Resonances | None
    identifiability: tuple[str, ...]


def facts_of(space: StateSpace, values: Mapping[str, float] | None = None) -> Facts:
    """All of it.  ``values``: nominal values that go before the drawing's own."""
    from monitor_core.modeling.numbers import nominal_of
    from monitor_core.modeling.resonances import resonances_of

    nominal = nominal_of(space, values)
    missing = tuple(p.name for p in space.parameters if p.name not in nominal)
    motion = None if missing else resonances_of(space, values)
    return Facts(space, nominal, missing, motion, _identifiability(space))


def _identifiability(space: StateSpace) -> tuple[str, ...]:
    if len(space.states) > _MOST_STATES:
        return (f"Not examined: the drive has more than {_MOST_STATES} states.",)
    from monitor_core.modeling.identifiability import structural

    return structural(space).words()
