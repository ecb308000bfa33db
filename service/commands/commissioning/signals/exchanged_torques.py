"""Axes of a robot whose torques were exchanged with each other."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from monitor_core.identification import matching_torques
from service.config import Config, NamedAxis
from service.config.written.commissioned import configured
from service.config.written.corrections import Correction
from service.ingest.records.loaded_records import load


def exchanged(text: str, records: Mapping[str, Sequence[str]], folder: Path) -> dict[str, tuple[Correction, ...]]:
    """Axes of a robot with the torque of another one, by name; each with the right signal.

    ``records``: of each axis; the first ones are compared.  Axes without records are skipped.
    """
    config, _ = configured(text, None, folder)
    found: dict[str, tuple[Correction, ...]] = {}
    for robot in config.robot:
        axes = [axis for axis in config.axes if axis.robot == robot.name and records.get(axis.id)]
        if axes:
            first = [records[axis.id][0] for axis in axes]
            shared = max(first, key=first.count)
            beside = [axis for axis, record in zip(axes, first, strict=True) if record == shared]
            found |= _exchanged_in(config, beside, shared)
    return found


def _exchanged_in(config: Config, axes: Sequence[NamedAxis], record: str) -> dict[str, tuple[Correction, ...]]:
    """Exchanged torques of one robot in one record."""
    loaded = [load(record, config, axis.id) for axis in axes]
    found = matching_torques([item.record for item in loaded], [item.source.begins_s or 0.0 for item in loaded])
    partners = zip(axes, (axes[k] for k in found), strict=True)
    return {axis.id: tuple(_torque_of(axis, partner)) for axis, partner in partners if partner is not axis}


def _torque_of(axis: NamedAxis, partner: NamedAxis) -> Iterator[Correction]:
    reason = f"the motion of this axis follows the torque of {partner.config.name}"
    mine, other = axis.config.torque, partner.config.torque
    for key in ("column", "message", "signal"):
        value = getattr(other, key)
        if value and value != getattr(mine, key):
            yield Correction(("torque", key), value, reason)
