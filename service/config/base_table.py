"""Base class of the tables of the configuration, and the types of their values."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo


class Undecidable(LookupError):  # noqa: N818 - it ends a cross-check, nobody sees it
    """A cross-check is not possible because of a mistake that another check reports."""


@dataclass(frozen=True, slots=True)
class Reading:
    """Context of reading tables: relative paths start at ``folder``; files of thresholds may be ignored."""

    folder: Path
    thresholds: bool = True


class Table(BaseModel):
    """A TOML table: immutable, unknown keys are errors.  The text below a key is shown with mistakes in it."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    @classmethod
    def meaning(cls, key: str) -> str:
        """The text below a key, in one line."""
        return " ".join((cls.model_fields[key].description or "").split())


# --- What the values of the configuration are: numbers with bounds, names, paths, defaults in samples -----------------


SUFFIX = ".mo"
"""A drive whose name ends so is a Modelica file, else one of the library."""

Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Real, Field(gt=0)]
NotNegative = Annotated[Real, Field(ge=0)]
Text = Annotated[str, Field(min_length=1)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]


def from_folder(value: object, info: ValidationInfo) -> Path:
    """A path relative to the folder of the configuration.

    Raises:
        ValueError: it is no path.
    """
    if not isinstance(value, str | Path) or value == "" or "\0" in str(value):
        raise ValueError("must be a path in quotes")
    return info.context.folder / value if isinstance(info.context, Reading) else Path(value)


FilePath = Annotated[Path, BeforeValidator(from_folder)]


def _drive_from_folder(value: object, info: ValidationInfo) -> object:
    if not isinstance(value, str) or not value.endswith(SUFFIX):
        return value
    return str(from_folder(value, info))


DriveName = Annotated[str, BeforeValidator(_drive_from_folder), Field(min_length=1)]
"""A name of the library, or a Modelica file relative to the folder of the configuration."""


def intervals(count: float) -> Callable[[dict[str, Any]], Any]:
    """A default given in sample intervals."""

    def default(validated: dict[str, Any]) -> Any:
        return count * validated["sample_interval_s"]

    return default


# --- Times as people write them: 10min, 1h, "14 days" -----------------------------------------------------------------


_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0, "y": 31557600.0}
_TIME = re.compile(r"(?P<number>[\d.]+)\s*(?P<unit>[a-z]*)")
_SPELLED = {"hour": "h", "day": "d", "week": "w", "year": "y", "minute": "min", "second": "s", "m": "min"}
_LONGEST_S = 1000 * _UNITS["y"]


def seconds_in(text: str) -> float:
    """A time such as 10min, 1h, 30d, 1y, "2 hours", or seconds.

    Raises:
        ValueError: the text is no time, or less than a second, or more than a thousand years.
    """
    match = _TIME.fullmatch(text.strip().lower())
    unit = (match["unit"] if match else "") or "s"
    unit = next((short for word, short in _SPELLED.items() if unit in (word, f"{word}s")), unit)
    try:
        seconds = float(match["number"]) * _UNITS[unit] if match else 0.0
    except (ValueError, KeyError):
        seconds = 0.0
    if not 1 <= seconds <= _LONGEST_S:
        raise ValueError(f"{text}: write a time, such as 10min, 1h, 30d or 1y")
    return seconds
