"""The base of every table of the configuration, and what reading one needs."""

from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict


class Undecidable(LookupError):  # noqa: N818 - it ends a cross-check, nobody sees it
    """A cross-check cannot be made, because of a mistake that another one reports."""


@dataclass(frozen=True, slots=True)
class Reading:
    """How tables are read: ``folder`` is where relative paths start."""

    folder: Path


class Table(BaseModel):
    """A TOML table: immutable, unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)
