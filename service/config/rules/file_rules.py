"""Cross-checks of the nominal file and the thresholds file: they fit the axis, and contradict no key.

Nominal values belong to the predictor of their identification: with another gain, delay or interval, theta converges to
other values, and the tests would report a fault.
"""

import math
from collections.abc import Iterator
from typing import Any

from monitor_core.drive import Output
from service.config.axis_settings import unidentifiable_pairs
from service.config.drives import plain_drive_of
from service.config.problems import CheckFinding
from service.config.rules.model_rules import usable_drive, with_merged
from service.config.schema import AxisConfig
from service.config.schema.base_table import Undecidable
from service.config.schema.found_file import alike
from service.config.schema.nominal_file import NominalFile, structure_of
from service.config.schema.robot_defaults import COUPLING
from service.config.schema.thresholds_file import ThresholdsFile
from service.config.toml_lines import Keys

NOMINAL: Keys = ("model", "nominal_file")
THRESHOLDS: Keys = ("model", "thresholds_file")
SOURCE: Keys = ("detector", "alarm_source")
_INTERVAL = 0.01
"""Relative tolerance of equal intervals, as a measured interval differs slightly from the nominal one."""


# --- Nominal values ---------------------------------------------------------------------------------------------------


def same_axis(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The nominal file was identified with the quantity and interval of this axis."""
    found, measured = _nominal(axis), _measured(axis)
    if found.drive.output != measured:
        yield CheckFinding(NOMINAL, f"found with the {found.drive.output}, but this axis measures the {measured}")
    found_s, own_s = found.predictor.interval_s, axis.sample_interval_s
    if not math.isclose(found_s, own_s, rel_tol=_INTERVAL):
        yield CheckFinding(NOMINAL, f"found with samples every {found_s:g} s, but sample_interval_s = {own_s:g}")


def same_motor(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The nominal file was identified with the motions of other axes that also turn the motor of this axis."""
    found, given = _nominal(axis), sorted(axis.coupling.values())
    if alike(found.drive.coupling, given):
        return
    factors = ", ".join(f"{factor:g}" for factor in found.drive.coupling)
    if not given:
        message = f"found with a coupling by {factors}, but this axis has none: give it, or identify the axis again"
        yield CheckFinding(NOMINAL, message)
    else:
        other = f"with {factors}" if factors else "without it"
        message = f"but the values in {found.path.name} were found {other}: identify the axis again, or remove"
        yield CheckFinding((COUPLING,), message, NOMINAL)


def same_drive(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The nominal file was identified with this drive, and has all its values."""
    found = _nominal(axis)
    if found.drive.output != _measured(axis):
        return
    usable_drive(axis)
    drive = plain_drive_of(axis)
    structure = structure_of(drive)
    missing = [p.name for p in drive.parameters if p.name not in found.values]
    if structure != found.drive.structure:
        message = (
            f"found with the drive {found.drive.name} (structure {found.drive.structure}), but this axis has"
            f" {drive.name} ({structure}): identify it again"
        )
        yield CheckFinding(NOMINAL, message)
    elif missing:
        yield CheckFinding(NOMINAL, f"has no value of {', '.join(missing)}")


def same_values(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Nominal values that are also in the configuration equal those of the file, also for merged parameters."""
    found, given = _nominal(axis), with_merged(axis.model.nominal, usable_drive(axis))
    other = [name for name, value in found.values.items() if name in given and not alike(given[name], value)]
    if other:
        name, more = other[0], f" and {len(other) - 1} more" if len(other) > 1 else ""
        message = (
            f"{name} = {given[name]:g}, but {found.path.name} has {found.values[name]:.6g}{more}: remove what is in"
            " the file, or"
        )
        yield CheckFinding(("model", "nominal"), message, NOMINAL)


def same_predictor(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Settings of the predictor that are also in the configuration equal those of the file."""
    found = _nominal(axis)
    p, noise = found.predictor, found.noise
    in_file: dict[Keys, tuple[object, ...]] = {
        ("estimator", "predictor"): (p.kind,),
        ("estimator", "torque_noise"): (noise.torque or None,),
        ("estimator", "output_noise"): (noise.output or None,),
        ("torque_delay_s",): (p.torque_delay_s,),
        ("model", "friction_speed_scale"): (found.drive.friction_speed_scale,),
        ("estimator", "innovation_variance"): (p.innovation_variance, p.lam0),  # either value is accepted
    }
    for path, rights in in_file.items():
        given, right = _given(axis, path), rights[-1]
        if given is not None and not any(alike(given, value) for value in rights):
            shown = f"{right:.6g}" if isinstance(right, float) else right or "none"
            yield CheckFinding(path, f"but {found.path.name} has {shown}: remove this, or", NOMINAL)


def initial_p(axis: AxisConfig) -> Iterator[CheckFinding]:
    """P(0) is not configured, as it belongs to the former predictor and nominal values."""
    found = _nominal(axis)
    if axis.estimator.initial_p:
        message = (
            f"belongs to the predictor that it was found with, not to the one in {found.path.name}: remove it, and P(0)"
            " is found from the first samples, or remove"
        )
        yield CheckFinding(("estimator", "initial_p"), message, NOMINAL)


def distinguishable(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The multi-model detector needs nominal values that distinguish the parameters."""
    if axis.detector.alarm_source == "multimodel" and (doubtful := unidentifiable_pairs(axis)):
        pairs = ", ".join(" and ".join(pair) for pair in doubtful)
        yield CheckFinding(SOURCE, f"the nominal values cannot distinguish {pairs}: identify the axis again")


# --- Thresholds -------------------------------------------------------------------------------------------------------


def same_parameters(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The thresholds file has a threshold for each monitored parameter, and no others."""
    names = [entry.parameter for entry in _thresholds(axis).threshold]
    if names != list(axis.model.monitor):
        watched = ", ".join(axis.model.monitor)
        message = f"has thresholds of {', '.join(names)}, but {watched} are monitored: calibrate again"
        yield CheckFinding(THRESHOLDS, message)


def thresholds_given_once(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Thresholds that are also in the configuration equal those of the thresholds file."""
    found = _thresholds(axis)
    for key in ("alpha_1", "alpha_2"):
        given = _given(axis, ("detector", key))
        if given is not None and any(getattr(threshold, key) != given for threshold in found.threshold):
            message = f"but {found.path.name} has one for each parameter: remove this, or"
            yield CheckFinding(("detector", key), message, THRESHOLDS)


def multimodel_thresholds(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The multi-model detector as alarm source needs its thresholds in the file; these exclude a configured budget."""
    found = _thresholds(axis)
    of_it = "thresholds of the multi-model detector"
    if axis.detector.alarm_source == "multimodel" and not found.hypothesis:
        yield CheckFinding(SOURCE, f'{found.path.name} has no {of_it}: calibrate again, or use "cusum"')
    if found.hypothesis and _given(axis, ("detector", "budget_s")) is not None:
        yield CheckFinding(("detector", "budget_s"), f"{found.path.name} has {of_it}: remove this, or", THRESHOLDS)


# --- Common functions -------------------------------------------------------------------------------------------------


def _nominal(axis: AxisConfig) -> NominalFile:
    if (found := axis.model.nominal_file) is None:
        raise Undecidable("nominal_file")
    return found


def _thresholds(axis: AxisConfig) -> ThresholdsFile:
    if (found := axis.model.thresholds_file) is None:
        raise Undecidable("thresholds_file")
    return found


def _measured(axis: AxisConfig) -> Output:
    return "mean speed" if axis.interval_mean else axis.output


def _given(axis: AxisConfig, path: Keys) -> Any:
    """The value of a key if the user wrote it; otherwise None."""
    table: Any = axis
    for part in path[:-1]:
        table = getattr(table, str(part))
    return getattr(table, str(path[-1])) if path[-1] in table.model_fields_set else None


FILE_RULES = (
    same_axis,
    same_motor,
    same_drive,
    same_values,
    same_predictor,
    initial_p,
    distinguishable,
    same_parameters,
    thresholds_given_once,
    multimodel_thresholds,
)
