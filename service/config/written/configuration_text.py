"""Editing the text of a configuration with tomlkit, which keeps comments: axes, their tables, inline tables."""

from collections.abc import Iterator, Mapping
from typing import Any

import tomlkit
from tomlkit import TOMLDocument
from tomlkit.items import Array, InlineTable, Table

from service.config.schema.robot_defaults import DEFAULTS
from service.config.written.corrections import NAMED_BY


def parsed_configuration(text: str) -> TOMLDocument:
    """The document, in which axes and their defaults have tables instead of dotted keys (``model.nominal.kT = 1``).

    tomlkit loses such keys when others are added to them.
    """
    document = tomlkit.parse(text)
    for robot in document["robot"]:
        axes = robot["axis"]
        for number, axis in enumerate(axes):
            if _has_dotted(axis):
                axes[number] = _undotted(axis)
        if DEFAULTS in robot and _has_dotted(robot[DEFAULTS]):
            robot[DEFAULTS] = _undotted(robot[DEFAULTS])
    return document


def edited_text(document: TOMLDocument, before: str) -> str:
    """The text of a document that was made from ``before``.

    Inline tables of axes and defaults that were changed are spaced evenly: tomlkit leaves gaps in them.
    """
    kept = {table.as_string() for _, _, table in _inline_tables(tomlkit.parse(before))}
    for parent, key, table in list(_inline_tables(document)):
        if table.as_string() not in kept:
            parent[key] = merged_inline(table, {})
    return tomlkit.dumps(document)


def _inline_tables(document: TOMLDocument) -> Iterator[tuple[Any, str, InlineTable]]:
    """Where each inline table of an axis or of the defaults is, its key, and the table."""
    for robot in document["robot"]:
        for parent in (robot.get(DEFAULTS, {}), *robot["axis"]):
            yield from ((parent, key, table) for key, table in parent.items() if isinstance(table, InlineTable))


def _has_dotted(table: Any) -> bool:
    if not isinstance(table, Table):
        return False
    return any(key is not None and (key.is_dotted() or _has_dotted(item)) for key, item in table.value.body)


def _undotted(table: Any) -> Table:
    """The table with an inline table for each name that begins dotted keys; comments of those keys are lost."""
    found, values = tomlkit.table(), table.unwrap()
    for key, item in table.value.body:
        if key is None:
            found.add(item)
        elif key.is_dotted():
            if key.key not in found:
                found.append(key.key, inline_table_of(values[key.key]))
        elif key.key not in found:  # a table may go on what dotted keys began
            found.append(key, _undotted(item) if _has_dotted(item) else item)
    return found


def axis_named_in(document: TOMLDocument, axis_id: str) -> tuple[Any, Any]:
    """The robot and the axis with this name ("robot.axis")."""
    return next((robot, axis) for robot in document["robot"] for axis in robot["axis"] if id_in(robot, axis) == axis_id)


def id_in(robot: Any, axis: Any) -> str:
    """The name of an axis with that of its robot ("robot.axis")."""
    return f"{robot['name']}.{axis['name']}"


def table_in_axis(parent: Any, name: str) -> Any:
    """A table of an axis; if the axis does not have it, it is added as an inline table."""
    if name not in parent:
        parent[name] = tomlkit.inline_table()
    return parent[name]


def move_to_axes(robot: Any, table: str, key: str) -> None:
    """Move a key of [robot.defaults] into the axes, so that it can differ between axes."""
    defaults = robot.get(DEFAULTS, {}).get(table, {})
    if key not in defaults:
        return
    value = defaults.pop(key).unwrap()
    if not defaults:
        del robot[DEFAULTS][table]
    for axis in robot["axis"]:
        own = table_in_axis(axis, table)
        own[key] = {**value, **own.get(key, {})} if isinstance(value, dict) else own.get(key, value)


def listed_table(robot: Any, axis: Any, key: str, name: str) -> Any:
    """The auxiliary signal of an axis with this name, or the gate on this signal; it is added if it does not exist."""
    if key not in axis:
        axis[key] = tomlkit.array()
        for table in robot.get(DEFAULTS, {}).get(key, []):
            axis[key].append(inline_table_of(table))  # an axis with own ones does not get those of the defaults
    own, by = axis[key], NAMED_BY[key]
    if all(table[by] != name for table in own):
        own.append(inline_table_of({by: name}) if isinstance(own, Array) else tomlkit.item({by: name}))
    return next(table for table in own if table[by] == name)


def inline_table_of(values: Mapping[str, Any]) -> InlineTable:
    """An inline table with these values."""
    table = tomlkit.inline_table()
    table.update(values)
    return table


def merged_inline(own: Any, more: Mapping[str, Any]) -> Any:
    """An inline table with the entries of both, and the comment of the first."""
    table = tomlkit.inline_table()
    for key, item in own.items():
        evenly = merged_inline(item, {}) if isinstance(item, InlineTable) else item
        table.append(key, more.get(key, evenly))
    table.update({key: value for key, value in more.items() if key not in own})
    table.trivia.comment_ws, table.trivia.comment = own.trivia.comment_ws, own.trivia.comment
    return table
