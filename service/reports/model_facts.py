"""What there is to say about a drive, found once for all reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.statespace import StateSpace

if TYPE_CHECKING:
    from monitor_core.excitation.local_identifiability import Experiment, Local
    from monitor_core.modeling.resonances import Resonances

_MOST_STATES = 100
"""Beyond that it takes minutes to find what can be identified."""
_MOST_MERGED = 60
"""Parameters that stand only inside of merged ones; each of them takes a further pass."""
_MOST_LOCAL = 40
"""Beyond that it takes long to find what a record tells."""


@dataclass(frozen=True, slots=True)
class Facts:
    """A drive, the ``nominal`` values that are known, and what follows.

    ``missing``: parameters without a nominal value; with any of them there is no ``motion``.
    ``motion``: poles [1/s], resonances and anti-resonances from the torque to the first output.
    ``identifiability``: sentences.  ``local``: what a record tells of the parameters, if one torque and one sensor
    and all nominal values are there; ``untold``: why the record could not be simulated.
    """

    space: StateSpace
    nominal: Mapping[str, float]
    missing: tuple[str, ...]
    motion: Resonances | None
    identifiability: tuple[str, ...]
    local: Local | None = None
    untold: str = ""


def facts_of(
    space: StateSpace,
    values: Mapping[str, float] | None = None,
    experiment: Experiment | None = None,
    speed_scale: float = 1.0,
) -> Facts:
    """All of it.

    Args:
        space: the drive.
        values: nominal values that go before the drawing's own.
        experiment: what torque the parameters are to be told from; by default a multisine.
        speed_scale: of Coulomb friction [rad/s].
    """
    from monitor_core.modeling.numbers import nominal_of
    from monitor_core.modeling.resonances import resonances_of

    nominal = nominal_of(space, values)
    missing = tuple(p.name for p in space.parameters if p.name not in nominal)
    motion = None if missing else resonances_of(space, values)
    found, untold = (None, "") if missing else _local(space, values, experiment, speed_scale)
    return Facts(space, nominal, missing, motion, _identifiability(space), found, untold)


def _local(
    space: StateSpace, values: Mapping[str, float] | None, experiment: Experiment | None, speed_scale: float
) -> tuple[Local | None, str]:
    from monitor_core.excitation.local_identifiability import local, usual_experiment

    torques = sum(u.kind == TORQUE for u in space.inputs)
    if _not_examined(space) or len(space.states) > _MOST_LOCAL or torques != 1 or len(space.sensors) != 1:
        return None, ""
    try:
        return local(space, values, experiment or usual_experiment(), speed_scale), ""
    except ValueError as error:
        return None, f"not known: {error}"


def _identifiability(space: StateSpace) -> tuple[str, ...]:
    if why := _not_examined(space):
        return (f"Not examined: {why}.",)
    from monitor_core.modeling.identifiability import structural

    return structural(space).words()


def _not_examined(space: StateSpace) -> str:
    """Why it would take too long; empty if it does not."""
    if len(space.states) > _MOST_STATES:
        return f"the drive has more than {_MOST_STATES} states"
    merged = {name for definition in space.definitions for name in definition.value.names}
    if len(merged) > _MOST_MERGED:
        return f"more than {_MOST_MERGED} parameters are merged into others"
    return ""
