"""Records for calibration: read by the pipeline of the daemon, with operating conditions."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.drive import AxisModel, Operating
from monitor_core.samples import SampleBlock, concatenate
from service.can.user_errors import RecordError
from service.config import Config, NamedAxis, conditions_of
from service.ingest.identification_records import wanted
from service.ingest.records import read_record
from service.ingest.unwrap import turns_of


class Source(NamedTuple):
    """Origin of the samples."""

    text: str
    """As on the command line: a file, and seconds in it"""
    sha256: str
    samples: int
    seconds: float


def read(
    texts: Sequence[str],
    config: Config,
    axis: NamedAxis,
    model: AxisModel,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[list[SampleBlock], list[Source]]:
    """All records of an axis.

    Raises:
        RecordError: a file cannot be read, or has no samples of the axis.
        DbcError, IngestError: the configuration cannot be used.
    """
    samples, sources = [], []
    for number, text in enumerate(texts):
        want = wanted(text)
        blocks = []
        for step in read_record(want.path, config).steps():
            if axis.id in step.samples:
                blocks.append(step.samples[axis.id])
            progress((number + step.done) / len(texts))
        if not blocks:
            raise RecordError(f"{want.path}: no samples of axis {axis.id}")
        record = _samples(want.path.name, concatenate(blocks), axis, model)
        since = (record.t_us - record.t_us[0]) * 1e-6
        start, end = np.searchsorted(
            since, [want.start_s or 0.0, np.inf if want.end_s is None else want.end_s]
        )
        record = record.select(slice(int(start), int(end)))
        if len(record.t_us) < 2:
            raise RecordError(f"{text}: {len(record.t_us)} samples of axis {axis.id} in that range")
        samples.append(record)
        digest = hashlib.sha256(want.path.read_bytes()).hexdigest()
        sources.append(Source(text, digest, len(record.t_us), float(record.t_us[-1] - record.t_us[0]) * 1e-6))
    return samples, sources


def _samples(name: str, block: SampleBlock, axis: NamedAxis, model: AxisModel) -> SampleBlock:
    turns = turns_of(axis.config)
    if turns is not None:
        angle, sure = turns.take(block.t_us, block.y)
        block = block._replace(y=angle).select(sure)
    conditions = conditions_of(axis)
    shift = gate = None
    if conditions:
        shift, gate = Operating(model, conditions).take(block.t_us, block.y, block.signals)
    return SampleBlock(block.t_us, block.u, block.y, shift, gate, name=name)
