"""Writes the results of commissioning into the user's configuration text; comments stay.

Also connects a configuration for tables to a bus.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit

from monitor_core.drive import split_name
from service.config.loading import load_text
from service.config.schema import REPLACED_BY_NOMINAL_FILE, REPLACED_BY_THRESHOLDS_FILE, Config, NamedAxis
from service.config.schema.robot_defaults import COUPLING, DEFAULTS, completed
from service.config.written.configuration_text import (
    axis_named_in,
    edited_text,
    id_in,
    inline_table_of,
    listed_table,
    merged_inline,
    move_to_axes,
    parsed_configuration,
    table_in_axis,
)
from service.config.written.corrections import NAMED_BY, Correction
from service.config.written.left_out_axes import detach
from service.config.written.named_files import kept_files

_OF_PARAMETERS = {"model": ("scales", "bounds", "limits"), "alarms": ("priorities", "latched", "suppressed")}
"""Keys of an axis, by table, whose entries name monitored parameters."""


class Found(NamedTuple):
    """The results for an axis; file names are relative to the folder of the new configuration."""

    nominal_file: str
    thresholds_file: str | None
    monitor: Sequence[str]


def configured(text: str, axis_id: str | None, folder: Path) -> tuple[Config, NamedAxis]:
    """A configuration from this text, valid in a folder, and the named one of its axes, or the first.

    Raises:
        ConfigErrors: all problems of the text.
    """
    config = load_text(text, folder / f".{axis_id or 'robot'}.toml")
    return config, next(axis for axis in config.axes if axis_id in (None, axis.id))


def relocated(text: str, source: Path, target: Path) -> str:
    """The text of a configuration, moved to another folder: paths are changed, files stay where they are."""
    document = parsed_configuration(text)
    for table, key in kept_files(document):
        table[key] = os.path.relpath(source / str(table[key]), target)
    return tomlkit.dumps(document)


def corrected(text: str, axis_id: str, corrections: Sequence[Correction]) -> str:
    """The text of a configuration with corrected values of an axis ("robot.axis")."""
    document = parsed_configuration(text)
    robot, axis = axis_named_in(document, axis_id)
    for correction in corrections:
        *tables, key = correction.key
        table = axis
        if tables and tables[0] in NAMED_BY:
            table, tables = listed_table(robot, axis, tables[0], tables[1]), tables[2:]
        for name in tables:
            table = table_in_axis(table, name)
        value = correction.value
        table[key] = value if isinstance(value, str | int) else float(f"{value:.10g}")
    return edited_text(document, text)


def uncoupled(text: str, axis_id: str) -> str:
    """The text of a configuration in which the motion of an axis ("robot.axis") is that of the arm, as it is sent."""
    document = parsed_configuration(text)
    _, axis = axis_named_in(document, axis_id)
    axis.pop(COUPLING, None)
    return tomlkit.dumps(document)


def monitoring(text: str, axis_id: str, names: Sequence[str]) -> str:
    """The text of a configuration in which an axis ("robot.axis") monitors these parameters."""
    document = parsed_configuration(text)
    _monitor(*axis_named_in(document, axis_id), names)
    return edited_text(document, text)


def with_drive(text: str, axis_id: str, drive: str, monitor: Sequence[str], values: Mapping[str, float]) -> str:
    """The text of a configuration in which an axis has another drive and monitors these parameters.

    ``values``: the nominal values of the drive; a value that the axis already has takes precedence.
    """
    document = parsed_configuration(text)
    for robot in document["robot"]:
        for key in ("nominal", "scales", "bounds", "limits"):
            move_to_axes(robot, "model", key)  # so that other axes are not changed
    robot, axis = axis_named_in(document, axis_id)
    _monitor(robot, axis, monitor)
    model = table_in_axis(axis, "model")
    model["drive"] = drive
    model["nominal"] = inline_table_of(
        {name: model.get("nominal", {}).get(name, value) for name, value in values.items()}
    )
    for table in ("scales", "bounds", "limits"):
        for name in [name for name in model.get(table, {}) if name not in values]:
            del model[table][name]
    return edited_text(document, text)


def with_results(text: str, axis_id: str, found: Found) -> str:
    """The text of a configuration with the results of one axis ("robot.axis"); the others stay as they are."""
    document = parsed_configuration(text)
    _set_results(document, {axis_id: found})
    return edited_text(document, text)


def commissioned(text: str, found: Mapping[str, Found], heading: Sequence[str] = ()) -> str:
    """The text of a configuration with only the commissioned axes and their results, by "robot.axis".

    ``heading``: lines of comment at the top.
    """
    document = parsed_configuration(text)
    _set_results(document, found)
    for robot in document["robot"]:
        detach(robot, [str(axis["name"]) for axis in robot["axis"] if id_in(robot, axis) not in found])
        for number, axis in reversed(list(enumerate(robot["axis"]))):
            if id_in(robot, axis) not in found:
                del robot["axis"][number]
    for number, robot in reversed(list(enumerate(document["robot"]))):
        if not robot["axis"]:
            del document["robot"][number]
    return "".join(f"# {line}\n" for line in heading) + edited_text(document, text)


def _monitor(robot: Any, axis: Any, names: Sequence[str]) -> None:
    """Let an axis monitor these parameters; remove settings of parameters that it no longer monitors."""
    model = table_in_axis(axis, "model")
    before = model.get("monitor", robot.get(DEFAULTS, {}).get("model", {}).get("monitor", ()))
    if list(before) == list(names):
        return
    model["monitor"] = list(names)
    dropped = _bases(before) - _bases(names)
    for table, keys in _OF_PARAMETERS.items() if dropped else ():
        for key in keys:
            move_to_axes(robot, table, key)
            own = axis.get(table, {}).get(key, {})
            for name in [name for name in own if _bases([name]) <= dropped]:
                if isinstance(own, list):
                    own.remove(name)
                else:
                    del own[name]


def _bases(names: Iterable[str]) -> set[str]:
    """The names of the parameters, without "1/" of reciprocals."""
    return {split_name(name)[0] for name in names}


def _set_results(document: Any, found: Mapping[str, Found]) -> None:
    for robot in document["robot"]:
        for table, keys in (REPLACED_BY_NOMINAL_FILE | REPLACED_BY_THRESHOLDS_FILE).items():
            for key in keys:
                move_to_axes(robot, table, key)
        for axis in robot["axis"]:
            if (name := id_in(robot, axis)) in found:
                _set(robot, axis, found[name])


def _set(robot: Any, axis: Any, found: Found) -> None:
    """Write the results into an axis."""
    _remove(axis, REPLACED_BY_NOMINAL_FILE)
    _monitor(robot, axis, found.monitor)
    model = table_in_axis(axis, "model")
    model["nominal_file"] = found.nominal_file
    model.pop("thresholds_file", None)
    if found.thresholds_file is not None:
        model["thresholds_file"] = found.thresholds_file
        _remove(axis, REPLACED_BY_THRESHOLDS_FILE)


def _remove(axis: Any, keys: Mapping[str, Sequence[str]]) -> None:
    """Remove keys of an axis, given by table, and tables that become empty."""
    for table, names in keys.items():
        own = axis.get(table, {})
        present = [key for key in names if key in own]
        for key in present:
            del own[key]
        if present and not own:
            del axis[table]


# --- A configuration for tables, connected to a bus -------------------------------------------------------------------


_SOURCES = ("torque", "angle", "speed", "time")
"""Tables of an axis that name messages and signals"""


def connected(text: str, other: str, heading: str) -> str:
    """The text of a configuration with the buses and the axes' signals of another text.

    ``heading``: comment at the top.  File names in the other text must be valid in the folder of the first one.

    Raises:
        KeyError: the other text lacks an axis.
    """
    document, source = parsed_configuration(text), parsed_configuration(other)
    complete = completed(source.unwrap())
    signals = {id_in(robot, axis): axis for robot in complete["robot"] for axis in robot["axis"]}
    for robot in document["robot"]:
        for axis in robot["axis"]:
            found = signals[id_in(robot, axis)]
            if len(complete["bus"]) > 1:
                axis["bus"] = found["bus"]
            for table in set(_SOURCES) & set(found):
                axis[table] = merged_inline(axis.get(table, tomlkit.inline_table()), found[table])
    buses = tomlkit.document()
    buses["bus"] = source["bus"]
    return f"# {heading}\n\n{tomlkit.dumps(buses).strip()}\n\n{tomlkit.dumps(document)}"
