"""Axes of a robot whose torques were exchanged with each other."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import Record, rigid_fit, speed_scales
from service.commands.commissioning.signals.checked_axis import configured
from service.config import Config, NamedAxis
from service.config.commissioned import Correction
from service.ingest.loaded_records import Loaded, load

_MIN_EXCHANGE_GAIN = 0.3
"""Share of the variance of the torque that two axes must explain better with exchanged torques."""
_MAX_SAMPLES = 50_000
"""Number of samples that are compared."""
_AS_LONG = 0.95
"""Share of the longest record of an axis: on a bus some axes lose a few samples."""


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
    from scipy.optimize import linear_sum_assignment

    loaded = {axis.id: load(record, config, axis.id) for axis in axes}
    longest = max(len(item.record) for item in loaded.values())
    # Other axes have another interval, or their samples are from another time.
    axes = [axis for axis in axes if len(loaded[axis.id].record) >= _AS_LONG * longest]
    part = slice(min(longest, _MAX_SAMPLES))
    moved = [item._replace(record=item.record.select(part)) for item in (loaded[axis.id] for axis in axes)]
    explained = np.array(
        [[_explained(motion.record, _torque_at(motion, torque)) for torque in moved] for motion in moved]
    )
    # The right torque explains the motion best. Small differences are no reason for a proposal.
    _, best = linear_sum_assignment(-explained - _MIN_EXCHANGE_GAIN * np.eye(len(axes)))
    now = explained.diagonal()
    changed = [k for k, other in enumerate(best.tolist()) if other != k]
    if not changed or min(explained[k, best[k]] - now[k] for k in changed) < _MIN_EXCHANGE_GAIN:
        return {}
    return {axes[k].id: tuple(_torque_of(axes[k], axes[best[k]])) for k in changed}


def _torque_at(motion: Loaded, torque: Loaded) -> Floats:
    """The torque of an axis at the nearest samples of another one, by the clock of the file."""
    earlier_s = (motion.source.begins_s or 0.0) - (torque.source.begins_s or 0.0)
    t, at = torque.record.t, motion.record.t + earlier_s
    return torque.record.u[np.searchsorted((t[1:] + t[:-1]) / 2, at)]


def _explained(motion: Record, torque: Floats) -> float:
    """Share of the torque that is explained if it drives a mass with this motion."""
    if np.ptp(torque) == 0 or np.ptp(motion.y[motion.measured]) == 0:
        return 0.0
    record = replace(motion, u=torque)
    fit = rigid_fit(record, speed_scales([record])[1])
    return 0.0 if fit is None else max(0.0, fit.explained)  # of either sign, which is looked at afterwards


def _torque_of(axis: NamedAxis, partner: NamedAxis) -> Iterator[Correction]:
    reason = f"the motion of this axis follows the torque of {partner.config.name}"
    mine, other = axis.config.torque, partner.config.torque
    for key in ("column", "message", "signal"):
        value = getattr(other, key)
        if value and value != getattr(mine, key):
            yield Correction(("torque", key), value, reason)
