"""Validation errors of pydantic in the terms of the file format, with the meaning of the key."""

from collections.abc import Iterator, Sequence
from typing import Any, get_args

from pydantic_core import ErrorDetails

from monitor_core.wording import closest, did_you_mean
from service.config.schema import Config
from service.config.schema.base_table import TomlTable, hint

_RULES = {
    "missing": "missing",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "finite_number": "must be a finite number",
    "string_type": "must be a text in quotes",
    "string_too_short": "must not be empty",
    "string_pattern_mismatch": "must consist of letters, digits, - and _",
    "greater_than": "must be greater than {gt}",
    "greater_than_equal": "must be at least {ge}",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be at most {le}",
    "multiple_of": "must be a multiple of {multiple_of}",
    "too_short": "must have at least {min_length}",
    "too_long": "must have at most {max_length}",
    "literal_error": "must be {expected}",
    "model_type": "must be a table",
    "dict_type": "must be a table",
    "tuple_type": "must be a list",
    "value_error": "{error}",
}


def causes(errors: Sequence[ErrorDetails]) -> Iterator[ErrorDetails]:
    """The errors that are no consequences of others: a key that is misspelled is missing under its right name, too."""
    meant = {(*error["loc"][:-1], _meant(error)) for error in errors if error["type"] == "extra_forbidden"}
    for error in errors:
        if not _is_consequence(error) and not (error["type"] == "missing" and error["loc"] in meant):
            yield error


def _is_consequence(error: ErrorDetails) -> bool:
    if error["type"] == "default_factory_not_called":
        return True
    # pydantic does not count invalid elements, so it may report a list as too short.
    return error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]


def _meant(error: ErrorDetails) -> str | None:
    """The key of the schema that an unknown one was meant to be; None: that is not known."""
    _, table = _place_in_schema(error["loc"])
    return None if table is None else closest(str(error["loc"][-1]), table.model_fields)


def schema_message(error: ErrorDetails) -> str:
    """An error in words, with the meaning of its key, or what is right in the place of an unknown key."""
    key, table = _place_in_schema(error["loc"])
    if error["type"] == "extra_forbidden" and table is not None:
        wrong = str(error["loc"][-1])
        return hint(wrong) or f"unknown key: {did_you_mean(wrong, table.model_fields)}"
    rule = _RULES.get(error["type"], error["msg"]).format_map(_limits(error))
    return f"{rule} ({table.meaning(key)})" if table is not None and key in table.model_fields else rule


def _limits(error: ErrorDetails) -> dict[str, Any]:
    """The values for the text of a rule, with numbers without ".0"."""
    context = error.get("ctx", {})
    return {name: f"{value:g}" if isinstance(value, float) else value for name, value in context.items()}


def _place_in_schema(path: Sequence[str | int]) -> tuple[str, type[TomlTable] | None]:
    """The innermost key of a path that the schema knows, and its table."""
    key, table, inner = "", None, table_in(Config)
    for part in path:
        if isinstance(part, int) or inner is None:
            continue
        key, table, field = part, inner, inner.model_fields.get(part)
        inner = table_in(field.annotation) if field else None
    return key, table


def table_in(annotation: Any) -> type[TomlTable] | None:
    """The table in an annotation such as ``tuple[AxisConfig, ...]``."""
    if isinstance(annotation, type) and issubclass(annotation, TomlTable):
        return annotation
    return next(filter(None, map(table_in, get_args(annotation))), None)
