"""The names of files in the text of a configuration."""

from collections.abc import Iterator
from typing import Any

from tomlkit import TOMLDocument

from service.config.schema import LINK_FILES
from service.config.schema.base_table import SUFFIX
from service.config.schema.robot_defaults import DEFAULTS

_FOUND = ("nominal_file", "thresholds_file")


def found_files(document: TOMLDocument) -> Iterator[tuple[Any, str]]:
    """Table and key of each file name that commissioning replaces."""
    for robot in document["robot"]:
        for axis in (*robot["axis"], robot.get(DEFAULTS, {})):
            model = axis.get("model", {})
            yield from ((model, key) for key in _FOUND if key in model)


def kept_files(document: TOMLDocument) -> Iterator[tuple[Any, str]]:
    """Table and key of each file name that commissioning does not replace."""
    for bus in document.get("bus", ()):
        if "messages" in bus:
            yield bus, "messages"
    web = document.get("web", {})
    yield from ((web, key) for key in ("certificate", "key") if key in web)
    links = document.get("links", {})
    for link in (*links.get("webhook", ()), *(links.get(name, {}) for name in ("mqtt", "smtp", "opcua"))):
        yield from ((link, key) for key in LINK_FILES if key in link)
    for robot in document["robot"]:
        for axis in (*robot["axis"], robot.get(DEFAULTS, {})):
            if "eds" in axis.get("canopen", {}):
                yield axis["canopen"], "eds"
            model = axis.get("model", {})
            if str(model.get("drive", "")).endswith(SUFFIX):
                yield model, "drive"
