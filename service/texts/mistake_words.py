"""What a validation has found, in words."""

from collections.abc import Mapping
from typing import Any

from monitor_core.wording import sentence

_LIMITS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}


def at_place(place: str, error: Mapping[str, Any]) -> str:
    """What pydantic has found wrong at a place, such as a key: its words, and where it is a usual mistake its kind."""
    words, values = error["msg"].removeprefix("Value error, "), error.get("ctx", {})
    template = "{place}: {words}"
    for name, sign in _LIMITS.items():
        if isinstance(limit := values.get(name), int | float):
            return sentence(
                "out of limits", template, place=place, words=words, sign=sign, limit=f"{limit:g}"
            )
    if error["type"] == "missing":
        return sentence("key missing", template, place=place, words=words)
    if error["type"].endswith(("_type", "_parsing")):
        return sentence("other kind", template, place=place, words=words)
    return f"{place}: {words}"
