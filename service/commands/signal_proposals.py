"""What records show to be wrong with the configured signals of an axis, and the change that puts it right."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from service.commands.output_files import replace_text
from service.config import Config, NamedAxis, load
from service.config.commissioned import Correction, corrected

if TYPE_CHECKING:
    from monitor_core.identification import Known, Record

_SAME_INTERVAL = 0.01
"""Relative: a measured interval that differs by less is the configured one."""
_UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
"""Of times, by how many of them are a second."""
_ABOUT = 2.5
"""Times in another unit need not have the configured interval; by this factor they may differ."""
_EXPLAINS = 0.3
"""Of the variance of the torque, by which two axes explain more with their torques exchanged."""
_ROUNDS = 4
"""One mistake hides another: after a correction it is looked again."""


class _Checked(NamedTuple):
    axis: NamedAxis
    records: Sequence[Record]
    known: Known


def proposals(text: str, axis_id: str, records: Sequence[str], folder: Path) -> list[Correction]:
    """Corrections of the signals of an axis, in the order in which they are to be made.

    Args:
        text: of a configuration that is valid in ``folder``.
        axis_id: "robot.axis".
        records: files, each with or without a range.
        folder: where files may be written.

    Raises:
        RecordError, DbcError, IngestError: a record cannot be read.
    """
    found: list[Correction] = []
    for _ in range(_ROUNDS):
        checked = _checked(*configured(corrected(text, axis_id, found), axis_id, folder), records)
        new = next((c for check in _CHECKS for c in check(checked)), None)
        if new is None or any(new.key == before.key for before in found):
            break
        found.append(new)
    return found


def exchanged(text: str, records: Sequence[str], folder: Path) -> dict[str, Correction]:
    """Axes of a robot whose torques are those of each other, by their names: with the column that is theirs."""
    from monitor_core.identification import rigid_fit

    config, _ = configured(text, None, folder)
    axes = [axis for axis in config.axes if axis.config.torque.column is not None]
    loaded = {axis.id: _records(config, axis, records[:1])[0] for axis in axes}

    def explained(torque: NamedAxis, motion: NamedAxis) -> float:
        fit = rigid_fit(replace(loaded[motion.id], u=loaded[torque.id].u))
        return fit.explained if fit is not None and fit.inertia > 0 else 0.0

    found: dict[str, Correction] = {}
    for first, second in combinations(axes, 2):
        if first.robot != second.robot or len(loaded[first.id]) != len(loaded[second.id]):
            continue
        now = max(explained(first, first), explained(second, second))
        if min(explained(second, first), explained(first, second)) > now + _EXPLAINS:
            for axis, partner in ((first, second), (second, first)):
                reason = f"the motion of this axis follows the torque of {partner.config.name}"
                column = str(partner.config.torque.column)
                found[axis.id] = Correction(("torque", "column"), column, reason)
    return found


def configured(text: str, axis_id: str | None, folder: Path) -> tuple[Config, NamedAxis]:
    """A configuration of this text, valid in a folder, and one of its axes: that named, or the first."""
    path = folder / f".{axis_id or 'robot'}.toml"
    replace_text(path, text)
    try:
        config = load(path)
    finally:
        path.unlink()
    return config, next(axis for axis in config.axes if axis_id in (None, axis.id))


def _records(config: Config, axis: NamedAxis, records: Sequence[str]) -> list[Record]:
    from service.ingest.identification_records import load as load_record

    return [load_record(record, config, axis.id).record for record in records]


def _checked(config: Config, axis: NamedAxis, records: Sequence[str]) -> _Checked:
    from monitor_core.identification import Known, known_of
    from service.commands.identification_task import known_values
    from service.config.drive_sources import model_of_axis

    drive = model_of_axis(axis.config).drive
    values, unknown = known_values(axis, drive)
    known = Known() if unknown else known_of(drive, values, 0, axis.config.model.friction_speed_scale)
    return _Checked(axis, _records(config, axis, records), known)


# --- The checks, in the order in which their corrections are to be made -----------------------------------------------


def _unit_of_time(checked: _Checked) -> Iterator[Correction]:
    ratio = _interval_s(checked) / checked.axis.config.sample_interval_s
    for factor, unit in _UNITS.items():
        if checked.axis.config.time.column is not None and 1 / _ABOUT < ratio / factor < _ABOUT:
            yield Correction(("time", "factor"), 1 / factor, f"the times look like {unit}")


def _interval(checked: _Checked) -> Iterator[Correction]:
    configured_s, measured_s = checked.axis.config.sample_interval_s, _interval_s(checked)
    if not math.isclose(measured_s, configured_s, rel_tol=_SAME_INTERVAL):
        reason = f"the samples of the records are {measured_s:.6g} s apart, not {configured_s:g} s"
        yield Correction(("sample_interval_s",), float(f"{measured_s:.5g}"), reason)


def _interval_s(checked: _Checked) -> float:
    """The median of the records."""
    return sorted(record.mean_interval_s for record in checked.records)[len(checked.records) // 2]


def _sign(checked: _Checked) -> Iterator[Correction]:
    from monitor_core.identification import suspicions

    for finding in (f for record in checked.records for f in suspicions(record)):
        if finding.kind == "wrong-sign":
            reason = f"{finding.sentence} (or turn that of the motion)"
            yield Correction(("torque", "factor"), -checked.axis.config.torque.factor, reason)


def _units(checked: _Checked) -> Iterator[Correction]:
    from monitor_core.identification import slip_of, suspicions

    axis = checked.axis.config
    for finding in (f for record in checked.records for f in suspicions(record, checked.known)):
        slip = slip_of(finding.number) if finding.kind == "units" else None
        if slip is not None:
            key = "torque" if slip.signal == "torque" else axis.output
            before = (axis.torque if slip.signal == "torque" else axis.motion).factor
            yield Correction((key, "factor"), before * slip.unit, finding.sentence)


_CHECKS: tuple[Callable[[_Checked], Iterator[Correction]], ...] = (_unit_of_time, _interval, _sign, _units)
