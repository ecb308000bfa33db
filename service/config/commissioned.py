"""A configuration with what commissioning found: the user's own text, comments included, with new values in it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit
from tomlkit import TOMLDocument

from service.config.base_table import SUFFIX
from service.config.robot_defaults import DEFAULTS
from service.config.schema_links import LINK_FILES
from service.config.signal_tables import SIGNAL, detach, signal_table

_IN_NOMINAL_FILE = {
    "model": ("nominal", "friction_speed_scale"),
    "estimator": ("predictor", "torque_noise", "output_noise", "innovation_variance", "initial_p"),
}
"""Keys of an axis by table that a nominal_file replaces."""
_IN_THRESHOLDS_FILE = ("alpha_1", "alpha_2")
"""Keys of its detector that a thresholds_file replaces."""
_REPLACED = {**_IN_NOMINAL_FILE, "detector": _IN_THRESHOLDS_FILE}


REPORT = "report.html"
"""Name of the summary of a commissioned robot, beside its configuration"""


def pages_of(axis_id: str) -> tuple[str, str]:
    """Names of the pages of an axis beside the summary: of its identification and of its calibration."""
    return f"{axis_id}-identification.html", f"{axis_id}-calibration.html"


RECORDS, MOTIONS = "records", "motion"
"""Folders of what was recorded on the buses, and of planned motions, beside the report"""


def motion_file(axis_id: str) -> str:
    """Name of the planned motion of an axis."""
    return f"{MOTIONS}/{axis_id}.csv"


class Correction(NamedTuple):
    """A key of an axis that was wrong: ("torque", "factor"), or ("sample_interval_s",); and why.

    ("signal", "axis2", "axis") is that key of its auxiliary signal of the name axis2, which need not be there before.
    """

    key: tuple[str, ...]
    value: float | str | bool
    reason: str

    @property
    def change(self) -> str:
        """As in the configuration."""
        if isinstance(self.value, bool):
            value = str(self.value).lower()
        else:
            value = f'"{self.value}"' if isinstance(self.value, str) else f"{self.value:.6g}"
        return f"{'.'.join(self.key)} = {value}"

    def __str__(self) -> str:
        return f"{self.change}: {self.reason}"


class Found(NamedTuple):
    """What was found for an axis; files are named relative to the folder of the new configuration."""

    nominal_file: str
    thresholds_file: str | None
    monitor: Sequence[str]


def relocated(text: str, source: Path, target: Path) -> str:
    """The text of a configuration for another folder: files that it names stay where they are."""
    document = tomlkit.parse(text)
    for table, key in kept_files(document):
        table[key] = os.path.relpath(source / str(table[key]), target)
    return tomlkit.dumps(document)


def corrected(text: str, axis_id: str, corrections: Sequence[Correction]) -> str:
    """The text of a configuration with other values of an axis, "robot.axis"."""
    document = tomlkit.parse(text)
    robot, axis = next((r, axis) for r in document["robot"] for axis in r["axis"] if _id(r, axis) == axis_id)
    for correction in corrections:
        *tables, key = correction.key
        table = axis
        if tables[:1] == [SIGNAL]:
            table, tables = signal_table(robot, axis, tables[1]), tables[2:]
        for name in tables:
            table = _table(table, name)
        value = correction.value
        table[key] = value if isinstance(value, str | bool) else float(f"{value:.10g}")
    return tomlkit.dumps(document)


def monitoring(text: str, axis_id: str, names: Sequence[str]) -> str:
    """The text of a configuration in which an axis, "robot.axis", monitors these parameters."""
    document = tomlkit.parse(text)
    axis = next(axis for name, axis in _axes(document) if name == axis_id)
    _table(axis, "model")["monitor"] = list(names)
    return tomlkit.dumps(document)


def with_drive(
    text: str, axis_id: str, drive: str, monitor: Sequence[str], values: Mapping[str, float]
) -> str:
    """The text of a configuration in which an axis has another drive and monitors these parameters.

    Of its values only those named in ``values`` stay, else they are these.
    """
    document = tomlkit.parse(text)
    for robot in document["robot"]:
        for key in ("nominal", "scales", "bounds", "limits"):
            _give_to_axes(robot, "model", key)  # those of the other axes stay as they are
    model = _table(next(axis for name, axis in _axes(document) if name == axis_id), "model")
    model["drive"], model["monitor"] = drive, list(monitor)
    model["nominal"] = {name: model.get("nominal", {}).get(name, value) for name, value in values.items()}
    for table in ("scales", "bounds", "limits"):
        for name in [name for name in model.get(table, {}) if name not in values]:
            del model[table][name]
    return tomlkit.dumps(document)


def commissioned(text: str, found: Mapping[str, Found], heading: Sequence[str] = ()) -> str:
    """The text of a configuration with the axes that were commissioned, by their names "robot.axis", and no others.

    ``heading``: lines of comment at the top.
    """
    document = tomlkit.parse(text)
    for robot in document["robot"]:
        for table, keys in _REPLACED.items():
            for key in keys:
                _give_to_axes(robot, table, key)
        shared = robot.get(DEFAULTS, {}).get("model", {}).get("monitor")
        for axis in robot["axis"]:
            if (name := _id(robot, axis)) in found:
                _set(axis, found[name], shared)
    for robot in document["robot"]:
        detach(robot, [str(axis["name"]) for axis in robot["axis"] if _id(robot, axis) not in found])
        for number, axis in reversed(list(enumerate(robot["axis"]))):
            if _id(robot, axis) not in found:
                del robot["axis"][number]
    for number, robot in reversed(list(enumerate(document["robot"]))):
        if not robot["axis"]:
            del document["robot"][number]
    return "".join(f"# {line}\n" for line in heading) + tomlkit.dumps(document)


def _axes(document: TOMLDocument) -> Iterator[tuple[str, Any]]:
    for robot in document["robot"]:
        for axis in robot["axis"]:
            yield _id(robot, axis), axis


def _id(robot: Any, axis: Any) -> str:
    return f"{robot['name']}.{axis['name']}"


def _table(parent: Any, name: str) -> Any:
    """A table of an axis; made in one line where the axis has none of its own."""
    if name not in parent:
        parent[name] = tomlkit.inline_table()
    return parent[name]


def _give_to_axes(robot: Any, table: str, key: str) -> None:
    """Move a key of a table of [robot.defaults] into the axes, which may then differ in it."""
    defaults = robot.get(DEFAULTS, {}).get(table, {})
    if key not in defaults:
        return
    value = defaults.pop(key).unwrap()
    if not defaults:
        del robot[DEFAULTS][table]
    for axis in robot["axis"]:
        own = _table(axis, table)
        own[key] = {**value, **own.get(key, {})} if isinstance(value, dict) else own.get(key, value)


def _set(axis: Any, found: Found, shared: Sequence[str] | None) -> None:
    """Write what was found into an axis; ``shared``: what it monitors where it has no key of its own."""
    for table, keys in _IN_NOMINAL_FILE.items():
        _remove(axis, table, keys)
    model = _table(axis, "model")
    if list(model.get("monitor", shared or ())) != list(found.monitor):
        model["monitor"] = list(found.monitor)
    model["nominal_file"] = found.nominal_file
    model.pop("thresholds_file", None)
    if found.thresholds_file is not None:
        model["thresholds_file"] = found.thresholds_file
        _remove(axis, "detector", _IN_THRESHOLDS_FILE)


def _remove(axis: Any, table: str, keys: Sequence[str]) -> None:
    """Remove keys of a table of an axis, and the table if nothing is left."""
    own = axis.get(table, {})
    present = [key for key in keys if key in own]
    for key in present:
        del own[key]
    if present and not own:
        del axis[table]


def kept_files(document: TOMLDocument) -> Iterator[tuple[Any, str]]:
    """Table and key of each file that a configuration names, and that commissioning does not replace."""
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
