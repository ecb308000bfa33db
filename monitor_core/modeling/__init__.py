"""Converts the drawing of a drive to x' = A(theta) x + B(theta) u, y = C(theta) x (paper, section 2).

    drawing in Python (drawing) or Modelica texts (modelica/), both of components/
      -> flat equations (flat)
      -> elimination/ -> minimal state space, exact, in symbols (statespace)
      -> Drive: the Laurent terms that the kernel takes (numbers)

Structural identifiability of the parameters: identifiability/.  Drives of the library: standard_drives.
Simulation: simulated_axis.
"""

from monitor_core.modeling.components import COMPONENT_KINDS
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.flat import FlatComponent, FlatModel, ModelError, Origin
from monitor_core.modeling.identifiability import structural
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.resonances import Resonances, modes, resonances_of
from monitor_core.modeling.simulated_axis import SimulatedAxis
from monitor_core.modeling.standard_drives import (
    DRAWINGS,
    EXAMPLE_VALUES,
    INTERVAL_S,
    REFERENCE_VALUES,
    five_mass,
    reference_model,
    three_mass,
    two_mass,
)
from monitor_core.modeling.statespace import StateSpace, drive_of, nominal_of
