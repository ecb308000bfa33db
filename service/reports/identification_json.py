"""The result of an identification as JSON: numbers that are not finite are null."""

from __future__ import annotations

import json
import math
from typing import Any

from monitor_core.arrays import Floats
from monitor_core.identification import Correlation, FrequencyResponse, Growth, ParameterRow, Slope, Trace
from service.ingest.identification_records import Source
from service.reports.identification_report import IdentificationReport, residual_words

Json = dict[str, Any]


def as_json(report: IdentificationReport) -> str:
    """The whole document."""
    e, p = report.result.estimate, report.provenance
    content = {
        "axis": report.axis_id,
        "drive": report.result.start.drive.name,
        "output": report.result.estimate.problem.drive.output,
        "trustworthy": not report.rejection,
        "why_not": report.rejection or None,
        "parameters": [_parameter(row) for row in report.result.rows()],
        "schedule": [_slope(slope) for slope in report.result.slopes()],
        "masses": _growth(report.result.growth) if report.result.growth else None,
        "names": list(e.names),
        "covariance": _numbers(e.covariance),
        "correlation": _numbers(e.correlation),
        "predictor": _predictor(report),
        "noise": dict(e.noise),
        "records": [_record(*trace) for trace in report.traces()],
        "residuals": {
            "whiteness": _correlation(e.whiteness),
            "independence": _correlation(e.independence),
            "words": [test.words for test in residual_words(report)],
        },
        "warnings": list(report.warnings),
        "started_from": report.result.estimate.started_from or None,
        "bode": _bode(report),
        "provenance": {"axiswatch": p.version, "date": p.date, "command": p.command, "drawing": p.drawing},
    }
    return json.dumps(_finite(content), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _parameter(row: ParameterRow) -> Json:
    return {
        "name": row.name,
        "unit": row.unit,
        "meaning": row.meaning,
        "value": row.value,
        "standard_deviation": row.sd,
        "nominal_before": row.before,
        "change": row.change,
        "held": row.held or None,
    }


def _growth(growth: Growth) -> Json:
    models = [
        {
            "masses": model.masses,
            "cost": model.estimate.cost,
            "aic": model.aic,
            "bic": model.bic,
            "fit": list(model.estimate.fit),
            "fit_simulation": list(model.estimate.fit_simulation),
            "fit_validation": list(model.validation),
            "values": dict(model.estimate.problem.nominal),
        }
        for model in growth.models
    ]
    return {"recommended": growth.recommended, "words": list(growth.words), "models": models}


def _slope(item: Slope) -> Json:
    f = item.scheduled
    return {
        "parameter": f.parameter,
        "signal": f.term,
        "slope": item.slope,
        "standard_deviation": item.sd,
        "reference": f.reference,
        "range": [f.low, f.high],
    }


def _predictor(report: IdentificationReport) -> Json:
    e = report.result.estimate
    return {
        "kind": e.problem.predictor,
        "interval_s": e.interval_s,
        "torque_delay_s": e.delay_s,
        "innovation_variance": e.lam0,
        "colour": report.result.colour,
        "states": [{"name": s.name, "unit": s.unit} for s in e.drive.states],
        "gain": _numbers(e.K),
        "friction_speed_scale": e.problem.speed_scale,
        "converged": e.converged,
        "evaluations": e.iterations,
        "cost": e.cost,
    }


def _record(purpose: str, s: Source, trace: Trace) -> Json:
    return {
        "purpose": purpose,
        "file": str(s.path),
        "sha256": s.sha256,
        "samples": s.samples,
        "used": s.used,
        "range_s": [s.start_s, s.end_s],
        "dropped": dict(s.dropped),
        "fit": trace.fit,
        "fit_simulation": trace.fit_simulation,
    }


def _correlation(c: Correlation) -> Json:
    return {"lags": _numbers(c.lags), "values": _numbers(c.values), "limit": c.limit, "p_value": c.p_value}


def _bode(report: IdentificationReport) -> Json:
    b = report.result.bode
    named = {"drive": b.drive, "before": b.before, "black_box": b.black_box, "measured": b.measured}
    return {**{key: _response(item) if item else None for key, item in named.items()}, "words": list(b.words)}


def _response(item: FrequencyResponse) -> Json:
    return {
        "name": item.name,
        "frequency_hz": _numbers(item.frequency_hz),
        "db": _numbers(item.db),
        "sd_db": _numbers(item.sd_db),
        "phase_rad": _numbers(item.phase),
        "sd_phase_rad": _numbers(item.sd_phase),
    }


def _numbers(values: Floats) -> list[Any]:
    found: list[Any] = values.tolist()
    return found


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
