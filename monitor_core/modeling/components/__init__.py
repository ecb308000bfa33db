"""The kinds of components, their physics and units, and how flanges connect: shared by drawings and Modelica texts."""

from monitor_core.modeling.components.fragments import Fragment, join
from monitor_core.modeling.components.kinds import KINDS, Kind, Role, fragment

__all__ = ["KINDS", "Fragment", "Kind", "Role", "fragment", "join"]
