"""Common parts of reading the files written by `axiswatch identify` and `axiswatch calibrate`."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from service.config.renamed_keys import RENAMED_KEYS


class FoundTable(BaseModel):
    """A table whose unknown keys (fits, rates, provenance) are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True)


_F = TypeVar("_F", bound=FoundTable)


def unchanged(path: Path, read: Callable[[Path, int, int], _F], refusal: type[Exception]) -> _F:
    """The cached result of ``read`` for a file of this time and size.

    Raises:
        refusal: it cannot be read.
    """
    try:
        state = path.stat()
        return read(path, state.st_mtime_ns, state.st_size)
    except OSError as error:
        raise refusal(f"cannot read {path}: {error.strerror}") from None


def content_of(path: Path, refusal: type[Exception]) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises:
        refusal: it is none.
        OSError: it cannot be read.
    """
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except ValueError as error:
        raise refusal(f"{path} is no TOML: {error}") from None


def validated(schema: type[_F], content: dict[str, Any], path: Path, refusal: type[Exception]) -> _F:
    """The content validated by a schema.

    Raises:
        refusal: a value is wrong; the text names the key.
    """
    for key in _keys(content):
        if (change := RENAMED_KEYS.get(key)) is not None:
            raise refusal(f"{path}: {key}: is now called {change}")
    try:
        return schema.model_validate({**content, "path": path})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(map(str, first["loc"]))
        raise refusal(f"{path}: {key}: {first['msg']}") from None


_NAMED_BY_USERS = ("values", "standard_deviations", "nominal")
"""Tables whose keys are names of parameters."""


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
