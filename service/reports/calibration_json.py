"""A calibration as JSON: numbers that are not finite are null."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import Any

from monitor_core.calibration.catch import Caught
from service.calibration.found import Calibration
from service.calibration.told import Told
from service.config.threshold_match import made_with

Json = dict[str, Any]


def as_json(of: Calibration) -> str:
    """The whole document."""
    content = {
        "axis": of.axis.id,
        "alarms": of.alarms,
        "budget_s": of.budget_s,
        "within_s": of.within_s,
        "false_alarms": _false_alarms(of.tests),
        "memories": of.scatter.memories,
        "parameters": [_parameter(of, i) for i in range(len(of.model.monitored))],
        "bank": _bank(of),
        "onsets": of.onsets,
        "faults": [_fault(of, one) for one in of.caught],
        "first_named": _confusion(of.tests),
        "made_with": made_with(of.model, of.settings),
        "nominal": dict(of.model.nominal),
        "records": [source._asdict() for source in of.sources],
        "warnings": list(of.warnings),
        "provenance": vars(of.provenance),
    }
    return json.dumps(_finite(content), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _parameter(of: Calibration, i: int) -> Json:
    p, own, s = of.model.parameters[i], of.settings.thresholds[i], of.scatter
    return {
        "name": p.name,
        "unit": p.unit,
        "nominal": float(of.model.theta0[i]),
        "size": float(of.model.scale[i]),
        "alpha_1": own.alpha1,
        "alpha_2": own.alpha2,
        "allowance": own.allowance,
        "standard_deviation": float(s.sigma[i]),
        "mean": float(s.mean_d[i]),
        "one_false_alarm_in_s": float(of.settings.interval_s / of.rates.parameters[i]),
        "smallest_found": _smallest(of.tests, p.name),
    }


def _bank(of: Calibration) -> Json | None:
    told = of.by_bank
    if of.bank is None or told is None:
        return None
    return {
        "false_alarms": _false_alarms(told),
        "hypotheses": [asdict(one) for one in of.bank.limits.own],
        "faults": [_fault(of, one) for one in told.caught],
        "smallest_found": {name: _smallest(told, name) for name in of.model.monitored},
        "named": _confusion(told),
    }


def _false_alarms(told: Told) -> Json:
    most, low, high = told.between_s
    return {"one_in_s": most, "interval_s": [low, high], "confidence": 0.9}


def _smallest(told: Told, name: str) -> Json:
    up, down = told.smallest(name)
    return {"increase": up, "decrease": down}


def _confusion(told: Told) -> Json:
    return {name: {key or "none": n for key, n in row.items()} for name, row in told.confusion().items()}


def _fault(of: Calibration, one: Caught) -> Json:
    return {
        "parameter": one.fault.parameter,
        "size": one.fault.size,
        "exact": one.exact,
        "found_within": one.found_within(of.within_s),
        "delay_median_s": one.delay(0.5),
        "delay_90_s": one.delay(0.9),
        "first_named": {name or "none": one.first.count(name) for name in sorted(set(one.first))},
        "torque_peak": one.torque_peak,
    }


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
