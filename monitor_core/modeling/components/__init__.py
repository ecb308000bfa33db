"""The kinds of components, their physics and units, and how flanges connect: shared by drawings and Modelica texts."""

from monitor_core.modeling.components.component_kinds import COMPONENT_KINDS, fragment
from monitor_core.modeling.components.fragments import Fragment, join
