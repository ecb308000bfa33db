"""The units of the signals of an axis as its records state them, and signals that are not converted to SI units."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from service.can.messages import find_signal
from service.config.bus_messages import messages_of
from service.config.schema import Config, NamedAxis, SignalConfig
from service.config.unit_names import UNITS, MeasuredQuantity, unit_as_recorded
from service.ingest.records.record_files import is_table
from service.ingest.tables.table_files import open_table

Signal = Literal["torque", "motion"]


def unit_text(config: Config, axis: NamedAxis, signal: Signal, path: Path) -> str:
    """The text that names the unit: from the table's line of units, the column name, or the description of the bus.

    Raises:
        RecordError: the file cannot be read.
        DescriptionError: the bus cannot be decoded as configured.
    """
    source = axis.config.torque if signal == "torque" else axis.config.motion
    if is_table(path):
        column = source.column or ""
        return open_table(path).units.get(column) or column
    known = messages_of(config, axis.config.bus)
    return find_signal(known, source.message, source.signal)[1].unit or ""


def units_as_recorded(config: Config, axis: NamedAxis, path: Path) -> Iterator[str]:
    """Remarks on signals that are not in SI units, as a factor is missing, so that units in reports are wrong.

    Raises:
        RecordError, DescriptionError: as of ``unit_text``.
    """
    own = axis.config
    motion: MeasuredQuantity = "angle" if own.output == "angle" else "speed"
    signals: tuple[tuple[Signal, MeasuredQuantity, SignalConfig], ...] = (
        *((("torque", "torque", own.torque),) if own.torque.kT_Nm_per_A is None else ()),
        ("motion", motion, own.motion),
    )
    for signal, quantity, source in signals:
        text, si = unit_text(config, axis, signal, path), UNITS[quantity]
        unit = unit_as_recorded(text, quantity, source.factor)
        if unit is not None:
            yield (
                f"The {quantity} is in {unit.words} ({text}), and {quantity}.factor = {source.factor:g} does not"
                f" convert it: where this report and its files state {si}, it is {unit.words}."
                f" {quantity}.factor = {unit.missing} converts it to {si}; changes in percent are the same."
            )
