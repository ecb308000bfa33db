"""Files of thresholds for the axes of configurations."""

import json
from typing import Any

from service.config import AxisConfig, NamedAxis
from service.config.axis_settings import axis_model, axis_settings
from service.config.thresholds_file import made_with


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
