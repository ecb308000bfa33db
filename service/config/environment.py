"""Environment variables that override the file: AXISWATCH_WEB__PORT=9000 replaces port = 9000 in [web].

The names are those of pydantic-settings (prefix, section, two underscores, key, any case), for the scalars of [service]
and [web].  pydantic-settings itself reads only the environment of the process and does not report which variable was
wrong.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from pydantic import TypeAdapter, ValidationError

from monitor_core.wording import did_you_mean
from service.config.positions import Keys
from service.config.schema import Config
from service.config.validation_messages import Finding, table_in

PREFIX = "AXISWATCH_"
SECTIONS = ("service", "web")


class Override(NamedTuple):
    """A variable with its text, as the user wrote them, and its value."""

    variable: str
    text: str
    value: Any


Overrides = Mapping[Keys, Override]
"""The keys that the environment sets."""


def overrides(environ: Mapping[str, str]) -> Overrides:
    """The keys set by the environment; sections may be unknown, which ``unknown_sections`` finds."""
    found = {path: (name, text) for name, text in environ.items() if (path := _path(name))}
    return {path: Override(name, text, _number(path, text)) for path, (name, text) in found.items()}


def apply(values: dict[str, Any], over: Overrides) -> None:
    """Write the overrides of known sections into the values of the file, in place."""
    for (section, key), override in over.items():
        table = values.setdefault(str(section), {}) if section in SECTIONS else None
        if isinstance(table, dict):
            table[str(key)] = override.value


def unknown_sections(over: Overrides) -> Iterator[Finding]:
    """Variables for sections that the environment cannot set."""
    known = [f"{PREFIX}{section.upper()}__..." for section in SECTIONS]
    for path, override in over.items():
        if path[0] not in SECTIONS:
            yield Finding(path, f"no such setting: {did_you_mean(override.variable, known)}")


def _path(name: str) -> Keys | None:
    """("web", "port") for AXISWATCH_WEB__PORT; None for other variables, such as AXISWATCH_DATA."""
    section, separator, key = name.upper().removeprefix(PREFIX).lower().partition("__")
    return (section, key) if name.upper().startswith(PREFIX) and separator else None


def _number(path: Keys, text: str) -> Any:
    """The number of a numeric key; the text itself where it is no number, for the schema to report."""
    section = Config.model_fields.get(str(path[0]))
    table = table_in(section.annotation) if section else None
    field = table.model_fields.get(str(path[1])) if table else None
    kind = field.annotation if field else str
    if kind not in (int, float):
        return text
    try:
        return TypeAdapter(kind).validate_strings(text)
    except ValidationError:
        return text
