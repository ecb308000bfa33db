"""Keys are found where they stand, in every way that TOML has of writing them."""

import tomllib

import pytest

from service.config.toml_lines import nearest, positions

TEXT = """\
title = "x"  # line 1

[service]
a.b = { c = 1, "d e" = [10,
  20, { f = 3 }] }

[[robot]]
name = "one"
[[robot.axis]]
name = "a"
[robot.axis.model]
"1/Ja" = 5
'k' = 6
[[robot.axis]]
[robot.axis.model.nominal]
Jm = 1

[[robot]]
axis = [{ name = "c" }, { name = "d" }]
"caf\\u00e9" = 1
"""


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("title",), 1),
        (("service",), 3),
        (("service", "a"), 4),
        (("service", "a", "b"), 4),
        (("service", "a", "b", "c"), 4),
        (("service", "a", "b", "d e"), 4),
        (("service", "a", "b", "d e", 1), 5),
        (("service", "a", "b", "d e", 2, "f"), 5),
        (("robot",), 7),
        (("robot", 0, "name"), 8),
        (("robot", 0, "axis", 0), 9),
        (("robot", 0, "axis", 0, "model", "1/Ja"), 12),
        (("robot", 0, "axis", 0, "model", "k"), 13),
        (("robot", 0, "axis", 1), 14),
        (("robot", 0, "axis", 1, "model", "nominal", "Jm"), 16),
        (("robot", 1), 18),
        (("robot", 1, "axis", 1, "name"), 19),
        (("robot", 1, "café"), 20),
    ],
)
def test_line(path: tuple[str | int, ...], line: int) -> None:
    assert positions(TEXT)[path] == line


def test_every_value_has_a_line() -> None:
    found = positions(TEXT)
    missing = [path for path in _paths(tomllib.loads(TEXT), ()) if path not in found]
    # A table that only its inner tables mention has no header of its own.
    assert missing == [("robot", 0, "axis", 1, "model")]


def test_where_a_key_counts_from() -> None:
    """A missing key from its table; Windows line ends; a table's header that stands behind its inner table."""
    found = positions(TEXT)
    assert nearest(found, ("robot", 0, "axis", 0, "model", "drive")) == 11
    assert nearest(found, ("robot", 0, "axis", 1, "torque", "message")) == 14
    assert nearest(found, ("bus", 0)) == 1
    assert positions("a = 1\r\n[t]\r\nb = 2\r\n")[("t", "b")] == 3
    assert positions("[a.b]\nc = 1\n[a]\nd = 2\n")[("a",)] == 3


def _paths(value: object, path: tuple[str | int, ...]) -> list[tuple[str | int, ...]]:
    entries: list[tuple[str | int, object]] = []
    if isinstance(value, dict):
        entries = list(value.items())
    elif isinstance(value, list):
        entries = list(enumerate(value))
    return [p for key, entry in entries for p in [(*path, key), *_paths(entry, (*path, key))]]
