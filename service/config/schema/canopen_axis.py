"""[robot.axis.canopen]: an axis with a CANopen drive (CiA 402); derives the signals and units of torque and motion.

Message, signal and factor of torque and motion follow from a few values of the data sheet.  They are written into the
axis before it is validated, so the rest of the program sees an ordinary axis.
"""

import math
import sys
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from service.can.canopen_drives import LAST_NODE, node_name, object_name
from service.config.schema.base_table import FilePath, Positive, TomlTable

POSITION, VELOCITY, TORQUE, CURRENT = 0x6064, 0x606C, 0x6077, 0x6078
_DEVICE_STEP: Final = 0x800
"""Index step between the objects of two logical devices of a node"""
_THOUSANDTH: Final = 1e-3
_RPM: Final = 2 * math.pi / 60


class CanopenConfig(TomlTable):
    """[robot.axis.canopen]: its drive speaks CANopen (CiA 402); in place of message and signal of torque and motion."""

    eds: FilePath
    """EDS or DCF of the drive, with its transmit PDOs as they are configured, relative to this file"""
    node_id: Annotated[int, Field(strict=True)] = Field(ge=1, le=LAST_NODE)
    """node id of the drive"""
    device: Annotated[int, Field(strict=True)] = Field(1, ge=1, le=8)
    """number of the axis in a drive of several axes: the second has its objects at 0x6800"""
    rated_torque_Nm: Positive | None = None
    """rated torque of the motor, of which object 0x6077 is thousandths [N m]"""
    rated_current_A: Positive | None = None
    """rated current of the motor, of which object 0x6078 is thousandths [A]; with torque.kT_Nm_per_A"""
    torque_sign: Literal[1, -1] = 1
    """-1: a positive torque (or current) decreases the position"""
    motion: Literal["angle", "speed"] = "angle"
    """motion that is used: "angle", object 0x6064, or "speed", object 0x606C"""
    counts_per_turn: Positive | None = None
    """counts of the position in one turn of the shaft that it is measured on"""
    speed_unit: Literal["counts/s", "rpm"] | None = None
    """unit of object 0x606C"""
    side: Literal["motor", "arm"] = "motor"
    """shaft that position and velocity are measured on: "motor", or "arm", behind the gear"""
    motor_turns: Positive | None = None
    """with side = "arm": turns of the motor for one turn of the arm, 118 of a gear 118:1"""


def with_sources(axis: dict[str, Any]) -> dict[str, Any]:
    """A raw axis with the torque, motion and auxiliary signals of its drive; keys of the axis take precedence."""
    match axis:
        case {"canopen": {"node_id": int(node)} as drive}:
            pass
        case _:
            return axis
    name, motion = node_name(node), "speed" if drive.get("motion") == "speed" else "angle"
    found = {
        **axis,
        "torque": _under({"message": name, **_torque(drive)}, axis.get("torque", {})),
        motion: _under({"message": name, **_motion(drive, motion)}, axis.get(motion, {})),
    }
    if isinstance(axis.get("signal"), list):
        found["signal"] = [_placed(name, signal) for signal in axis["signal"]]
    return found


def _under(derived: dict[str, Any], own: Any) -> Any:
    return {**derived, **own} if isinstance(own, dict) else own


def _placed(name: str, signal: Any) -> Any:
    """Add the node to an auxiliary signal that names only an object."""
    match signal:
        case {"signal": _} if not {"message", "axis"} & signal.keys():
            return {**signal, "message": name}
    return signal


def _torque(drive: Mapping[str, Any]) -> dict[str, Any]:
    current = "rated_current_A" in drive
    rated = _number(drive, "rated_current_A" if current else "rated_torque_Nm")
    sign = -1.0 if drive.get("torque_sign") == -1 else 1.0
    return {"signal": _object(drive, CURRENT if current else TORQUE), "factor": sign * _THOUSANDTH * rated}


def _motion(drive: Mapping[str, Any], motion: str) -> dict[str, Any]:
    turns = _number(drive, "motor_turns") if drive.get("side") == "arm" else 1.0
    count = 2 * math.pi / _number(drive, "counts_per_turn")
    if motion == "speed":
        unit = _RPM if drive.get("speed_unit") == "rpm" else count
        return {"signal": _object(drive, VELOCITY), "factor": turns * unit}
    return {"signal": _object(drive, POSITION), "factor": turns * count, "resolution": 1.0}


def _object(drive: Mapping[str, Any], index: int) -> str:
    match drive.get("device", 1):
        case int(device) if 1 <= device <= 8:
            return object_name(index + _DEVICE_STEP * (device - 1))
    return object_name(index)


def _number(drive: Mapping[str, Any], key: str) -> float:
    """A number; 1 if it is missing or wrong, which a check reports."""
    value = drive.get(key)
    return float(value) if isinstance(value, int | float) and 0 < value <= sys.float_info.max else 1.0
