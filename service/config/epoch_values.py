"""Nominal values and thresholds of an epoch as text for the store, and the axis with these values.

An epoch contains the nominal values and thresholds of [robot.axis.model]: keys, and the contents of the files that it
names.  All other settings (measured signals, monitored parameters, bounds, schedules) come from the configuration.
"""

import hashlib
import json
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from monitor_core.drive import split_name
from service.config.axis_settings import AxisError, axis_settings, monitored_model, predictor_of
from service.config.conditions import needed
from service.config.drives import drive_of, given_values, plain_drive_of
from service.config.problems import dotted
from service.config.rules.crosschecks import axis_findings
from service.config.schema import REPLACED_BY_NOMINAL_FILE, REPLACED_BY_THRESHOLDS_FILE, NamedAxis
from service.config.schema.base_table import TomlTable
from service.config.schema.found_file import FoundFile, FoundFileError, found_in
from service.config.schema.nominal_file import NominalFile, structure_of
from service.config.schema.thresholds_file import ThresholdsFile, made_with

_OWN = ("nominal", "nominal_file", "thresholds_file")
_T = TypeVar("_T", bound=TomlTable)


class EpochValuesError(ValueError):
    """The values do not fit the axis; the text says why and how to correct that."""


def content_of(axis: NamedAxis) -> str:
    """The nominal values and thresholds of an axis, as JSON."""
    model = axis.config.model
    return _written(nominal=model.nominal, nominal_file=model.nominal_file, thresholds_file=model.thresholds_file)


def _written(**content: Mapping[str, float] | FoundFile | None) -> str:
    tables = {k: v.model_dump(mode="json") if isinstance(v, FoundFile) else v for k, v in content.items()}
    return json.dumps(tables, ensure_ascii=False, sort_keys=True)


def _without_added(table: Mapping[str, Any], field: str) -> dict[str, Any]:
    """The table without a field that it did not have at first, if it is 0 or empty, which stands for its absence."""
    return {name: value for name, value in table.items() if name != field or value}


def fingerprint_of(axis: NamedAxis) -> str:
    """A digest of the configured nominal values, predictor and thresholds.

    Each version of the program gives the same: another digest of the same configuration would look as if the user had
    changed it, and put the configured values in the place of a later epoch, such as that of a repair.
    """
    config, found = axis.config, axis.config.model.thresholds_file
    thresholds = found and found.model_dump(mode="json", exclude={"path", "date"})
    if thresholds:
        thresholds = _without_added(_without_added(thresholds, "poses"), "naming")
        thresholds["hypothesis"] = [_without_added(row, "size_error") for row in thresholds["hypothesis"]]
    seen = {
        "values": given_values(config),
        "drive": structure_of(plain_drive_of(config)),
        "predictor": _without_added(predictor_of(config)._asdict(), "largest_error"),
        "thresholds": thresholds,
    }
    return hashlib.sha256(json.dumps(seen, sort_keys=True).encode()).hexdigest()[:16]


def with_epoch(axis: NamedAxis, content: str, number: int) -> NamedAxis:
    """A configured axis with the nominal values and thresholds of an epoch.

    Raises:
        EpochValuesError: the values do not fit the axis.
    """
    own = json.loads(content)
    try:
        files = {
            "nominal_file": own["nominal_file"] and NominalFile.model_validate(own["nominal_file"]),
            "thresholds_file": own["thresholds_file"] and ThresholdsFile.model_validate(own["thresholds_file"]),
        }
    except ValidationError as error:
        raise EpochValuesError(f"{axis.id}: epoch {number} was written by another version: {error}") from None
    return _checked(_with(axis, nominal=own["nominal"], **files)._replace(epoch=number, configured=False), axis)


def from_files(axis: NamedAxis, nominal: str, thresholds: str | None) -> str:
    """The content of an epoch from the texts of nominal.toml and thresholds.toml.

    Keys of the configuration that these files replace are ignored.

    Raises:
        EpochValuesError: the files do not fit the axis.
    """
    try:
        found = found_in(NominalFile, nominal, Path("nominal.toml"))
        tests = None if thresholds is None else found_in(ThresholdsFile, thresholds, Path("thresholds.toml"))
    except FoundFileError as error:
        raise EpochValuesError(error.args[0]) from None
    _checked(_with(axis, nominal={}, nominal_file=found, thresholds_file=tests), axis)
    return _written(nominal={}, nominal_file=found, thresholds_file=tests)


def recentred(axis: NamedAxis, values: Mapping[str, float]) -> str:
    """The content of an epoch with new values of monitored parameters; thresholds stay the same in sizes.

    ``axis``: the axis with the values in force.  ``values``: by monitored name, such as 1/Ja.

    Raises:
        EpochValuesError: the axis cannot have these values.
    """
    before, config = monitored_model(axis).nominal, axis.config
    given = drive_of(config).complete(given_values(config))
    for name, value in values.items():
        base, inverse = split_name(name)
        # Add the difference: the given torque may lack the weight, which the model has as an input.
        given[base] += (1 / value if inverse else value) - before[base]
    found, tests = config.model.nominal_file, config.model.thresholds_file
    moved = found and found.model_copy(update={"values": {**found.values, **given}})
    nominal = {} if found else given
    if tests is not None:
        plain = _with(axis, nominal=nominal, nominal_file=moved, thresholds_file=None)
        try:
            model = monitored_model(plain)
            made = made_with(model, axis_settings(plain, model))
        except (AxisError, ValueError) as error:
            raise EpochValuesError(f"{axis.id}: {error}") from None
        tests = tests.model_copy(update={"nominal": dict(model.nominal), "made_with": made})
    _checked(_with(axis, nominal=nominal, nominal_file=moved, thresholds_file=tests), axis)
    return _written(nominal=nominal, nominal_file=moved, thresholds_file=tests)


def _with(axis: NamedAxis, **own: Any) -> NamedAxis:
    """The axis with these nominal values and files, and without the keys that the files replace."""
    config = axis.config
    given = own["nominal_file"] is not None and config.model.nominal_file is None
    tested = own["thresholds_file"] is not None and config.model.thresholds_file is None
    estimator, detector = config.estimator, config.detector
    model = config.model.model_copy(update=own)
    if given:
        estimator = _without(estimator, REPLACED_BY_NOMINAL_FILE["estimator"])
        model = _without(model, ("friction_speed_scale",))
    if tested:
        detector = _without(detector, REPLACED_BY_THRESHOLDS_FILE["detector"])
    parts = {"model": model, "estimator": estimator, "detector": detector}
    config = config.model_copy(update=parts)
    return axis._replace(config=_without(config, ("torque_delay_s",)) if given else config)


def _without(table: _T, keys: Collection[str]) -> _T:
    """The table as if the user had not written these keys."""
    fields = type(table).model_fields
    plain = table.model_copy(update={k: fields[k].get_default(call_default_factory=True) for k in keys})
    plain.model_fields_set.difference_update(keys)
    return plain


def _checked(axis: NamedAxis, configured: NamedAxis) -> NamedAxis:
    """Check an axis by the rules of the configuration; returns it."""
    findings = axis_findings(axis.config)
    found = [f"{dotted(f.path)}: {f.message}{f' {dotted(f.other)}' if f.other else ''}" for f in findings]
    if not found and needed(axis) != needed(configured):
        found = [
            f"they follow {_names(needed(axis))}, but the daemon reads {_names(needed(configured))} for this axis: put"
            " them into the configuration, and restart the daemon"
        ]
    if found:
        raise EpochValuesError(f"{axis.id}: {'; '.join(found)}")
    try:
        axis_settings(axis, monitored_model(axis))
    except AxisError as error:
        raise EpochValuesError(str(error)) from None
    return axis


def _names(sources: Iterable[Any]) -> str:
    return ", ".join(source.name for source in sources) or "no signal"
