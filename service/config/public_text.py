"""A configuration, and messages, for readers who must not see secrets or folders of the machine."""

import os
import re
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import tomlkit
from pydantic import BaseModel

from monitor_core.wording import replaced
from service.config.problems import ConfigProblem
from service.config.schema import Config
from service.config.schema.found_file import FoundFile
from service.config.schema.robot_defaults import DEFAULTS

HIDDEN = "..."
_FOLDER = re.compile(r"(?<![^\s\"'`(\[=:,;])/(?:[^\s\"'`()\[\]:,;/]+/)+(?=[^\s/])")
"""The folder of an absolute path in a text; not what follows the host in a URL"""
_SECRET = re.compile(r"secret|password|passwd|passphrase|token|credential|(^|_)key$", re.IGNORECASE)
"""Keys whose values are hidden, even if they only name a file or a variable with a secret."""


def public_text(config: Config, folder: Path) -> str:
    """The keys set by the file or the environment, as TOML, without secrets.

    Keys with their default are left out.  Values of [robot.defaults] are shown in the axes.  A file that was read is
    shown by its name, relative to ``folder`` if it is in there.  Of a webhook's address only the host is shown.
    """
    return tomlkit.dumps(_shown_table(config, folder))


def public_problem(problem: ConfigProblem) -> str:
    """A mistake in a configuration without its value, which may be a secret at the wrong place, and without folders."""
    file = problem.file
    place = problem.place if file is None else problem.place.replace(str(file), file.name, 1)
    words = problem.message
    if any(_SECRET.search(key) for key in problem.key.split(".")) or "://" in words:
        words = "the log says what is wrong with it"
    if file is not None:
        words = public_words(words, file.absolute().parent)
    return f"{place}: {problem.key}: {words}" if problem.key else f"{place}: {words}"


def public_words(text: str, folder: Path) -> str:
    """A message without folders of the machine, which only the log names.

    A file in ``folder`` is named relative to it, any other by its name alone.  A sentence keeps its kind.
    """
    words = replaced(text, f"{folder}{os.sep}", "")
    for outside in sorted(_FOLDER.findall(words), key=len, reverse=True):
        words = replaced(words, outside, "")
    return words


def _shown_table(table: BaseModel, folder: Path) -> dict[str, Any]:
    keys = [key for key in type(table).model_fields if key in table.model_fields_set and key != DEFAULTS]
    found = {key: _shown_value(key, getattr(table, key), folder) for key in keys}
    return {key: value for key, value in found.items() if value is not None}


def _shown_value(key: str, value: Any, folder: Path) -> Any:
    if value is None:
        return None
    if _SECRET.search(key):
        return HIDDEN
    if isinstance(value, FoundFile):
        return _name(value.path, folder)
    if isinstance(value, Path):
        return _name(value, folder)
    if isinstance(value, BaseModel):
        return _shown_table(value, folder)
    if isinstance(value, dict):
        items = {str(name): _shown_value(str(name), item, folder) for name, item in value.items()}
        return {name: item for name, item in items.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_shown_value(key, item, folder) for item in value]
    return _without_credentials(value) if isinstance(value, str) else value


def _without_credentials(text: str) -> str:
    """A text; of a URL only the host, as the whole URL of a webhook often gives access."""
    if "://" not in text:
        return text
    try:
        parts = urlsplit(text)
        host = parts.hostname
    except ValueError:
        return HIDDEN
    return f"{parts.scheme}://{host}/{HIDDEN}" if host else HIDDEN


def _name(path: Path, folder: Path) -> str:
    inside = os.path.relpath(path, folder)
    return os.path.normpath(path) if inside.startswith("..") else Path(inside).as_posix()
