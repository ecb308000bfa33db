"""The drive moving rigidly: what every angle is while the first sensor's angle is 1 and no spring is deflected."""

from __future__ import annotations

from collections.abc import Sequence

from monitor_core.modeling.elimination.minimal import Dense, Reduction
from monitor_core.modeling.elimination.operators import Coefficient
from monitor_core.modeling.elimination.states import Angles


def rigid_angles(reduction: Reduction) -> Angles:
    """Angle -> its value; what is not joined to the sensor by springs or dampers is missing."""
    sensor = reduction.angle_of(reduction.sensors[0].angle)
    if len(sensor) != 1:
        return {}
    ((name, c),) = sensor.items()
    found: Angles = {name: reduction.one / c}
    links = [reduction.angle_of(v.name) for v in reduction.flat.variables if v.relative]
    return _spread(found, [link for link in links if len(link) == 2])


def _spread(found: Angles, links: Sequence[Angles]) -> Angles:
    changed = True
    while changed:
        changed = False
        for link in links:
            for near, far in (tuple(link), tuple(link)[::-1]):
                if near in found and far not in found:
                    found[far] = -(found[near] * link[near] / link[far])
                    changed = True
    return found


def total(angles: Angles, rigid: Angles) -> Coefficient | None:
    """A combination of angles while the drive moves rigidly; None where that is zero or not known."""
    terms = [c * rigid[name] for name, c in angles.items() if name in rigid]
    if len(terms) < len(angles) or not terms:
        return None
    value = sum(terms[1:], start=terms[0])
    return value or None


def rest(reduction: Reduction, rigid: Angles) -> Dense:
    """The state (n, 1) at rest at angle 1, or moving at speed 1, as the first sensor measures it."""
    if reduction.sensors[0].quantity == "speed":
        values = {column: rigid.get(name) for name, column in reduction.columns.items()}
    else:
        rows = enumerate(reduction.positions.rows)
        values = {reduction.position_state(k): total(row, rigid) for k, row in rows}
    return {(state, 0): c for state, c in values.items() if c}


def ratio(reduction: Reduction, rigid: Angles) -> Dense:
    """The angle (m, 1) at the flange of each input that depends on the motion."""
    values = {k: total(reduction.angle_of(u.angle), rigid) for k, u in enumerate(reduction.inputs) if u.angle}
    return {(k, 0): c for k, c in values.items() if c}
