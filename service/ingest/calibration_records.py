"""Records for calibration, with operating conditions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.drive import AxisModel
from monitor_core.monitoring import conditioned_records
from monitor_core.samples import SampleBlock
from service.can.user_errors import RecordError
from service.config import Config, NamedAxis, conditions_of
from service.config.axis_settings import axis_settings
from service.config.conditions import needed
from service.ingest.axis_records import axis_record, sha256_of, wanted, why_none


class SamplesOrigin(NamedTuple):
    """Origin of the samples."""

    text: str
    """As on the command line: a file, and seconds in it"""
    sha256: str
    samples: int
    seconds: float


_SAME_S = 1e-3
"""Times in a file of nominal values are rounded."""


def begins_cold(axis: NamedAxis, texts: Sequence[str]) -> bool:
    """Whether the axis was cold at the beginning of these records, as its identification took the same ones to be.

    Raises:
        RecordError: the first of them cannot be read.
    """
    found = axis.config.model.nominal_file
    if found is None or found.thermal is None or found.thermal.first_w != 0 or not found.record:
        return False
    want, first = wanted(texts[0]), found.record[0]
    return abs((want.start_s or 0.0) - first.range_s[0]) < _SAME_S and sha256_of(want.path) == first.sha256


def read(
    texts: Sequence[str],
    config: Config,
    axis: NamedAxis,
    model: AxisModel,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[list[SampleBlock], list[SamplesOrigin]]:
    """All records of an axis.

    Raises:
        RecordError: a file cannot be read, or has no samples of the axis.
        DescriptionError, IngestError: the configuration cannot be used.
    """
    samples, sources = [], []
    for number, text in enumerate(texts):
        want = wanted(text)

        def part(done: float, before: int = number) -> None:
            progress((before + done) / len(texts))

        block, dropped, _ = axis_record(want.path, config, axis, needed(axis), part)
        if not block.size:
            why = why_none(want.path, config, axis, dropped)
            raise RecordError(f"{want.path}: no samples of axis {axis.id}; {why}")
        block = block._replace(name=want.path.name)
        since = (block.t_us - block.t_us[0]) * 1e-6
        start, end = np.searchsorted(
            since, [want.start_s or 0.0, np.inf if want.end_s is None else want.end_s]
        )
        block = block.select(slice(int(start), int(end)))
        if block.size < 2:
            raise RecordError(f"{text}: {block.size} samples of axis {axis.id} in that range")
        samples.append(block)
        seconds = float(block.t_us[-1] - block.t_us[0]) * 1e-6
        sources.append(SamplesOrigin(text, sha256_of(want.path), block.size, seconds))
    conditions = conditions_of(axis)
    if conditions:
        samples = conditioned_records(model, axis_settings(axis, model), conditions, samples)
    return samples, sources
