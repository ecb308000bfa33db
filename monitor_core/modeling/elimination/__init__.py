"""From the flat equations of a drive to its minimal state space, without a manual choice of variables.

    flat equations -> substitution of every variable that one equation determines (substitution.py)
      -> explicit balances of torques (balances.py)
      -> relative angles and speeds as states (minimal.py)
      -> states that no sensor observes are left out (pruning.py)

Laurent sums suffice for every drive with one inertia at each node.  A sum in a denominator becomes a merged parameter
(balances.py, for inertias), or everything is repeated with rational functions (rational.py).
"""

from __future__ import annotations

from dataclasses import replace

from monitor_core.drive.structure import Output
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.elimination.balances import balances_of
from monitor_core.modeling.elimination.minimal import Reduction
from monitor_core.modeling.elimination.pruning import hidden, pruned
from monitor_core.modeling.elimination.rational import Field
from monitor_core.modeling.elimination.substitution import System
from monitor_core.modeling.flat import FlatModel, FlatSensor, ModelError
from monitor_core.modeling.laurent import NotLaurentError
from monitor_core.modeling.statespace import StateSpace

__all__ = ["eliminate"]

MOST_RATIONAL = 120
"""Parameters of a drive that needs rational functions: beyond, sympy would take minutes."""
MOST_RATIONAL_EQUATIONS = 900
"""Flat equations, the same: some sixty masses."""


def eliminate(flat: FlatModel, output: Output | None = None) -> StateSpace:
    """The minimal state space of a drive; ``output`` replaces the drawn quantity of its sensors.

    Raises:
        ModelError: the drive has no torque, no sensor, no path between them, is locked, or its equations cannot be
            solved; the text names the component.
    """
    if not any(u.kind == TORQUE for u in flat.inputs):
        raise ModelError("no motor torque acts on the drive: draw a torque source", flat.origin)
    if not flat.sensors:
        raise ModelError("nothing is measured: draw a speed sensor or an angle sensor", flat.origin)
    try:
        ss = _reduced(flat, output, None)
    except NotLaurentError:
        ss = _with_rational_functions(flat, output)
    return replace(ss, notes=ss.notes + hidden(ss))


def _reduced(flat: FlatModel, output: Output | None, field: Field | None) -> StateSpace:
    system = System(flat, (lambda c: c) if field is None else field.element)
    balances = balances_of(system)
    sensors = tuple(FlatSensor(s.name, s.angle, output or s.quantity, s.origin) for s in flat.sensors)
    return pruned(Reduction(flat, sensors, system, balances), system, field)


def _with_rational_functions(flat: FlatModel, output: Output | None) -> StateSpace:
    parameters, equations = len(flat.parameters), len(flat.equations)
    if parameters > MOST_RATIONAL or equations > MOST_RATIONAL_EQUATIONS:
        raise ModelError(
            f"flanges without inertia between springs or dampers, {parameters} parameters and {equations} equations: "
            f"that is solved for up to {MOST_RATIONAL} and {MOST_RATIONAL_EQUATIONS}; give each such flange an "
            "inertia, or leave parts out",
            flat.origin,
        )
    try:
        return _reduced(flat, output, Field(p.name for p in flat.parameters))
    except NotLaurentError as error:
        raise ModelError(
            f"its equations cannot be written with sums of products of parameters: {error} would have to be divided "
            "by; give the flange without inertia an inertia of its own",
            flat.origin,
        ) from None
