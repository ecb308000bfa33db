"""What there is to say about a drive, found once for all reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from monitor_core.modeling.statespace import StateSpace

if TYPE_CHECKING:
    from monitor_core.modeling.resonances import Resonances


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
    from monitor_core.modeling.identifiability import structural
    from monitor_core.modeling.numbers import nominal_of
    from monitor_core.modeling.resonances import resonances_of

    nominal = nominal_of(space, values)
    missing = tuple(p.name for p in space.parameters if p.name not in nominal)
    motion = None if missing else resonances_of(space, values)
    return Facts(space, nominal, missing, motion, structural(space).words())
