"""Reading the files that `axiswatch identify` and `axiswatch calibrate` write."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from service.config.base_table import Undecidable
from service.config.validation_messages import RENAMED_KEYS

FORMAT = 1
"""Of these files; a later one may mean something else."""
_SAME = 1e-6
"""Relative: numbers are written with ten digits, and copied with fewer."""
_NAMED_BY_USERS = ("values", "standard_deviations", "nominal")
"""Tables whose keys are names of parameters."""


class FoundFileError(Exception):
    """A file that cannot be used; the text names it and says why."""


class FoundTable(BaseModel):
    """A table whose unknown keys (fits, rates, provenance) are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class FoundFile(FoundTable):
    """A whole file."""

    KIND: ClassVar[str | None] = None
    """Value of its key ``kind``"""
    WHAT: ClassVar[str]
    """What such a file is"""
    path: Path


_F = TypeVar("_F", bound=FoundFile)


def read_found(schema: type[_F], path: Path) -> _F:
    """The file, kept until it changes.

    Raises:
        FoundFileError: it cannot be read, or is no such file.
    """
    try:
        state = path.stat()
        found = _read(schema, path, state.st_mtime_ns, state.st_size)
    except OSError as error:
        raise FoundFileError(f"cannot read {path}: {error.strerror}") from None
    assert isinstance(found, schema)
    return found


def found_of(schema: type[_F], path: Path | None) -> _F | None:
    """The file that an axis names, None if it names none.

    Raises:
        Undecidable: it cannot be used, which a rule of the configuration reports.
    """
    try:
        return None if path is None else read_found(schema, path)
    except FoundFileError:
        raise Undecidable(schema.__name__) from None


@lru_cache(maxsize=512)
def _read(schema: type[FoundFile], path: Path, _mtime_ns: int, _size: int) -> FoundFile:
    try:
        content = tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except ValueError as error:
        raise FoundFileError(f"{path} is no TOML: {error}") from None
    if (written := content.get("format", "missing")) != FORMAT:
        raise FoundFileError(f"{path}: format = {written}, not {FORMAT}: {schema.WHAT}")
    if schema.KIND is not None and content.get("kind") != schema.KIND:
        raise FoundFileError(f"{path}: {schema.WHAT}")
    for key in _keys(content):
        if (change := RENAMED_KEYS.get(key)) is not None:
            raise FoundFileError(f"{path}: {key}: is now called {change}")
    try:
        return schema.model_validate({**content, "path": path})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(map(str, first["loc"]))
        raise FoundFileError(f"{path}: {key}: {first['msg']}") from None


def _keys(content: object) -> Iterator[str]:
    """The keys of a table and of all tables in it, without names of parameters."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield key
            if key not in _NAMED_BY_USERS:
                yield from _keys(value)
    elif isinstance(content, list):
        for value in content:
            yield from _keys(value)


def alike(left: object, right: object) -> bool:
    """Whether two values are the same, numbers as far as they are written."""
    if isinstance(left, list | tuple) and isinstance(right, list | tuple):
        return len(left) == len(right) and all(map(alike, left, right))
    if isinstance(left, int | float) and isinstance(right, int | float):
        return math.isclose(left, right, rel_tol=_SAME, abs_tol=1e-300)
    return left == right
