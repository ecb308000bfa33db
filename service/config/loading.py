"""From a file and the environment to a Config, or to all problems at once."""

import os
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from service.config import environment
from service.config.base_table import Reading
from service.config.crosschecks import crosscheck
from service.config.positions import Keys, nearest, positions
from service.config.problems import ConfigErrors, Problem, dotted, shown
from service.config.schema import Config
from service.config.validation_messages import Finding, findings

_AT = re.compile(r"(?P<message>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)")


def load(path: Path, environ: Mapping[str, str] = os.environ, *, thresholds: bool = True) -> Config:
    """The configuration of a file, with the overrides of the environment.

    Relative paths start at the folder of the file.  Without ``thresholds`` the files of thresholds are ignored: a
    calibration replaces them, and they may no longer fit.

    Raises:
        ConfigErrors: all problems of the file, of the overrides and of the DBC files.
    """
    text = _text(path)
    values = _values(path, text)
    if not thresholds:
        _forget_thresholds(values)
    over = environment.overrides(environ)
    environment.apply(values, over)
    config, found = _read(values, path.absolute().parent)
    found += environment.unknown_sections(over)
    if config is None or found:
        raise ConfigErrors(_problems(path, positions(text), over, values, found))
    return config


def _forget_thresholds(values: dict[str, Any]) -> None:
    robots = values.get("robot")
    for robot in robots if isinstance(robots, list) else ():
        axes = robot.get("axis") if isinstance(robot, dict) else None
        for axis in axes if isinstance(axes, list) else ():
            model = axis.get("model") if isinstance(axis, dict) else None
            if isinstance(model, dict):
                model.pop("thresholds_file", None)


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
        return data.decode("utf-8-sig")
    except OSError as error:
        reason = f"cannot read the configuration: {error.strerror}"
        raise ConfigErrors([Problem(path, None, "", None, reason)]) from None
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        reason = "the file must be UTF-8 text; this line holds other bytes"
        raise ConfigErrors([Problem(path, line, "", None, reason)]) from None


def _values(path: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except ValueError as error:
        raise ConfigErrors([_syntax_error(path, text, str(error))]) from None


def _syntax_error(path: Path, text: str, reason: str) -> Problem:
    at = _AT.fullmatch(reason)
    message = f"this is no TOML: {at['message'] if at else reason}"
    if at and at["line"]:
        return Problem(path, int(at["line"]), "", None, message, int(at["column"]))
    lines = text.splitlines() or [""]
    return Problem(path, len(lines), "", None, message, len(lines[-1]) + 1)


def _read(values: dict[str, Any], folder: Path) -> tuple[Config | None, list[Finding]]:
    """The configuration if the schema accepts it, and the problems: of the schema, or otherwise of the cross-checks."""
    try:
        config = Config.model_validate(values, context=Reading(folder))
    except ValidationError as error:
        return None, findings(error.errors(include_url=False))
    return config, list(crosscheck(config))


def _problems(
    path: Path,
    where: Mapping[Keys, int],
    over: environment.Overrides,
    values: dict[str, Any],
    found: Iterable[Finding],
) -> list[Problem]:
    problems = []
    for finding in dict.fromkeys(found):
        message = finding.message
        if finding.other:
            message += f" {dotted(finding.other)} in line {nearest(where, finding.other)}"
        if finding.path in over:
            override = over[finding.path]
            problems.append(Problem(None, None, override.variable, override.text, message))
        else:
            line = nearest(where, finding.path)
            value = _shown_at(values, finding.path)
            problems.append(Problem(path, line, dotted(finding.path), value, message))
    return sorted(problems, key=lambda problem: problem.line or 0)


def _shown_at(values: Any, path: Keys) -> str | None:
    """The value at a path, None if it is missing."""
    for part in path:
        try:
            values = values[part]
        except (KeyError, IndexError, TypeError):
            return None
    return shown(values)
