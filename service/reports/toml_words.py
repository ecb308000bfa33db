"""Values as TOML writes them."""

from __future__ import annotations

import json

_DIGITS = 10


def toml_value(value: bool | float | str | list[float] | list[str]) -> str:
    """A value; numbers with ten digits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, str):
        # JSON's escapes are TOML's, too, but for the delete character, which TOML wants escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    text = f"{float(value):.{_DIGITS}g}"
    return text if any(letter in text for letter in ".en") else f"{text}.0"


def toml_key(name: str) -> str:
    """A key, in quotes where it must be."""
    plain = name.replace("_", "")
    return name if plain.isascii() and plain.isalnum() else toml_value(name)
