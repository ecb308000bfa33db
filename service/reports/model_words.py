"""Words for what goes into a drive and comes out, the same in all reports."""

from __future__ import annotations

from types import MappingProxyType

from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE, TORQUE
from monitor_core.modeling.flat import FlatInput, FlatSensor

INPUT_KINDS = MappingProxyType(
    {TORQUE: "torque", COULOMB: "direction", ONE: "one", COSINE: "cosine", SINE: "sine"}
)
"""Kinds of input by name."""

OUTPUT_UNITS = MappingProxyType({"speed": "rad/s", "angle": "rad"})

_INPUTS = MappingProxyType(
    {
        TORQUE: "motor torque, N m",
        COULOMB: "direction of motion, tanh(speed/scale)",
        ONE: "constant 1",
        COSINE: "cosine of the angle",
        SINE: "sine of the angle",
    }
)


def input_words(given: FlatInput) -> str:
    """``torque.tau: motor torque, N m``."""
    words = _INPUTS[given.kind]
    return words if given.kind == ONE else f"{given.name}: {words}"


def output_words(sensor: FlatSensor) -> str:
    """``encoder: speed, rad/s``."""
    return f"{sensor.name}: {sensor.quantity}, {OUTPUT_UNITS[sensor.quantity]}"
