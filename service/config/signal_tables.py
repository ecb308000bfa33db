"""Auxiliary signals in the text of a configuration: a new one, and the motion of an axis that is left out."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import tomlkit
from tomlkit.items import Array, InlineTable

from service.config.robot_defaults import DEFAULTS, completed

SIGNAL = "signal"
"""Key of the auxiliary signals of an axis"""
_PLACE = ("message", "signal", "column")


def signal_table(robot: Any, axis: Any, name: str) -> Any:
    """An auxiliary signal of an axis, by its name; made where there is none."""
    if SIGNAL not in axis:
        axis[SIGNAL] = tomlkit.array()
        for table in robot.get(DEFAULTS, {}).get(SIGNAL, []):
            axis[SIGNAL].append(_inline(table))  # an axis that has signals of its own does not get those
    own = axis[SIGNAL]
    if all(table["name"] != name for table in own):
        own.append(_inline({"name": name}) if isinstance(own, Array) else tomlkit.item({"name": name}))
    return next(table for table in own if table["name"] == name)


def detach(robot: Any, left_out: Collection[str]) -> None:
    """Let signals that are the motion of an axis which will be left out name the place of that motion themselves."""
    defaults = robot.get(DEFAULTS, {})
    (complete,) = completed({"robot": [robot.unwrap()]})["robot"]
    motions = {
        str(axis["name"]): axis[quantity]
        for axis in complete["axis"]
        for quantity in ("speed", "angle")
        if quantity in axis
    }
    for axis in (*robot["axis"], defaults):
        for table in axis.get(SIGNAL, []):
            if (other := str(table.get("axis", ""))) in left_out and other in motions:
                _place(table, motions[other])


def _place(table: Any, motion: Mapping[str, Any]) -> None:
    """Where the motion is, with its unit: factor * (motion's factor * value + motion's offset) + offset."""
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


def _inline(values: Mapping[str, Any]) -> InlineTable:
    table = tomlkit.inline_table()
    table.update(values)
    return table
