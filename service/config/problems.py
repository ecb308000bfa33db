"""Mistakes in a configuration: findings of checks, and problems with place, key, value and correction."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from monitor_core.wording import sentence
from service.config.toml_lines import Keys

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_LONGEST_VALUE = 60
_LONGEST_DECIMAL = 128


class CheckFinding(NamedTuple):
    """A mistake at a path of the file; if ``other`` is given, its place is added to the end of the message."""

    path: Keys
    message: str
    other: Keys | None = None

    def inside(self, table: Keys) -> CheckFinding:
        """The finding with a path relative to the file."""
        return CheckFinding((*table, *self.path), self.message, self.other and (*table, *self.other))


@dataclass(frozen=True, slots=True)
class ConfigProblem:
    """One problem.  ``key``: dotted, with array elements counted from 1: robot[1].axis[2].torque.message.

    ``line``: None for the whole file.  ``file``: None for the environment; ``key`` is then the variable.  ``value``: as
    TOML would write it; None: the key is missing.
    """

    file: Path | None
    line: int | None
    key: str
    value: str | None
    message: str
    column: int | None = None

    @property
    def place(self) -> str:
        """File, line and, for syntax errors, column, such as robot.toml:12; or "environment"."""
        if self.file is None:
            return "environment"
        parts = [str(self.file), *(str(n) for n in (self.line, self.column) if n is not None)]
        return ":".join(parts)

    def __str__(self) -> str:
        value = "" if self.value is None else f" = {self.value}"
        key = f"{self.key}{value}: " if self.key else ""
        return f"{self.place}: {key}{self.message}"


class ConfigErrors(Exception):  # noqa: N818 - several errors
    """The configuration cannot be used; with all problems found in it."""

    def __init__(self, problems: Sequence[ConfigProblem]) -> None:
        super().__init__("\n".join(map(str, problems)))
        self.problems = list(problems)


def dotted(path: Sequence[str | int]) -> str:
    """A path as a dotted TOML key, with elements of arrays counted from 1."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            name = part if _BARE.fullmatch(part) else json.dumps(part, ensure_ascii=False)
            text += f".{name}" if text else name
    return text


def shown(value: object) -> str:
    """A value as TOML would write it, cut if it is long."""
    text = _toml(value)
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."


def _toml(value: object) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > _LONGEST_DECIMAL:
        return hex(value)  # Python refuses to convert very long integers to decimal text
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{dotted([str(key)])} = {_toml(entry)}" for key, entry in value.items()) + "}"
    return str(value)


NOT_UTF8 = "the file must be UTF-8 text; this line holds other bytes"


def line_of(error: UnicodeDecodeError) -> int:
    """The line of the bytes that are no text."""
    return error.object[: error.start].count(b"\n") + 1


# --- Validation errors in words ---------------------------------------------------------------------------------------


_LIMITS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}


def at_place(place: str, error: Mapping[str, Any]) -> str:
    """A validation error of pydantic at a place, such as a key, as a sentence; common errors are translatable."""
    words, values = error["msg"].removeprefix("Value error, "), error.get("ctx", {})
    template = "{place}: {words}"
    for name, sign in _LIMITS.items():
        if isinstance(limit := values.get(name), int | float):
            return sentence("out of limits", template, place=place, words=words, sign=sign, limit=f"{limit:g}")
    if error["type"] == "missing":
        return sentence("key missing", template, place=place, words=words)
    if error["type"].endswith(("_type", "_parsing")):
        return sentence("other kind", template, place=place, words=words)
    return f"{place}: {words}"
