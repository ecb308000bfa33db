"""Writes the results of commissioning into the user's configuration text; comments stay.

Also connects a configuration for tables to a bus.
"""

import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit
from tomlkit import TOMLDocument
from tomlkit.items import Array, InlineTable, Table

from monitor_core.drive import split_name
from service.config.base_table import SUFFIX
from service.config.corrections import NAMED_BY, SIGNAL, Correction
from service.config.loading import load_text
from service.config.robot_defaults import COUPLING, DEFAULTS, completed
from service.config.schema import Config, NamedAxis
from service.config.schema_links import LINK_FILES
from service.config.schema_model import REPLACED_BY_NOMINAL_FILE, REPLACED_BY_THRESHOLDS_FILE

_OF_PARAMETERS = {"model": ("scales", "bounds", "limits"), "alarms": ("priorities", "latched", "suppressed")}
"""Keys of an axis, by table, whose entries name monitored parameters."""
_PLACE = ("message", "signal", "column")
REPORT = "report.html"
"""Name of the summary of a commissioned robot, beside its configuration"""


def pages_of(axis_id: str) -> tuple[str, str]:
    """File names of the identification report and the calibration report of an axis, beside the summary."""
    return f"{axis_id}-identification.html", f"{axis_id}-calibration.html"


RECORDS, MOTIONS = "records", "motion"
"""Folders of recorded frames and of planned motions, beside the report"""


def motion_file(axis_id: str) -> str:
    """File name of the planned motion of an axis."""
    return f"{MOTIONS}/{axis_id}.csv"


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
    document = _parsed(text)
    for table, key in kept_files(document):
        table[key] = os.path.relpath(source / str(table[key]), target)
    return tomlkit.dumps(document)


def corrected(text: str, axis_id: str, corrections: Sequence[Correction]) -> str:
    """The text of a configuration with corrected values of an axis ("robot.axis")."""
    document = _parsed(text)
    robot, axis = _axis(document, axis_id)
    for correction in corrections:
        *tables, key = correction.key
        table = axis
        if tables and tables[0] in NAMED_BY:
            table, tables = _listed_table(robot, axis, tables[0], tables[1]), tables[2:]
        for name in tables:
            table = _table(table, name)
        value = correction.value
        table[key] = value if isinstance(value, str | int) else float(f"{value:.10g}")
    return _written(document, text)


def uncoupled(text: str, axis_id: str) -> str:
    """The text of a configuration in which the motion of an axis ("robot.axis") is that of the arm, as it is sent."""
    document = _parsed(text)
    _, axis = _axis(document, axis_id)
    axis.pop(COUPLING, None)
    return tomlkit.dumps(document)


def monitoring(text: str, axis_id: str, names: Sequence[str]) -> str:
    """The text of a configuration in which an axis ("robot.axis") monitors these parameters."""
    document = _parsed(text)
    _monitor(*_axis(document, axis_id), names)
    return _written(document, text)


def with_drive(text: str, axis_id: str, drive: str, monitor: Sequence[str], values: Mapping[str, float]) -> str:
    """The text of a configuration in which an axis has another drive and monitors these parameters.

    ``values``: the nominal values of the drive; a value that the axis already has takes precedence.
    """
    document = _parsed(text)
    for robot in document["robot"]:
        for key in ("nominal", "scales", "bounds", "limits"):
            _give_to_axes(robot, "model", key)  # so that other axes are not changed
    robot, axis = _axis(document, axis_id)
    _monitor(robot, axis, monitor)
    model = _table(axis, "model")
    model["drive"] = drive
    model["nominal"] = _inline({name: model.get("nominal", {}).get(name, value) for name, value in values.items()})
    for table in ("scales", "bounds", "limits"):
        for name in [name for name in model.get(table, {}) if name not in values]:
            del model[table][name]
    return _written(document, text)


def commissioned(text: str, found: Mapping[str, Found], heading: Sequence[str] = ()) -> str:
    """The text of a configuration with only the commissioned axes and their results, by "robot.axis".

    ``heading``: lines of comment at the top.
    """
    document = _parsed(text)
    for robot in document["robot"]:
        for table, keys in (REPLACED_BY_NOMINAL_FILE | REPLACED_BY_THRESHOLDS_FILE).items():
            for key in keys:
                _give_to_axes(robot, table, key)
        for axis in robot["axis"]:
            if (name := _id(robot, axis)) in found:
                _set(robot, axis, found[name])
    for robot in document["robot"]:
        _detach(robot, [str(axis["name"]) for axis in robot["axis"] if _id(robot, axis) not in found])
        for number, axis in reversed(list(enumerate(robot["axis"]))):
            if _id(robot, axis) not in found:
                del robot["axis"][number]
    for number, robot in reversed(list(enumerate(document["robot"]))):
        if not robot["axis"]:
            del document["robot"][number]
    return "".join(f"# {line}\n" for line in heading) + _written(document, text)


def _parsed(text: str) -> TOMLDocument:
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


def _written(document: TOMLDocument, before: str) -> str:
    """The text of a document that was made from ``before``.

    Inline tables of axes and defaults that were changed are spaced evenly: tomlkit leaves gaps in them.
    """
    kept = {table.as_string() for _, _, table in _inline_tables(tomlkit.parse(before))}
    for parent, key, table in list(_inline_tables(document)):
        if table.as_string() not in kept:
            parent[key] = _joined(table, {})
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
                found.append(key.key, _inline(values[key.key]))
        elif key.key not in found:  # a table may go on what dotted keys began
            found.append(key, _undotted(item) if _has_dotted(item) else item)
    return found


def _axis(document: TOMLDocument, axis_id: str) -> tuple[Any, Any]:
    """The robot and the axis with this name ("robot.axis")."""
    return next((robot, axis) for robot in document["robot"] for axis in robot["axis"] if _id(robot, axis) == axis_id)


def _id(robot: Any, axis: Any) -> str:
    return f"{robot['name']}.{axis['name']}"


def _table(parent: Any, name: str) -> Any:
    """A table of an axis; if the axis does not have it, it is added as an inline table."""
    if name not in parent:
        parent[name] = tomlkit.inline_table()
    return parent[name]


def _give_to_axes(robot: Any, table: str, key: str) -> None:
    """Move a key of [robot.defaults] into the axes, so that it can differ between axes."""
    defaults = robot.get(DEFAULTS, {}).get(table, {})
    if key not in defaults:
        return
    value = defaults.pop(key).unwrap()
    if not defaults:
        del robot[DEFAULTS][table]
    for axis in robot["axis"]:
        own = _table(axis, table)
        own[key] = {**value, **own.get(key, {})} if isinstance(value, dict) else own.get(key, value)


def _monitor(robot: Any, axis: Any, names: Sequence[str]) -> None:
    """Let an axis monitor these parameters; remove settings of parameters that it no longer monitors."""
    model = _table(axis, "model")
    before = model.get("monitor", robot.get(DEFAULTS, {}).get("model", {}).get("monitor", ()))
    if list(before) == list(names):
        return
    model["monitor"] = list(names)
    dropped = _bases(before) - _bases(names)
    for table, keys in _OF_PARAMETERS.items() if dropped else ():
        for key in keys:
            _give_to_axes(robot, table, key)
            own = axis.get(table, {}).get(key, {})
            for name in [name for name in own if _bases([name]) <= dropped]:
                if isinstance(own, list):
                    own.remove(name)
                else:
                    del own[name]


def _bases(names: Iterable[str]) -> set[str]:
    """The names of the parameters, without "1/" of reciprocals."""
    return {split_name(name)[0] for name in names}


def _set(robot: Any, axis: Any, found: Found) -> None:
    """Write the results into an axis."""
    _remove(axis, REPLACED_BY_NOMINAL_FILE)
    _monitor(robot, axis, found.monitor)
    model = _table(axis, "model")
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


def kept_files(document: TOMLDocument) -> Iterator[tuple[Any, str]]:
    """Table and key of each file name in a configuration that commissioning does not replace."""
    for bus in document.get("bus", ()):
        if "messages" in bus:
            yield bus, "messages"
    web = document.get("web", {})
    yield from ((web, key) for key in ("certificate", "key") if key in web)
    links = document.get("links", {})
    for link in (*links.get("webhook", ()), *(links.get(name, {}) for name in ("mqtt", "smtp", "opcua"))):
        yield from ((link, key) for key in LINK_FILES if key in link)
    for robot in document["robot"]:
        for axis in (*robot["axis"], robot.get(DEFAULTS, {})):
            if "eds" in axis.get("canopen", {}):
                yield axis["canopen"], "eds"
            model = axis.get("model", {})
            if str(model.get("drive", "")).endswith(SUFFIX):
                yield model, "drive"


# --- Auxiliary signals: adding one, and replacing a reference to an axis that is left out -----------------------------


def _listed_table(robot: Any, axis: Any, key: str, name: str) -> Any:
    """The auxiliary signal of an axis with this name, or the gate on this signal; it is added if it does not exist."""
    if key not in axis:
        axis[key] = tomlkit.array()
        for table in robot.get(DEFAULTS, {}).get(key, []):
            axis[key].append(_inline(table))  # an axis with own ones does not get those of the defaults
    own, by = axis[key], NAMED_BY[key]
    if all(table[by] != name for table in own):
        own.append(_inline({by: name}) if isinstance(own, Array) else tomlkit.item({by: name}))
    return next(table for table in own if table[by] == name)


def _detach(robot: Any, left_out: Collection[str]) -> None:
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
    _listed_table(robot, axis, SIGNAL, name)["axis"] = other
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


def _inline(values: Mapping[str, Any]) -> InlineTable:
    table = tomlkit.inline_table()
    table.update(values)
    return table


# --- A configuration for tables, connected to a bus -------------------------------------------------------------------


_SOURCES = ("torque", "angle", "speed", "time")
"""Tables of an axis that name messages and signals"""


def connected(text: str, other: str, heading: str) -> str:
    """The text of a configuration with the buses and the axes' signals of another text.

    ``heading``: comment at the top.  File names in the other text must be valid in the folder of the first one.

    Raises:
        KeyError: the other text lacks an axis.
    """
    document, source = _parsed(text), _parsed(other)
    complete = completed(source.unwrap())
    signals = {_id(robot, axis): axis for robot in complete["robot"] for axis in robot["axis"]}
    for robot in document["robot"]:
        for axis in robot["axis"]:
            found = signals[_id(robot, axis)]
            if len(complete["bus"]) > 1:
                axis["bus"] = found["bus"]
            for table in set(_SOURCES) & set(found):
                axis[table] = _joined(axis.get(table, tomlkit.inline_table()), found[table])
    buses = tomlkit.document()
    buses["bus"] = source["bus"]
    return f"# {heading}\n\n{tomlkit.dumps(buses).strip()}\n\n{tomlkit.dumps(document)}"


def _joined(own: Any, more: Mapping[str, Any]) -> Any:
    """An inline table with the entries of both, and the comment of the first."""
    table = tomlkit.inline_table()
    for key, item in own.items():
        evenly = _joined(item, {}) if isinstance(item, InlineTable) else item
        table.append(key, more.get(key, evenly))
    table.update({key: value for key, value in more.items() if key not in own})
    table.trivia.comment_ws, table.trivia.comment = own.trivia.comment_ws, own.trivia.comment
    return table
