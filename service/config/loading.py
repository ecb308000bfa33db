"""Loads a configuration from a file and the environment; reports all problems at once.

Variables of the environment override keys of [service] and [web]: AXISWATCH_WEB__PORT=9000 replaces the port, and
AXISWATCH_WEB__HOSTS=a,b the list of hosts.  Their names are as in pydantic-settings: prefix, section, two underscores,
key, in any case.  That package itself is not used, as it reads only the environment of the process and does not report
which variable was wrong.

Under systemd, the folder in STATE_DIRECTORY is the default of state_dir.
"""

import os
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, get_origin

from pydantic import TypeAdapter, ValidationError

from monitor_core.wording import did_you_mean
from service.config.problems import NOT_UTF8, CheckFinding, ConfigErrors, ConfigProblem, dotted, line_of, shown
from service.config.rules.crosschecks import crosscheck
from service.config.schema import Config, concealed
from service.config.schema.base_table import ReadingContext
from service.config.schema.robot_defaults import origin
from service.config.schema_errors import causes, schema_message, table_in
from service.config.toml_lines import Keys, nearest, positions

PREFIX = "AXISWATCH_"
SECTIONS = ("service", "web")
"""Sections whose keys the environment can set."""
_AT = re.compile(r"(?P<message>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)")


class _Override(NamedTuple):
    variable: str
    text: str


_Overrides = Mapping[Keys, _Override]


def load(path: Path, environ: Mapping[str, str] = os.environ, *, thresholds: bool = True) -> Config:
    """Load a configuration file, with the overrides of the environment.

    Relative paths start at the folder of the file.  Without ``thresholds``, thresholds files are ignored: for a
    calibration, which replaces them, as they may no longer fit.

    Raises:
        ConfigErrors: all problems of the file, the overrides and the bus descriptions.
    """
    return load_text(_text(path), path, environ, thresholds=thresholds)


def load_text(text: str, path: Path, environ: Mapping[str, str] = os.environ, *, thresholds: bool = True) -> Config:
    """The configuration that a file with this text would be; it need not exist.  All else as of ``load``."""
    values = _values(path, text)
    over = {key: _Override(name, value) for name, value in environ.items() if (key := _path(name))}
    _override(values, over)
    _default_state_dir(values, environ)
    config, found = _read(values, ReadingContext(path.absolute().parent, thresholds))
    found += _unknown_sections(over)
    if config is None or found:
        raise ConfigErrors(_problems(path, positions(text), over, values, found))
    return config


def _text(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        reason = f"cannot read the configuration: {error.strerror}"
        raise ConfigErrors([ConfigProblem(path, None, "", None, reason)]) from None
    except UnicodeDecodeError as error:
        raise ConfigErrors([ConfigProblem(path, line_of(error), "", None, NOT_UTF8)]) from None


def _values(path: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except ValueError as error:
        at = _AT.fullmatch(str(error))
        message = f"this is no TOML: {at['message'] if at else error}"
        lines = text.splitlines() or [""]
        line, column = len(lines), len(lines[-1]) + 1
        if at and at["line"]:
            line, column = int(at["line"]), int(at["column"])
        raise ConfigErrors([ConfigProblem(path, line, "", None, message, column)]) from None


def _read(values: dict[str, Any], reading: ReadingContext) -> tuple[Config | None, list[CheckFinding]]:
    """The configuration, if the schema accepts it, and the problems: of the schema, otherwise of the cross-checks."""
    try:
        config = Config.model_validate(values, context=reading)
    except ValidationError as error:
        found = error.errors(include_url=False)
        return None, [CheckFinding(e["loc"], schema_message(e)) for e in causes(found)]
    return config, list(crosscheck(config))


def _problems(
    path: Path, where: Mapping[Keys, int], over: _Overrides, values: dict[str, Any], found: Iterable[CheckFinding]
) -> list[ConfigProblem]:
    problems = []
    for finding in dict.fromkeys(_at_origin(finding, where) for finding in found):
        message = finding.message
        if finding.other:
            message += f" {dotted(finding.other)} in line {nearest(where, finding.other)}"
        if (override := over.get(finding.path[:2])) is not None:
            problems.append(ConfigProblem(None, None, override.variable, override.text, message))
        else:
            line, value = nearest(where, finding.path), _shown_at(values, finding.path)
            problems.append(ConfigProblem(path, line, dotted(finding.path), value, message))
    return sorted(problems, key=lambda problem: problem.line or 0)


def _at_origin(finding: CheckFinding, where: Mapping[Keys, int]) -> CheckFinding:
    """The finding with the path where the file has the value: in an axis, or in the defaults of its robot."""
    path = origin(finding.path, where)
    other = None if finding.other is None else origin(finding.other, where)
    return finding._replace(path=path, other=finding.other if other == path else other)


def _shown_at(values: Any, path: Keys) -> str | None:
    """The value at a path as text; None: it is missing."""
    for part in path:
        try:
            values = values[part]
        except (KeyError, IndexError, TypeError):
            return None
    return shown(concealed(path[-1], values) if path else values)


# --- The environment --------------------------------------------------------------------------------------------------


def _path(name: str) -> Keys | None:
    """The path that a variable sets: ("web", "port") for AXISWATCH_WEB__PORT; None: another kind of variable."""
    section, separator, key = name.upper().removeprefix(PREFIX).lower().partition("__")
    return (section, key) if name.upper().startswith(PREFIX) and separator else None


def _override(values: dict[str, Any], over: _Overrides) -> None:
    """Write overrides of known sections into the values, in place."""
    for (section, key), override in over.items():
        table = values.setdefault(str(section), {}) if section in SECTIONS else None
        if isinstance(table, dict):
            table[str(key)] = _typed(str(section), str(key), override.text)


def _default_state_dir(values: dict[str, Any], environ: Mapping[str, str]) -> None:
    """Write the first state directory of the systemd unit into the values, in place, unless they have one.

    [service] is added in any case, so that its default path starts at the folder of the file.
    """
    table = values.setdefault("service", {})
    if isinstance(table, dict) and environ.get("STATE_DIRECTORY"):
        table.setdefault("state_dir", environ["STATE_DIRECTORY"].partition(":")[0])


def _typed(section: str, key: str, text: str) -> Any:
    """The text converted to the type of the key; an unsuitable text is returned as it is, for the schema to report."""
    table = table_in(Config.model_fields[section].annotation)
    field = table.model_fields.get(key) if table else None
    if field is not None and get_origin(field.annotation) is tuple:
        return [part.strip() for part in text.split(",") if part.strip()]
    if field is None or field.annotation not in (int, float, bool):
        return text
    try:
        return TypeAdapter(field.annotation).validate_strings(text)
    except ValidationError:
        return text


def _unknown_sections(over: _Overrides) -> Iterator[CheckFinding]:
    known = [f"{PREFIX}{section.upper()}__..." for section in SECTIONS]
    for path, override in over.items():
        if path[0] not in SECTIONS:
            yield CheckFinding(path, f"no such setting: {did_you_mean(override.variable, known)}")
