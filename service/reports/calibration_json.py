"""A calibration as JSON: numbers that are not finite are null."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import Any

from monitor_core.calibration import DetectorResult, TrialResult
from service.config.thresholds_file import made_with
from service.reports.calibration_report import Calibration

Json = dict[str, Any]


def as_json(calibration: Calibration) -> str:
    """The whole document."""
    content = {
        "axis": calibration.axis.id,
        "alarms": calibration.alarms,
        "budget_s": calibration.result.budget_s,
        "within_s": calibration.result.within_s,
        "false_alarms": _false_alarms(calibration.result.tests),
        "memories": calibration.result.scatter.memories,
        "parameters": [_parameter(calibration, i) for i in range(len(calibration.result.model.monitored))],
        "multimodel": _bank(calibration),
        "onsets": calibration.result.onsets,
        "faults": [_fault(calibration, trial) for trial in calibration.result.caught],
        "first_named": _confusion(calibration.result.tests),
        "made_with": made_with(calibration.result.model, calibration.result.settings),
        "nominal": dict(calibration.result.model.nominal),
        "records": [source._asdict() for source in calibration.sources],
        "warnings": list(calibration.warnings),
        "provenance": vars(calibration.provenance),
    }
    return json.dumps(_finite(content), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _parameter(calibration: Calibration, i: int) -> Json:
    result = calibration.result
    p, own, s = result.model.parameters[i], result.settings.thresholds[i], result.scatter
    return {
        "name": p.name,
        "unit": p.unit,
        "nominal": float(calibration.result.model.theta0[i]),
        "size": float(calibration.result.model.scale[i]),
        "alpha_1": own.alpha1,
        "alpha_2": own.alpha2,
        "allowance": own.allowance,
        "standard_deviation": float(s.sigma[i]),
        "mean": float(s.mean_d[i]),
        "one_false_alarm_in_s": float(
            calibration.result.settings.interval_s / calibration.result.rates.parameters[i]
        ),
        "smallest_found": _smallest(calibration.result.tests, p.name),
    }


def _bank(calibration: Calibration) -> Json | None:
    result = calibration.result.by_bank
    if calibration.result.bank is None or result is None:
        return None
    return {
        "false_alarms": _false_alarms(result),
        "hypotheses": [asdict(trial) for trial in calibration.result.bank.limits.own],
        "faults": [_fault(calibration, trial) for trial in result.caught],
        "smallest_found": {name: _smallest(result, name) for name in calibration.result.model.monitored},
        "named": _confusion(result),
    }


def _false_alarms(result: DetectorResult) -> Json:
    most, low, high = result.between_s
    return {"one_in_s": most, "interval_s": [low, high], "confidence": 0.9}


def _smallest(result: DetectorResult, name: str) -> Json:
    up, down = result.smallest(name)
    return {"increase": up, "decrease": down}


def _confusion(result: DetectorResult) -> Json:
    return {name: {key or "none": n for key, n in row.items()} for name, row in result.confusion().items()}


def _fault(calibration: Calibration, trial: TrialResult) -> Json:
    return {
        "parameter": trial.fault.parameter,
        "size": trial.fault.size,
        "exact": trial.exact,
        "found_within": trial.found_within(calibration.result.within_s),
        "delay_median_s": trial.delay(0.5),
        "delay_90_s": trial.delay(0.9),
        "first_named": {name or "none": trial.first.count(name) for name in sorted(set(trial.first))},
        "torque_peak": trial.torque_peak,
    }


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
