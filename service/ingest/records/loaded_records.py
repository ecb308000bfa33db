"""Loads records of an axis with their origin: for identification, and as blocks of samples for calibration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from monitor_core.arrays import Bools
from monitor_core.drive import AxisModel, OpenGates, Operating
from monitor_core.identification import Record, RecordPart
from monitor_core.monitoring import conditioned_records
from monitor_core.samples import SampleBlock, joined_where_continued
from service.can.user_errors import RecordError
from service.config import Config, NamedAxis, conditions_of
from service.config.axis_settings import axis_settings
from service.config.conditions import gates_of, needed
from service.config.schema import FurtherSignalConfig
from service.ingest.records.axis_records import ReadProgress, axis_record, no_samples_words, sha256_of
from service.ingest.records.record_files import is_table
from service.ingest.records.record_ranges import wanted

_NAMED = 3
"""Number of unreadable places that a message names."""
_CONTINUED = 10
"""A record continues another one if at most so many intervals lie between them."""


@dataclass(frozen=True)
class RecordOrigin:
    """Origin of the samples of an axis, to be stated in results.

    ``text``: argument of the command line, a file and a range.  ``path``: the file.  ``samples``: number of samples of
    the axis in the whole file.  ``used``: number in the range.  ``dropped``: number of dropped table rows or log values
    by reason.
    """

    text: str
    path: Path
    sha256: str
    samples: int
    used: int
    start_s: float
    end_s: float
    dropped: Mapping[str, int]
    begins_s: float | None = None
    """Time of the first used sample, by the clock of the file [s]; None: not known"""
    left_out: Sequence[str] = ()
    """Lines or other parts of the file that could not be read, with their positions"""

    @property
    def words(self) -> str:
        """The origin in one line for the user."""
        complete = self.used == self.samples
        part = "" if complete else f", {self.used} of them from {self.start_s:g} to {self.end_s:g} s"
        lost = ", ".join(f"{n} {reason.replace('_', ' ')}" for reason, n in self.dropped.items() if n)
        places = f" ({'; '.join(self.left_out[:_NAMED])})" if self.left_out else ""
        return f"{self.path}: {self.samples} samples{part}; dropped: {lost or 'nothing'}{places}"


class Loaded(NamedTuple):
    """A record and its origin."""

    record: Record
    source: RecordOrigin


def load(text: str, config: Config, axis_id: str) -> Loaded:
    """Load the record of a configured axis ("robot.axis"), with those of its auxiliary signals that the file has.

    ``text``: a file, with or without a range; see ``wanted``.

    Raises:
        RecordError: the file cannot be read, is damaged, or has too few samples of the axis.
        DescriptionError: the configuration cannot be used.
    """
    axis = next(axis for axis in config.axes if axis.id == axis_id)
    signals = _signals_in(wanted(text).path, axis)
    block, source = samples_in(text, config, axis, signals)
    block = block._replace(name=source.path.name, gate=_gate(axis, [s.name for s in signals], block))
    record = Record.from_samples(block, axis.config.output, [s.name for s in signals], source.start_s)
    return Loaded(record, source)


def _gate(axis: NamedAxis, signals: Sequence[str], block: SampleBlock) -> Bools | None:
    """Whether the gates of the axis are open (N,), as far as the record has their signals; None: it has none of them.

    Without them it is taken as recorded while they were open, such as a planned motion that was recorded on its own.
    """
    if block.signals is None:
        return None
    values = dict(zip(signals, block.signals.T, strict=True))
    gates = [gate for gate in gates_of(axis.config) if gate.signal in values]
    return OpenGates(gates).take(block.t_us, values) if gates else None


def loaded_part(loaded: Loaded, part: RecordPart) -> Loaded:
    """A part of a loaded record, and its origin."""
    record = part.record
    if record is loaded.record:
        return loaded
    start_s, end_s = float(record.t[0]), float(record.t[-1])
    source = replace(loaded.source, used=len(record), start_s=start_s, end_s=end_s, begins_s=part.begins_s)
    return Loaded(record, source)


def load_samples(
    texts: Sequence[str],
    config: Config,
    axis: NamedAxis,
    model: AxisModel,
    progress: ReadProgress = lambda _: None,
) -> tuple[list[SampleBlock], list[RecordOrigin]]:
    """Load records of an axis as blocks of samples, with the operating conditions that its monitoring needs.

    Files that continue one another, as of a recorder that begins another file each minute, are one block.

    Raises:
        RecordError: a file cannot be read, or has no samples of the axis.
        DescriptionError: the configuration cannot be used.
    """
    samples, sources = [], []
    for number, text in enumerate(texts):

        def part(done: float, before: int = number) -> None:
            progress((before + done) / len(texts))

        block, source = samples_in(text, config, axis, needed(axis), part)
        samples.append(block._replace(name=source.path.name))
        sources.append(source)
    samples = joined_where_continued(samples, _CONTINUED * 1e6 * axis.config.sample_interval_s)
    conditions = conditions_of(axis)
    if Operating(model, conditions).needed:
        samples = conditioned_records(model, axis_settings(axis, model), conditions, samples)
    return samples, sources


def samples_in(
    text: str,
    config: Config,
    axis: NamedAxis,
    signals: Sequence[FurtherSignalConfig],
    progress: ReadProgress = lambda _: None,
) -> tuple[SampleBlock, RecordOrigin]:
    """Load the samples of an axis from a file, with or without a range; see ``wanted``.

    Raises:
        RecordError: the file cannot be read, or has fewer than two samples of the axis in the range.
        DescriptionError: the configuration cannot be used.
    """
    want = wanted(text)
    block, dropped, left_out = axis_record(want.path, config, axis, signals, progress)
    if block.size < 2:
        why = no_samples_words(want.path, config, axis, dropped)
        raise RecordError(f"{want.path}: {block.size} samples of axis {axis.id} in it; {why}")
    since_s = (block.t_us - block.t_us[0]) * 1e-6
    inside = since_s >= (want.start_s or 0.0)
    if want.end_s is not None:
        inside &= since_s <= want.end_s
    used = block if inside.all() else block.select(inside)
    if used.size < 2:
        raise RecordError(
            f"{text}: {used.size} samples of axis {axis.id} in that range; the record is {since_s[-1]:g} s long"
        )
    start_s, end_s = (float(s) for s in since_s[inside][[0, -1]])
    source = RecordOrigin(
        text,
        want.path,
        sha256_of(want.path),
        block.size,
        used.size,
        start_s,
        end_s,
        dropped,
        float(used.t_us[0]) * 1e-6,
        left_out,
    )
    return used, source


def _signals_in(path: Path, axis: NamedAxis) -> Sequence[FurtherSignalConfig]:
    if is_table(path):
        return [source for source in axis.sources if source.column is not None]
    return [source for source in axis.sources if source.message is not None and source.signal is not None]


_SAME_S = 1e-3
"""Tolerance of times, as those in a nominal file are rounded."""


def begins_cold(axis: NamedAxis, texts: Sequence[str]) -> bool:
    """Whether the axis was cold at the start of these records.

    This is so if its identification used the same start and took the axis as cold there.

    Raises:
        RecordError: the first record cannot be read.
    """
    found = axis.config.model.nominal_file
    if found is None or found.thermal is None or found.thermal.first_w != 0 or not found.record:
        return False
    want, first = wanted(texts[0]), found.record[0]
    return abs((want.start_s or 0.0) - first.range_s[0]) < _SAME_S and sha256_of(want.path) == first.sha256
