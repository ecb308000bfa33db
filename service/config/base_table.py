"""The base of every table of the configuration, and a second, lenient way to read one.

A strict reading fails where anything is wrong.  A lenient reading keeps what is right, so that the rules that
look at several values together still run beside the first mistake and all problems are reported at once.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, get_origin

from pydantic import (
    BaseModel,
    ConfigDict,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_validator,
)

ABSENT: Any = object()
"""In a lenient reading: a value that is missing or wrong."""


class Absent(LookupError):  # noqa: N818 - it ends a rule, nobody sees it
    """A value that a lenient reading does not have: what asked for it has nothing to say."""


@dataclass(frozen=True, slots=True)
class Reading:
    """How tables are read: ``folder`` is where relative paths start."""

    folder: Path
    lenient: bool = False


class Table(BaseModel):
    """A TOML table: immutable, unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, data: Any, info: ValidationInfo) -> Any:
        if not _lenient(info):
            return data
        if not isinstance(data, Mapping):
            return dict.fromkeys(cls.model_fields, ABSENT)
        required = {name: ABSENT for name, field in cls.model_fields.items() if field.is_required()}
        return required | {key: value for key, value in data.items() if key in cls.model_fields}

    @field_validator("*", mode="wrap")
    @classmethod
    def _tolerate(cls, value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
        if value is ABSENT:
            return ABSENT
        if not _lenient(info):
            return handler(value)
        free_keys = get_origin(cls.model_fields[str(info.field_name)].annotation) is dict
        return (
            _entries(value, handler) if free_keys and isinstance(value, dict) else _salvaged(value, handler)
        )

    @model_validator(mode="after")
    def _forget_absent(self) -> Self:
        for name in [name for name, value in self.__dict__.items() if value is ABSENT]:
            del self.__dict__[name]
        return self

    if not TYPE_CHECKING:  # a type checker shall see the fields only

        def __getattr__(self, name: str) -> Any:
            if name in type(self).model_fields:
                raise Absent(name)
            return super().__getattr__(name)


def present(table: Table, *names: str) -> bool:
    """Whether the table has right values of these names."""
    return all(name in table.__dict__ for name in names)


def _salvaged(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    """The validated value, or ABSENT."""
    try:
        return handler(value)
    except ValidationError:
        return ABSENT


def _entries(values: dict[str, Any], handler: ValidatorFunctionWrapHandler) -> dict[str, Any]:
    """The same entry by entry, for a table whose keys are free: only the wrong entries are ABSENT."""
    parts = {key: _salvaged({key: value}, handler) for key, value in values.items()}
    return {key: ABSENT if part is ABSENT else part[key] for key, part in parts.items()}


def _lenient(info: ValidationInfo) -> bool:
    return isinstance(info.context, Reading) and info.context.lenient
