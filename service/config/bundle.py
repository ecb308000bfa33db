"""A configuration with all files that it names, as they lie in one folder: for a backup."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit
from tomlkit import TOMLDocument

from service.config.commissioned import REPORT, kept_files, pages_of
from service.config.robot_defaults import DEFAULTS
from service.config.schema import Config
from service.config.schema_links import SECRET_FILES

OUTSIDE = "outside"
"""Folder of the files that do not lie in that of the configuration"""
STATE = "state"
_FOUND = ("nominal_file", "thresholds_file")


class Bundle(NamedTuple):
    """Names are relative to the folder of the bundle, with "/"."""

    name: str
    """Of the configuration"""
    text: str
    """Of the configuration; what lies outside its folder is renamed in it"""
    files: dict[str, Path]
    """Where each other file lies now"""
    secrets: frozenset[str]
    """Which of them are secret: the private key of TLS, passwords and keys of links"""
    state: str
    """The state directory"""
    renamed: dict[str, str]
    """Files and folders that lie outside, and their names in the bundle"""


def bundle(file: Path, config: Config) -> Bundle:
    """The files of a configuration, in which all names stay as they are where that is possible.

    ``config``: what the file says, with the environment.

    Raises:
        OSError: it cannot be read.
    """
    folder = file.absolute().parent
    document = tomlkit.parse(file.read_text(encoding="utf-8-sig"))
    files, secrets, renamed = dict[str, Path](), set[str](), dict[str, str]()
    for table, key in (*kept_files(document), *_found_files(document)):
        given = str(table[key])
        source = folder / given
        if (name := _inside(source, folder)) is None:
            name = renamed.setdefault(given, f"{OUTSIDE}/{len(renamed) + 1}-{source.name}")
            table[key] = name
        files[name] = source
        if key in ("key", *SECRET_FILES):
            secrets.add(name)
    state = _inside(config.service.state_dir, folder)
    if state is None:
        renamed[str(config.service.state_dir)] = state = STATE
    service: Any = document.setdefault("service", tomlkit.table())
    if STATE in renamed.values() or service.get("state_dir", STATE) != state:
        service["state_dir"] = state  # that of systemd, or of the environment, may be another one then
    reports = (REPORT, *(page for axis in config.axes for page in pages_of(axis.id)))
    files |= {name: folder / name for name in reports if (folder / name).is_file()}
    return Bundle(file.name, tomlkit.dumps(document), files, frozenset(secrets), state, renamed)


def _inside(path: Path, folder: Path) -> str | None:
    """The name of a path relative to the folder; None: it lies outside."""
    name = os.path.relpath(path, folder)
    return None if name == "." or name.startswith("..") else Path(name).as_posix()


def _found_files(document: TOMLDocument) -> Iterator[tuple[Any, str]]:
    for robot in document.get("robot", ()):
        for axis in (*robot.get("axis", ()), robot.get(DEFAULTS, {})):
            model = axis.get("model", {})
            yield from ((model, key) for key in _FOUND if key in model)
