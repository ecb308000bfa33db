"""A configuration for tables, connected to a bus: the signals of its axes as those of another configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import tomlkit

from service.config.robot_defaults import completed

_SOURCES = ("torque", "angle", "speed", "time")
"""Tables of an axis that name messages and signals"""


def connected(text: str, other: str, heading: str) -> str:
    """The text of a configuration with the buses of another text, and for each axis with the signals that it has there.

    ``heading`` stands at the top, as a comment.  Files that the other text names must be valid in the folder of the
    first one.

    Raises:
        KeyError: the other one lacks an axis.
    """
    document, source = tomlkit.parse(text), tomlkit.parse(other)
    complete = completed(source.unwrap())
    signals = {_name(robot, axis): axis for robot in complete["robot"] for axis in robot["axis"]}
    for robot in document["robot"]:
        for axis in robot["axis"]:
            found = signals[_name(robot, axis)]
            if len(complete["bus"]) > 1:
                axis["bus"] = found["bus"]
            for table in set(_SOURCES) & set(found):
                axis[table] = _joined(axis.get(table, tomlkit.inline_table()), found[table])
    buses = tomlkit.document()
    buses["bus"] = source["bus"]
    return f"# {heading}\n\n{tomlkit.dumps(buses).strip()}\n\n{tomlkit.dumps(document)}"


def _joined(own: Any, more: Mapping[str, Any]) -> Any:
    """A table in one line with the entries of both, with the comment of the first."""
    table = tomlkit.inline_table()
    table.update({**own.unwrap(), **more})
    table.trivia.comment_ws, table.trivia.comment = own.trivia.comment_ws, own.trivia.comment
    return table


def _name(robot: Any, axis: Any) -> tuple[str, str]:
    return str(robot["name"]), str(axis["name"])
