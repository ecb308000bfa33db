"""A drive as numbers: parameters, units, bounds; A, B, C as data; stability, Kalman gain.

* ``structure``: the drive, its parameters, states and terms; ``parameter_names``: 1/Ja, and slopes.
  ``axis_model``: one axis with its nominal values.
* ``operating_conditions``: nominal values that depend on signals.  ``gates``: when nothing is estimated.
  ``holding_brake``: an axis that its brake holds.  ``thermal_state``: warm-up without a thermometer.
  ``friction_roles``: the parameters that are friction.  ``measured_speed``: speed at the sensor.
* ``assembly``: arrays for the kernel.  ``discretization``: zero-order hold.  ``kalman``: filter gain and stability.
"""

from monitor_core.drive.axis_model import AxisModel, NominalValueError
from monitor_core.drive.friction_roles import friction_of
from monitor_core.drive.gates import Gate, OpenGates
from monitor_core.drive.operating_conditions import MARGIN, Conditions, NominalSchedule, Operating
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.signal_terms import FUNCTIONS, Term
from monitor_core.drive.structure import DELAY, LOAD, OUTPUT_UNITS, Drive, Output, Parameter
from monitor_core.drive.thermal_state import HEAT, TEMPERATURE, Fast, ThermalModel, ThermalStart, Unwatched
from monitor_core.kernel.tables import COSINE, COULOMB, OF_ANGLE, ONE, SINE, TORQUE
