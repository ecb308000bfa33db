"""Files of thresholds and of nominal values for the axes of configurations."""

import json
import re
from collections.abc import Mapping
from typing import Any

from monitor_core.drive.kalman import filter_gain
from service.config import AxisConfig, NamedAxis
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model, plain_drive_of
from service.config.schema.nominal_file import structure_of
from service.config.schema.thresholds_file import made_with


def thresholds_text(
    axis: AxisConfig, alpha_1: float = 3.0, alpha_2: float = 20.0, allowance: float = 0.0, **other: Any
) -> str:
    """A file that fits the axis, with the same thresholds for all parameters, and ``other`` values in made_with."""
    model = axis_model(axis)
    settings = axis_settings(NamedAxis("r.a", "r", axis), model)
    head: dict[str, Any] = {"format": 1, "kind": "thresholds", "axis": "r.a", "date": "2002-02-02"}
    rows = [f"{key} = {json.dumps(value)}" for key, value in head.items()]
    for name in model.monitored:
        values = {"parameter": name, "alpha_1": alpha_1, "alpha_2": alpha_2, "allowance": allowance}
        rows += ["[[threshold]]", *(f"{key} = {json.dumps(value)}" for key, value in values.items())]
    rows += ["[made_with]"]
    rows += [f"{key} = {json.dumps(value)}" for key, value in (made_with(model, settings) | other).items()]
    rows += ["[nominal]", *(f"{key} = {json.dumps(value)}" for key, value in model.nominal.items())]
    return "\n".join(rows) + "\n"


def nominal_text(axis: AxisConfig, changes: Mapping[str, Mapping[str, Any]] = {}) -> str:
    """A file that fits the axis, with the values and the gain that it is configured with, and ``changes`` by table."""
    drive = plain_drive_of(axis)
    states = [state.name for state in drive.states]
    tables: dict[str, dict[str, Any]] = {
        "": {"format": 1, "axis": "cell1.axis1", "date": "2002-02-02T02:02:02+00:00"},
        "drive": {
            "name": drive.name,
            "structure": structure_of(drive),
            "output": axis.output,
            "torque_disturbance": False,
            "friction_speed_scale": axis.model.friction_speed_scale,
            "coupling": sorted(axis.coupling.values()),
        },
        "predictor": {
            "kind": "innovations",
            "interval_s": axis.sample_interval_s,
            "torque_delay_s": axis.torque_delay_s,
            "innovation_variance": 1e-6,
            "states": states,
            "gain": _gain(axis),
        },
        "noise": {"torque": axis.estimator.torque_noise, "output": axis.estimator.output_noise},
        "values": dict(axis_model(axis).nominal),
        "standard_deviations": {},
        "correlation": {},
    }
    return "\n".join(_table(name, {**table, **changes.get(name, {})}) for name, table in tables.items())


def _gain(axis: AxisConfig) -> list[float]:
    K, _ = filter_gain(axis_model(axis), axis.sample_interval_s, 0.05, 1e-4)
    return [float(k) for k in K]


def _table(name: str, entries: Mapping[str, Any]) -> str:
    """JSON's texts, numbers, booleans and lists are TOML's, too."""
    rows = [f"{json.dumps(key)} = {json.dumps(v)}" for key, v in entries.items() if v is not None]
    return "\n".join(([f"[{name}]"] if name else []) + rows) + "\n"


NAMED = '[robot.axis.model]\nthresholds_file = "thresholds.toml"\n'


def named(text: str) -> str:
    """The configuration with a file of thresholds in place of its own."""
    text = re.sub(r"^alpha_[12] = .*\n", "", text, flags=re.MULTILINE)
    return text.replace("[robot.axis.model]\n", NAMED)
