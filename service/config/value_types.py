"""What the values of the configuration are: numbers with bounds, names, paths, defaults in samples."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationInfo

from service.config.base_table import Reading
from service.config.drive_sources import SUFFIX

Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Real, Field(gt=0)]
NotNegative = Annotated[Real, Field(ge=0)]
Text = Annotated[str, Field(min_length=1)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]


def _from_folder(value: object, info: ValidationInfo) -> object:
    if not isinstance(value, str | Path) or value == "" or "\0" in str(value):
        raise ValueError("must be a path in quotes")
    return info.context.folder / value if isinstance(info.context, Reading) else value


FilePath = Annotated[Path, BeforeValidator(_from_folder)]


def _drive_from_folder(value: object, info: ValidationInfo) -> object:
    if not isinstance(value, str) or not value.endswith(SUFFIX):
        return value
    return str(_from_folder(value, info))


DriveName = Annotated[str, BeforeValidator(_drive_from_folder), Field(min_length=1)]
"""A name of the library, or a Modelica file relative to the folder of the configuration."""


def intervals(count: float) -> Callable[[dict[str, Any]], Any]:
    """A default of so many sample intervals."""

    def default(validated: dict[str, Any]) -> Any:
        return count * validated["sample_interval_s"]

    return default
