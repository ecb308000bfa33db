"""Numbers that no motor has ever had."""

from collections.abc import Mapping

LIMITS: Mapping[str, float] = {"torque": 1e6, "speed": 1e5, "angle": 1e8}
"""N m, rad/s and rad: more comes from a broken frame or file.  A million newton metres is a ship's propeller;
1e5 rad/s is a million revolutions per minute, and 1e8 rad a day of them."""
