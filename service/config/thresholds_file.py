"""thresholds.toml: the result of `axiswatch calibrate`, as the configuration and the daemon read it."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import Literal

from pydantic import Field

from service.config.base_table import NotNegative, Positive, Real, Undecidable
from service.config.found_file import FoundTable, content_of, unchanged, validated
from service.config.schema import AxisConfig

FORMAT = 1
"""Of the file; a later one may mean something else."""
KIND = "thresholds"


class ThresholdsError(Exception):
    """A file of thresholds that cannot be used; the text names it and says why."""


class ThresholdTable(FoundTable):
    """[[threshold]]: nu = alpha_1 sqrt(lambda_0 P_ii) + allowance * size, h = alpha_2 * size."""

    parameter: str
    alpha_1: NotNegative
    alpha_2: Positive
    allowance: NotNegative


class HypothesisTable(FoundTable):
    """[[hypothesis]]: one of the multi-model detector; alarm when its g exceeds h.  Some have no size."""

    cause: str
    size: Real | None = None
    h: Positive
    allowance: NotNegative = 0.0
    alike: tuple[str, ...] = ()

    @property
    def size_or_nan(self) -> float:
        """The size as the multi-model detector has it."""
        return math.nan if self.size is None else self.size


class ThresholdsFile(FoundTable):
    """The whole file.  ``made_with`` and ``nominal`` are of the monitor that the thresholds belong to."""

    path: Path
    format: Literal[1]
    kind: Literal["thresholds"]
    axis: str
    date: str
    made_with: dict[str, bool | float | str | list[float] | list[str]]
    nominal: dict[str, Real]
    threshold: tuple[ThresholdTable, ...] = Field(min_length=1)
    hypothesis: tuple[HypothesisTable, ...] = ()
    """Of the multi-model detector, where it was calibrated, too"""


def thresholds_file_of(axis: AxisConfig) -> ThresholdsFile | None:
    """The file of thresholds of an axis, None if it has none.

    Raises:
        Undecidable: it cannot be used, which a rule of the configuration says.
    """
    if axis.model.thresholds_file is None:
        return None
    try:
        return read_thresholds(axis.model.thresholds_file)
    except ThresholdsError:
        raise Undecidable("thresholds_file") from None


def read_thresholds(path: Path) -> ThresholdsFile:
    """The file, kept until it changes.

    Raises:
        ThresholdsError: it cannot be read, or is no such file.
    """
    return unchanged(path, _read, ThresholdsError)


@lru_cache(maxsize=256)
def _read(path: Path, _mtime_ns: int, _size: int) -> ThresholdsFile:
    content = content_of(path, ThresholdsError)
    if (content.get("format"), content.get("kind")) != (FORMAT, KIND):
        raise ThresholdsError(f"{path}: a file of thresholds is what `axiswatch calibrate` writes")
    return validated(ThresholdsFile, content, path, ThresholdsError)
