"""The files of config/ as they come with the program: example configurations, drives."""

from pathlib import Path

import service

_PLACES = ("shipped", "../config")
"""In an installed wheel; in the source tree."""


def shipped(name: str) -> Path:
    """The file of that name.

    Raises:
        FileNotFoundError: the program is not completely installed.
    """
    for place in _PLACES:
        path = (Path(service.__file__).parent / place / name).resolve()
        if path.is_file():
            return path
    raise FileNotFoundError(f"{name} is missing: the program is not completely installed")
