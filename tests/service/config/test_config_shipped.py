"""The example configurations load, explain every key of the schema, and tell the truth about its defaults."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from monitor_core.modeling.standard_drives import REFERENCE_VALUES
from service.can.message_files import read_messages
from service.can.messages import find_signal
from service.config import Config, load
from service.config.schema.base_table import TomlTable
from service.config.schema_errors import table_in
from service.config.toml_lines import Keys, positions
from tests.service.found_files import nominal_text, thresholds_text

CONFIG = Path(__file__).resolve().parents[3] / "config"
EXAMPLE = (CONFIG / "reference.toml").read_text(encoding="utf-8")
OPTIONAL = re.compile(r"^#(?=[\w\[\"])", re.MULTILINE)  # "#key = value" or "#[table]"; prose begins with "# "
EVERYTHING = OPTIONAL.sub("", EXAMPLE)


def test_demo_is_six_reference_drives_and_the_example_has_both_outputs() -> None:
    config = load(CONFIG / "demo.toml", {})
    assert [axis.id for axis in config.axes] == [f"demo.axis{i}" for i in range(1, 7)]
    expected = {**REFERENCE_VALUES, "fc": 0.08, "tau0": 0.01}
    for axis in config.axes:
        assert axis.config.model.nominal == pytest.approx(expected, rel=1e-14)
        assert axis.config.model.monitor == ("kT", "1/Ja", "fm")
        assert axis.config.output == "angle"
    config = load(CONFIG / "reference.toml", {})
    assert [(axis.id, axis.config.output) for axis in config.axes] == [
        ("cell1.axis1", "angle"),
        ("cell1.axis2", "speed"),
    ]
    assert config.bus[0].interface == "socketcan"


@pytest.fixture
def everything(tmp_path: Path) -> Config:
    """The example with every optional key in force."""
    for name in ("robot.dbc", "drive.eds"):
        (tmp_path / name).symlink_to(CONFIG / name)
    (tmp_path / "a.toml").write_text(EVERYTHING, encoding="utf-8")
    axis = load(CONFIG / "reference.toml", {}).axes[0].config
    drawn = axis.model.model_copy(update={"drive_model": "ThreeMass"})
    coupling = tomllib.loads(EVERYTHING)["robot"][0]["axis"][0]["coupling"]
    filed = axis.model_copy(update={"model": drawn, "coupling": coupling})
    (tmp_path / "nominal.toml").write_text(nominal_text(filed), encoding="utf-8")
    (tmp_path / "thresholds.toml").write_text(thresholds_text(axis), encoding="utf-8")
    return load(tmp_path / "a.toml", {})


def test_every_key_of_the_schema_is_in_the_example(everything: Config) -> None:
    shown = {(table, key) for table, keys in _tables(Config, tomllib.loads(EVERYTHING)) for key in keys}
    every = {(table, key) for table in {table for table, _ in shown} for key in table.model_fields}
    assert shown == every
    assert {table.__name__ for table, _ in shown} == {
        table.__name__ for table in _kinds(TomlTable) if not table.__subclasses__()
    }


def _kinds(table: type[TomlTable]) -> set[type[TomlTable]]:
    return {kind for own in table.__subclasses__() for kind in (own, *_kinds(own))}


def test_what_the_example_calls_a_default_is_one(everything: Config) -> None:
    defaults = load(CONFIG / "reference.toml", {})
    stated = [p for p in _told_defaults() if p[0] != "links" and _at(defaults, p) is not None]
    assert len(stated) > 20
    for path in stated:
        assert (path, _at(everything, path)) == (path, pytest.approx(_at(defaults, path)))
    of_links = [path for path in _told_defaults() if path[0] == "links"]
    assert len(of_links) > 10
    for path in of_links:  # which a configuration need not have
        key = path[:-1] if isinstance(path[-1], int) else path  # a list
        field = type(_at(everything, key[:-1])).model_fields[str(key[-1])]
        assert (key, _at(everything, key)) == (key, field.default)


def test_bounds_and_defaults_are_explained_in_the_schema() -> None:
    for table in _kinds(TomlTable):
        assert [name for name, field in table.model_fields.items() if not field.description] == []


@pytest.mark.parametrize("axis", range(1, 7))
def test_robot_dbc(axis: int) -> None:
    database = read_messages(CONFIG / "robot.dbc")
    expected = {
        "Torque": (0x100, 16, 0.001, "N m"),
        "Angle": (0x200, 32, 1e-5, "rad"),
        "Speed": (0x300, 32, 1e-5, "rad/s"),
    }
    for name, (base, bits, scale, unit) in expected.items():
        message, value = find_signal(database, f"Axis{axis}{name}", name)
        counter = message.get_signal_by_name("Counter")
        assert (message.frame_id, message.length) == (base + axis, 8)
        assert (value.length, value.scale, value.unit, value.is_signed) == (bits, scale, unit, True)
        assert (counter.length, counter.is_signed) == (16, False)
        beside = {"Speed": 1.0} if name == "Angle" else {}  # in the same frame
        data = message.encode({name: -12.345, "Counter": 513, **beside})
        assert data[bits // 8 : bits // 8 + 2] == b"\x01\x02"  # little endian
        assert message.decode_simple(data)[name] == pytest.approx(-12.345)


def _tables(table: type[TomlTable], values: dict[str, Any]) -> Iterator[tuple[type[TomlTable], set[str]]]:
    yield table, set(values)
    for key, value in values.items():
        inner = table_in(table.model_fields[key].annotation)
        for element in value if isinstance(value, list) else [value]:
            if inner is not None:
                yield from _tables(inner, element)


def _told_defaults() -> Iterator[Keys]:
    """The paths of all "#key = value" whose comment does not call the value an example."""
    by_line = {line: path for path, line in positions(EVERYTHING).items()}
    comment, fresh = "", True
    for number, row in enumerate(EXAMPLE.split("\n"), 1):
        if row.startswith("# "):
            comment, fresh = (comment if fresh else "") + row, True
        elif OPTIONAL.match(row):
            fresh = False
            if "[" not in row[:2] and "xample" not in comment:
                yield by_line[number]
        else:
            comment = ""


def _at(value: Any, path: Keys) -> Any:
    for part in path:
        value = value[part] if isinstance(part, int) or isinstance(value, dict) else getattr(value, part)
    return value if not isinstance(value, Path) else value.name
