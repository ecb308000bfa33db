"""Completes axes with the keys of [robot.defaults], and with keys that follow from others.

This happens before validation, so the rest of the program sees complete axes.  A mistake in the defaults is reported
once, with its line there.
"""

from collections.abc import Container, Mapping
from typing import Any

from service.config.schema.canopen_axis import with_sources
from service.config.toml_lines import Keys

DEFAULTS = "defaults"
COUPLING = "coupling"
"""Key of the coupling of an axis"""
_OWN = ("name", COUPLING)
"""Keys that each axis has for itself"""


def completed(config: Any) -> Any:
    """A raw configuration with complete axes; values of a wrong type are left for the schema to report."""
    if not isinstance(config, dict) or not isinstance(config.get("robot"), list):
        return config
    match config.get("bus"):
        case [{"name": str(name)}]:
            bus: str | None = name
        case _:
            bus = None
    return {**config, "robot": [_completed_robot(robot, bus) for robot in config["robot"]]}


def _completed_robot(robot: Any, bus: str | None) -> Any:
    if not isinstance(robot, dict) or not isinstance(robot.get("axis"), list):
        return robot
    defaults = robot.get(DEFAULTS)
    shared = {key: defaults[key] for key in defaults if key not in _OWN} if isinstance(defaults, dict) else {}
    return {**robot, "axis": [_with_derived(_merged(shared, axis), bus) for axis in robot["axis"]]}


def _merged(shared: Mapping[str, Any], own: Any) -> Any:
    """Merge an axis with the defaults: tables key by key; any other value of the axis replaces the default."""
    if not isinstance(own, dict):
        return own
    complete = dict(shared)
    for key, value in own.items():
        below = complete.get(key)
        complete[key] = _merged(below, value) if isinstance(below, dict) else value
    return complete


def _with_derived(axis: Any, bus: str | None) -> Any:
    """Add keys that follow from others.

    These are the signals of a CANopen drive; the bus, if there is only one; the message of the counter, by default that
    of the motion.
    """
    if isinstance(axis, dict):
        axis = with_sources(axis)
    match axis:
        case {"torque": {"message": _}} if bus is not None and "bus" not in axis:
            axis = {**axis, "bus": bus}
    match axis:
        case {"time": {"counter_signal": _} as time, "angle": {"message": message}} | {
            "time": {"counter_signal": _} as time,
            "speed": {"message": message},
        } if "counter_message" not in time:
            axis = {**axis, "time": {**time, "counter_message": message}}
    return axis


def origin(path: Keys, written: Container[Keys]) -> Keys:
    """The path where the value at a path is written: in the defaults of the robot, or in the axis."""
    match path:
        case ("robot", int(robot), "axis", int(axis), *keys):
            own: Keys = ("robot", robot, "axis", axis)
            shared: Keys = ("robot", robot, DEFAULTS)
            if _depth(shared, keys, written) > _depth(own, keys, written):
                return (*shared, *keys)
    return path


def _depth(table: Keys, keys: list[str | int], written: Container[Keys]) -> int:
    """Number of leading keys that are written below a table."""
    return next((n for n in range(len(keys), 0, -1) if (*table, *keys[:n]) in written), 0)
