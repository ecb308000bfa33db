"""Reading the files that `axiswatch identify` and `axiswatch calibrate` write."""

import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from monitor_core.wording import sentence
from service.config.problems import at_place, dotted, shown
from service.config.schema.base_table import RENAMED_KEYS

FORMAT = 1
"""Format of these files."""
_SAME = 1e-6
"""Relative tolerance of equal numbers: they are written with ten digits, and may be copied with fewer."""
_NAMED_BY_USERS = ("values", "standard_deviations", "nominal")
"""Tables whose keys are names of parameters."""


class FoundFileError(ValueError):
    """A file cannot be used; the text names it and says why."""


class FoundTable(BaseModel):
    """A table of such a file; unknown keys (fits, rates, provenance) are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class FoundFile(FoundTable):
    """The common keys of a whole file."""

    path: Path
    format: Literal[1]


_F = TypeVar("_F", bound=FoundFile)


def read_found(schema: type[_F], path: Path) -> _F:
    """Read a file.

    Raises:
        FoundFileError: the file cannot be read, or is not of this kind.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise FoundFileError(f"cannot read {path}: {error.strerror}") from None
    except ValueError as error:
        raise FoundFileError(f"{path} is no TOML: {error}") from None
    return found_in(schema, text, path)


def found_in(schema: type[_F], text: str, path: Path) -> _F:
    """Parse the text of a file; ``path``: its name in messages.

    Raises:
        FoundFileError: the text is not of this kind.
    """
    try:
        content = tomllib.loads(text)
    except ValueError as error:
        raise FoundFileError(sentence("no TOML", "{path} is no TOML: {why}", path=path, why=error)) from None
    for key in _keys(content):
        if (change := RENAMED_KEYS.get(key)) is not None:
            words = "{path}: {key}: is now called {change}"
            raise FoundFileError(sentence("key renamed", words, path=path, key=key, change=change))
    try:
        return schema.model_validate({**content, "path": path})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key, value = dotted(first["loc"]), first["input"]
        given = "" if isinstance(value, dict | FoundTable) else f" = {shown(value)}"
        raise FoundFileError(at_place(f"{path}: {key}{given}", first)) from None


def _keys(content: object) -> Iterator[str]:
    """All keys in a table and its inner tables, without names of parameters."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield key
            if key not in _NAMED_BY_USERS:
                yield from _keys(value)
    elif isinstance(content, list):
        for value in content:
            yield from _keys(value)


def alike(left: object, right: object) -> bool:
    """Whether two values are equal; numbers are compared with the accuracy with which they are written."""
    if isinstance(left, list | tuple) and isinstance(right, list | tuple):
        return len(left) == len(right) and all(map(alike, left, right))
    if isinstance(left, int | float) and isinstance(right, int | float):
        return math.isclose(left, right, rel_tol=_SAME, abs_tol=1e-300)
    return left == right
