"""The drives that a configuration may name."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from monitor_core.library import three_mass
from monitor_core.model import Drive, Output

DRIVES: Mapping[str, Callable[[Output], Drive]] = MappingProxyType({"three-mass": three_mass})
"""By name: a function from the measured quantity to the drive."""
