"""Converts the flat equations of a drive to its minimal state space, without a manual choice of variables.

    flat equations -> substitution of every variable that one equation determines (substitution.py)
      -> explicit balances of torques (balances.py)
      -> relative angles and speeds as states (minimal.py)
      -> states that no sensor observes are left out (pruning.py)

A sum in a denominator becomes a merged parameter (substitution.py), so that every coefficient is a Laurent sum.
"""

from dataclasses import replace

from monitor_core.drive.structure import Output
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.elimination.balances import balances_of
from monitor_core.modeling.elimination.minimal import Reduction
from monitor_core.modeling.elimination.pruning import hidden, pruned
from monitor_core.modeling.elimination.substitution import EquationSystem
from monitor_core.modeling.flat import FlatModel, ModelError
from monitor_core.modeling.laurent import NotLaurentError
from monitor_core.modeling.statespace import StateSpace


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
    sensors = tuple(replace(s, quantity=output or s.quantity) for s in flat.sensors)
    try:
        system = EquationSystem(flat)
        ss = pruned(Reduction(flat, sensors, system, balances_of(system)), system)
    except NotLaurentError as error:
        raise ModelError(
            "its equations cannot be written with sums of products of parameters, as they need a division by "
            f"{error}; give the flange without inertia an inertia of its own",
            flat.origin,
        ) from None
    return replace(ss, notes=ss.notes + hidden(ss))
