"""Files of nominal values for the axes of configurations."""

import json
from collections.abc import Mapping
from typing import Any

from monitor_core.drive.kalman import filter_gain
from service.config import AxisConfig
from service.config.axis_settings import axis_model
from service.config.drives import plain_drive_of
from service.config.nominal_file import structure_of


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
        },
        "predictor": {
            "kind": "innovations",
            "interval_s": axis.sample_interval_s,
            "torque_delay_s": axis.torque_delay_s,
            "innovation_variance": 1e-6,
            "states": states,
            "gain": list(axis.estimator.gain) or _gain(axis),
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
