"""A drive drawn in Python: components at named nodes; those at the same node are connected there.

two_mass = Drawing("two-mass", [
    part("torque", "torque", "shaft", kT="kT"),
    part("inertia", "motor", "shaft", J="Jm"),
    part("viscous-friction", "bearing", "shaft", d="fm"),
    part("spring-damper", "belt", "shaft", "load", c="k", d="d"),
    part("inertia", "arm", "load", J="Ja"),
    part("speed-sensor", "encoder", "shaft"),
])
flat = two_mass.flat()
"""

from monitor_core.modeling.drawing.drawn_components import Part, part
from monitor_core.modeling.drawing.netlist import Drawing, from_tables
