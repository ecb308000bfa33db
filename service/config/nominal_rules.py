"""Cross-checks of a file of nominal values: it belongs to this drive and does not contradict the configuration.

Nominal values belong to the predictor of their identification: with another gain, delay or interval theta converges to
other values, which the tests would report as a fault.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

from monitor_core.drive import Drive, Output
from service.config.base_table import Table, Undecidable
from service.config.drives import plain_drive_of
from service.config.model_rules import usable_drive
from service.config.nominal import nominal_file_of
from service.config.nominal_file import NominalError, NominalFile, read_nominal, structure_of
from service.config.positions import Keys
from service.config.schema import AxisConfig
from service.config.validation_messages import Finding

FILE: Keys = ("model", "nominal_file")
_SAME = 1e-6
"""Relative: values are written with ten digits, and copied with fewer."""
_INTERVAL = 0.01
"""Relative: measured intervals are never quite the nominal one."""


def readable(axis: AxisConfig) -> Iterator[Finding]:
    """The file is there and is what it should be."""
    if axis.model.nominal_file is not None:
        try:
            read_nominal(axis.model.nominal_file)
        except NominalError as error:
            yield Finding(FILE, str(error))


def same_axis(axis: AxisConfig) -> Iterator[Finding]:
    """The file was found with what is measured here, at this interval."""
    found = _found(axis)
    if found.drive.output != _measured(axis):
        yield Finding(
            FILE, f"found with the {found.drive.output}, but this axis measures the {_measured(axis)}"
        )
    interval_s = found.predictor.interval_s
    if not math.isclose(interval_s, axis.sample_interval_s, rel_tol=_INTERVAL):
        message = (
            f"found with samples every {interval_s:g} s, but sample_interval_s = {axis.sample_interval_s:g}"
        )
        yield Finding(FILE, message)


def same_drive(axis: AxisConfig) -> Iterator[Finding]:
    """The file was found with this drive, and has all its values."""
    found = _found(axis)
    if found.drive.output != _measured(axis):
        return
    usable_drive(axis)
    drive = plain_drive_of(axis)
    structure = structure_of(drive)
    if structure != found.drive.structure:
        message = (
            f"found with the drive {found.drive.name} (structure {found.drive.structure}), but this axis has"
            f" {drive.name} ({structure}): identify it again"
        )
        yield Finding(FILE, message)
        return
    missing = [p.name for p in drive.parameters if p.name not in found.values]
    if missing:
        yield Finding(FILE, f"has no value of {', '.join(missing)}")


def same_values(axis: AxisConfig) -> Iterator[Finding]:
    """Nominal values that are also in the configuration equal those of the file."""
    found = _found(axis)
    other = _other(usable_drive(axis), axis.model.nominal, found)
    if other:
        name, (left, right) = next(iter(other.items()))
        more = f" and {len(other) - 1} more" if len(other) > 1 else ""
        message = (
            f"{name} = {left:g}, but {_name(found)} has {right:.6g}{more}: remove what is in the file, or"
        )
        yield Finding(("model", "nominal"), message, FILE)


def same_predictor(axis: AxisConfig) -> Iterator[Finding]:
    """The settings of the predictor are not given twice with different values."""
    found = _found(axis)
    p, e, noise = found.predictor, axis.estimator, found.noise
    pairs: list[tuple[Keys, object, object]] = [
        (("estimator", "predictor"), _given(e, "predictor"), p.kind),
        (("estimator", "torque_noise"), _given(e, "torque_noise"), noise.torque or None),
        (("estimator", "output_noise"), _given(e, "output_noise"), noise.output or None),
        (("torque_delay_s",), _given(axis, "torque_delay_s"), p.torque_delay_s),
        (
            ("model", "friction_speed_scale"),
            _given(axis.model, "friction_speed_scale"),
            found.drive.friction_speed_scale,
        ),
    ]
    for path, left, right in pairs:
        if left is not None and not _alike(left, right):
            shown = f"has {right:.6g}" if isinstance(right, float) else f"has {right or 'none'}"
            yield Finding(path, f"but {_name(found)} {shown}: remove this, or", FILE)
    given = _given(e, "innovation_variance")
    if given is not None and not any(_alike(given, right) for right in (p.innovation_variance, p.lam0)):
        message = f"but {_name(found)} has {p.lam0:.6g}: remove this, or"
        yield Finding(("estimator", "innovation_variance"), message, FILE)
    gain = e.gain
    if gain and (len(gain) != len(p.gain) or not all(map(_alike, gain, p.gain))):
        yield Finding(("estimator", "gain"), f"differs from that in {_name(found)}: remove this, or", FILE)


def initial_p(axis: AxisConfig) -> Iterator[Finding]:
    """P(0) belongs to the predictor and nominal values; with new ones it is no longer valid."""
    found = _found(axis)
    if axis.estimator.initial_p:
        message = (
            f"belongs to the predictor that it was found with, not to the one in {_name(found)}: remove it, and P(0) is"
            " found from the first samples, or remove"
        )
        yield Finding(("estimator", "initial_p"), message, FILE)


def _measured(axis: AxisConfig) -> Output:
    return "mean speed" if axis.interval_mean else axis.output


def _found(axis: AxisConfig) -> NominalFile:
    found = nominal_file_of(axis)
    if found is None:
        raise Undecidable("nominal_file")
    return found


def _name(found: NominalFile) -> str:
    return found.path.name


def _given(table: Table, name: str) -> object:
    """The value if the user wrote it, else None."""
    return getattr(table, name) if name in table.model_fields_set else None


def _alike(left: object, right: object) -> bool:
    if isinstance(left, float) and isinstance(right, float):
        return math.isclose(left, right, rel_tol=_SAME)
    return left == right


def _other(drive: Drive, given: Mapping[str, float], found: NominalFile) -> dict[str, tuple[float, float]]:
    """Values of the configuration that differ from those of the file; merged ones by their parts."""
    left = dict(given)
    for definition in drive.definitions:
        if definition.name not in left and definition.names <= left.keys():
            with suppress(ValueError):
                left[definition.name] = definition.value(left)
    both = {name: (left[name], value) for name, value in found.values.items() if name in left}
    return {name: pair for name, pair in both.items() if not _alike(*pair)}


NOMINAL_RULES: tuple[Callable[[AxisConfig], Iterator[Finding]], ...] = (
    readable,
    same_axis,
    same_drive,
    same_values,
    same_predictor,
    initial_p,
)
