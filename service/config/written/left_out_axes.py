"""Auxiliary signals that are motions of axes which a configuration leaves out: they get the source of these motions."""

from collections.abc import Collection, Mapping
from typing import Any

from service.config.schema.robot_defaults import COUPLING, DEFAULTS, completed
from service.config.written.configuration_text import listed_table
from service.config.written.corrections import SIGNAL

_PLACE = ("message", "signal", "column")
"""Keys that say where a signal is"""


def detach(robot: Any, left_out: Collection[str]) -> None:
    """Replace references of auxiliary signals to axes that will be left out by the source of those axes' motions."""
    defaults = robot.get(DEFAULTS, {})
    (complete,) = completed({"robot": [robot.unwrap()]})["robot"]
    motions = {
        str(axis["name"]): axis[quantity]
        for axis in complete["axis"]
        for quantity in ("speed", "angle")
        if quantity in axis
    }
    for axis in (*robot["axis"], defaults):
        for other in [name for name in axis.get(COUPLING, ()) if name in left_out and name in motions]:
            _couple_signal(robot, axis, other)
        for table in axis.get(SIGNAL, []):
            if (other := str(table.get("axis", ""))) in left_out and other in motions:
                _place(table, motions[other])


def _couple_signal(robot: Any, axis: Any, other: str) -> None:
    """Name a signal that is the motion of another axis in the coupling of an axis, in place of that axis."""
    shared = robot.get(DEFAULTS, {}).get(SIGNAL, ())
    taken = {str(table["name"]) for table in axis.get(SIGNAL, shared)}
    name = next(n for n in (other, *(f"{other}-motion{k or ''}" for k in range(len(taken) + 1))) if n not in taken)
    listed_table(robot, axis, SIGNAL, name)["axis"] = other
    coupling = axis[COUPLING]
    factor = coupling.pop(other)
    coupling[name] = factor


def _place(table: Any, motion: Mapping[str, Any]) -> None:
    """Write the source of a motion into a signal.

    The scaling is combined: factor * (motion's factor * value + motion's offset) + offset.
    """
    del table["axis"]
    for key in _PLACE:
        if key in motion and key not in table:
            table[key] = motion[key]
    factor, offset = float(table.get("factor", 1.0)), float(table.get("offset", 0.0))
    own_factor, own_offset = float(motion.get("factor", 1.0)), float(motion.get("offset", 0.0))
    for key, value, usual in (
        ("factor", factor * own_factor, 1.0),
        ("offset", factor * own_offset + offset, 0.0),
    ):
        if value != usual:
            table[key] = value
        elif key in table:
            del table[key]
