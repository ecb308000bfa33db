"""Base class of the configuration's tables, types of their values, and keys of earlier versions."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo


class Undecidable(LookupError):  # noqa: N818 - it only ends a cross-check, users never see it
    """A cross-check is not possible, because of a mistake that another check reports."""


@dataclass(frozen=True, slots=True)
class ReadingContext:
    """Context of reading: relative paths start at ``folder``; ``thresholds``: whether to read threshold files."""

    folder: Path
    thresholds: bool = True


class TomlTable(BaseModel):
    """A TOML table: immutable; unknown keys are errors.  The docstring of a key is shown with mistakes in that key."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    @classmethod
    def meaning(cls, key: str) -> str:
        """The docstring of a key, in one line."""
        return " ".join((cls.model_fields[key].description or "").split())


# --- Types of values: numbers with bounds, names, paths ---------------------------------------------------------------


GEAR_RATIO = "r"
"""The parameter of a library drive that is the angle of the arm over that of the motor"""
SUFFIX = ".mo"
"""A drive whose name ends with this is a Modelica file; any other is a drive of the library."""


def _not_zero(value: float) -> float:
    if value == 0:
        raise ValueError("must not be 0")
    return value


Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Real, Field(gt=0)]
NotNegative = Annotated[Real, Field(ge=0)]
NonZero = Annotated[Real, AfterValidator(_not_zero)]
NonEmptyText = Annotated[str, Field(min_length=1)]
PlainName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]


def from_folder(value: object, info: ValidationInfo) -> Path:
    """A path relative to the folder of the configuration.

    Raises:
        ValueError: the value is no path.
    """
    if not isinstance(value, str | Path) or value == "" or "\0" in str(value):
        raise ValueError("must be a path in quotes")
    return info.context.folder / value if isinstance(info.context, ReadingContext) else Path(value)


FilePath = Annotated[Path, BeforeValidator(from_folder)]


def _drive_from_folder(value: object, info: ValidationInfo) -> object:
    if not isinstance(value, str) or not value.endswith(SUFFIX):
        return value
    return str(from_folder(value, info))


DriveName = Annotated[str, BeforeValidator(_drive_from_folder), Field(min_length=1)]
"""Name of a library drive, or of a Modelica file relative to the folder of the configuration."""


def written(pattern: str, right: str) -> AfterValidator:
    """Validator for a text that matches the pattern; ``right``: description of the right form."""

    def check(text: str) -> str:
        if not re.fullmatch(pattern, text):
            raise ValueError(f"must be {right}")
        return text

    return AfterValidator(check)


# --- Keys of earlier versions: an old key is an error that says what to write instead ---------------------------------


RENAMED_KEYS: Mapping[str, str] = {
    "dbc": "messages",
    "averaged": "interval_mean",
    "least_excitation": "min_excitation",
    "least_information": "information_floor",
    "least_speed": "min_speed",
    "maximum_age_s": "max_age_s",
    "maximum_gap_s": "max_gap_s",
    "varying": "schedule",
    "warn_before": "lead_time",
    "widening": "covariance_reset",
    "wraps_at": "wrap_period",
}
"""Keys of earlier versions with their new names"""
REMOVED_KEYS: Mapping[str, str] = {
    "components": 'draw the drive as a Modelica file, and give drive = "....mo" instead',
    "forgetting": "give memory_s = sample_interval_s / (1 - forgetting) instead",
    "history_length_s": "the history is kept in a file: give history_raw_days instead",
    "gain": "follows from torque_noise and output_noise, or from an identification: give nominal_file",
    "random_walk": "the parameters are always followed with forgetting (memory_s): leave it out",
    "password": "a secret does not belong here: write it into a file, and give password_file, or password_env",
    "secret": "a secret does not belong here: write it into a file, and give secret_file, or secret_env",
    "speed_noise": "angle and speed are no longer used together: give one of the two tables, and output_noise for it",
}


def hint(key: str) -> str | None:
    """What to do with a key of an earlier version, or with a key for a secret; None: it never was a key."""
    if key in RENAMED_KEYS:
        return f"is now called {RENAMED_KEYS[key]}"
    return REMOVED_KEYS.get(key)
