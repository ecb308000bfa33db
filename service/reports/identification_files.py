"""The result of an identification for programs: nominal.toml (see ``nominal_file``), and all as JSON."""

from collections.abc import Iterator, Mapping
from typing import Any

from monitor_core.drive import DELAY, HEAT, OUTPUT_UNITS, TEMPERATURE, Fast, split_name
from monitor_core.identification import (
    ComparedRecord,
    FoundWarmUp,
    FrequencyResponse,
    Growth,
    ParameterRow,
    Slope,
    Verdict,
)
from monitor_core.wording import percent
from service.config.schema.found_file import FORMAT
from service.config.schema.nominal_file import structure_of
from service.ingest.records.loaded_records import RecordOrigin
from service.reports.formats import Fact, Json, fields_of, json_text, one_line, toml_table
from service.reports.identification_report import IdentificationReport
from service.reports.identification_tables import residual_words, verdict_line


def as_toml(report: IdentificationReport) -> str:
    """The contents of nominal.toml."""
    return "\n".join(_tables(report))


def _tables(report: IdentificationReport) -> Iterator[str]:
    e, p = report.result.estimate, report.provenance
    yield "\n".join(f"# {line}" for line in _introduction(report)) + "\n"
    yield toml_table("", {"format": FORMAT, "axis": report.axis_id, "date": p.date})
    yield _drive_table(report)
    yield _predictor_table(report)
    noise = {name: Fact(sd, _NOISES[name]) for name, sd in (e.noise or {"output": e.lam0**0.5}).items()}
    yield toml_table("[noise]", noise, "Standard deviations of the noise that K follows from, per sample.")
    rows = {split_name(row.name)[0]: row for row in report.result.rows() if row.name != DELAY}
    yield toml_table("[values]", {name: Fact(v, _about(name, rows, report)) for name, v in e.values.items()})
    for slope in report.result.slopes():
        f = slope.scheduled
        about = f"{one_line(f.parameter)} = its value above + slope ({f.term} - reference)"
        yield toml_table("[[schedule]]", _slope(slope, report.result.temperature_errors), about)
    if report.result.warm_up is not None:
        about = "heat' = (P - heat) / tau, P = fm w^2 + fc |w| of the motor speed w: the signal heat [W], 0 when cold."
        yield toml_table("[thermal]", _thermal(report.result.warm_up), about)
    deviations = {name: _rough(sd) for name, sd in zip(e.names, e.sd.tolist(), strict=True)}
    about = "Standard deviations of what was estimated, in the same units."
    yield toml_table("[standard_deviations]", deviations, about)
    about = "Of the estimates: covariance = correlation times the two standard deviations."
    yield toml_table("[correlation]", {"names": list(e.names), "matrix": _rough(e.correlation)}, about)
    about = "How much of the motion a simulation explains, per cent, and on what records that is based."
    yield toml_table("[verdict]", _verdict(report.result.verdict), about)
    tests = {"whiteness_p": _rough(e.whiteness.p_value), "independence_p": _rough(e.independence.p_value)}
    about = "Do the prediction errors look like noise, and do they know nothing of the torque? Small p: no."
    yield toml_table("[residuals]", tests, about)
    made = {"axiswatch": p.version, "command": p.command, "evaluations": e.iterations}
    yield toml_table("[provenance]", made)
    for trace in report.traces():
        record = _record(*trace)
        record["dropped"] = {reason: count for reason, count in record["dropped"].items() if count}
        yield toml_table("[[record]]", record)


_NOISES = {
    "torque": "N m, white",
    "output": "of the output, white",
    "slow": "N m, of d",
    "time_constant": "s, of d",
}


def _rough(value: Any) -> Fact:
    return Fact(value, rough=True)


def _introduction(report: IdentificationReport) -> Iterator[str]:
    p = report.provenance
    yield f"Nominal values of the axis {report.axis_id}, found by axiswatch {p.version} on {p.date[:10]}."
    yield "The configuration of the daemon points here:"
    yield "  [robot.axis.model]"
    yield '  nominal_file = "nominal.toml"'
    yield "All values are in SI units. They belong together: nominal values are those of this predictor, with this"
    yield "gain, at this interval. To change one, identify again."
    yield report.outlook
    yield verdict_line(report)
    yield from (f"Note: {one_line(word)}" for word in report.warnings)


def _drive_table(report: IdentificationReport) -> str:
    e = report.result.estimate
    drive = e.problem.drive
    entries = {
        "name": drive.name,
        **dict(zip(("file", "sha256"), report.provenance.drawing or (), strict=False)),
        "structure": structure_of(drive),
        "output": Fact(drive.output, "measured quantity besides the torque"),
        "torque_disturbance": Fact(
            len(e.drive.states) > len(drive.states),
            "whether a torque disturbance d' = -d / Td + w is a state, too",
        ),
        "friction_speed_scale": Fact(e.problem.speed_scale, "rad/s: Coulomb friction is fc tanh(speed / this)"),
    }
    if report.coupling:
        entries["coupling"] = Fact(list(report.coupling), "factors of the motions of other axes in that of the motor")
    about = "What these are parameters of; the structure is a digest of A, B, C and the states."
    return toml_table("[drive]", entries, about)


def _predictor_table(report: IdentificationReport) -> str:
    e = report.result.estimate
    unit = OUTPUT_UNITS[e.drive.output]
    correlated = "neighbouring errors are correlated: the daemon multiplies lambda_0 by this"
    slower = "rad/s at the sensor: the fit leaves slower motion out; so does the daemon"
    entries = {
        "kind": e.problem.predictor,
        "interval_s": e.interval_s,
        "torque_delay_s": Fact(report.result.delay_s, "delay of the torque after its sample"),
        "innovation_variance": Fact(e.lam0, f"lambda_0, ({unit})^2: of eps"),
        "largest_error": Fact(e.largest_error, f"{unit}: one in 10 000 eps of the records is larger", rough=True),
        "colour": Fact(report.result.colour, correlated, rough=True),
        "states": [f"{s.name} [{s.unit}]" for s in e.drive.states],
        "gain": Fact(
            e.K if e.problem.predictor == "innovations" else [], f"filter gain K, state for state, per {unit}"
        ),
        "min_speed": Fact(e.problem.min_speed, slower),
    }
    about = "x+ = x + K eps, eps = y - yhat; then the drive moves on with the torque held over the interval."
    return toml_table("[predictor]", entries, about)


def _about(name: str, rows: Mapping[str, ParameterRow], report: IdentificationReport) -> str:
    row, p = rows.get(name), report.result.estimate.drive.parameter(name)
    if row is None or row.held:
        sure = f"held: {row.held}" if row else "held"
    else:
        known = row.relative_sd is not None and not row.is_about_zero
        sure = f"+- {percent(row.relative_sd)}" if known else f"+- {row.sd:.2g}, about 0"
    return f"{p.unit}, {sure}; {p.meaning}"


# --- What both have, with what it means ------------------------------------------------------------------------------


def _slope(s: Slope, errors: Mapping[str, float]) -> Json:
    f = s.scheduled
    off = errors.get(f.parameter) if f.term == TEMPERATURE else None
    beside = {} if off is None else {"model_error": Fact(off, "sd of what it is off by beside the signal, in its unit")}
    origin = "of [thermal] below" if f.term == HEAT else "of [[robot.axis.signal]] in the configuration"
    return {
        "parameter": f.parameter,
        "signal": Fact(f.term, origin),
        "slope": s.slope,
        "standard_deviation": _rough(s.sd),
        "reference": f.reference,
        "range": Fact([f.low, f.high], "of the signal in the records", rough=True),
        **beside,
    }


def _thermal(found: FoundWarmUp) -> Json:
    m = found.model
    return {
        "time_constant_s": Fact(m.tau_s, "tau"),
        **_fast(m.fast),
        "viscous_friction": Fact(m.fm, "fm of the power [N m s/rad]"),
        "coulomb_friction": Fact(m.fc, "fc of the power [N m]"),
        "largest_w": Fact(m.largest, "heat in the records, at the most"),
        "ambient_w": Fact(m.ambient, "sd of what a colder or warmer hall adds to the heat"),
        "first_w": Fact(found.starts[0][0], "heat at the beginning of the first record"),
        "model_error": Fact(found.errors, "sd of what friction is off by beside the heat, in its unit"),
    }


def _fast(fast: Fast | None) -> Json:
    if fast is None:
        return {}
    return {
        "fast_time_constant_s": Fact(fast.tau_s, "tau of a faster part of the heat, with the same P"),
        "fast_share": Fact(fast.share, "of that part: heat = share fast part + (1 - share) slow part"),
    }


def _verdict(verdict: Verdict) -> Json:
    return {
        "quality": verdict.quality.value,
        "explained": _rough(verdict.own),
        "explained_validation": _rough(verdict.validation),
        "validation": verdict.basis.value,
        "compared": verdict.measure.value,
        "missing": [effect.value for effect in verdict.missing],
        **(
            {}
            if verdict.repeats_s is None
            else {"repeats_s": Fact(verdict.repeats_s, "of the motion in all records", rough=True)}
        ),
    }


def _record(purpose: str, s: RecordOrigin, trace: ComparedRecord) -> Json:
    one_step = "per cent, one step ahead: 100 (1 - |y - yhat| / |y - mean y|)"
    simulated = "the same, without looking at the output again"
    return {
        "purpose": purpose,
        "file": str(s.path),
        "sha256": s.sha256,
        "samples": s.samples,
        "used": s.used,
        "range_s": Fact([s.start_s, s.end_s], "after the first sample of the file"),
        "dropped": s.dropped,
        "fit": Fact(trace.fit, one_step, rough=True),
        "fit_simulation": Fact(trace.fit_simulation, simulated, rough=True),
    }


# --- JSON -------------------------------------------------------------------------------------------------------------


def as_json(report: IdentificationReport) -> str:
    """All results of an identification, for JSON."""
    result, e, p = report.result, report.result.estimate, report.provenance
    return json_text(
        {
            "axis": report.axis_id,
            "drive": result.start.drive.name,
            "output": e.problem.drive.output,
            "trustworthy": not report.rejection,
            "why_not": report.rejection or None,
            "verdict": _verdict(result.verdict),
            "watched": [
                {"name": w.name, "change": w.change, "obstacle": w.obstacle and w.obstacle.value}
                for w in result.watched
            ],
            "outlook": report.outlook,
            "parameters": [_parameter(row) for row in result.rows()],
            "schedule": [_slope(slope, result.temperature_errors) for slope in result.slopes()],
            "thermal": _thermal(result.warm_up) if result.warm_up else None,
            "masses": _growth(result.growth) if result.growth else None,
            "names": e.names,
            "covariance": e.covariance,
            "correlation": e.correlation,
            "predictor": _predictor(report),
            "noise": e.noise,
            "records": [_record(*trace) for trace in report.traces()],
            "residuals": {
                "whiteness": e.whiteness,
                "independence": e.independence,
                "words": [test.words for test in residual_words(report)],
            },
            "warnings": report.warnings,
            "started_from": e.started_from or None,
            "bode": {name: _response(response) for name, response in fields_of(result.bode).items()},
            "provenance": {
                "axiswatch": p.version, "date": p.date, "command": p.command, "drawing": p.drawing
            },
        }
    )  # fmt: skip


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
            "fit": model.estimate.fit,
            "fit_simulation": model.estimate.fit_simulation,
            "fit_validation": model.validation,
            "values": model.estimate.problem.nominal,
        }
        for model in growth.models
    ]
    return {"recommended": growth.recommended, "words": growth.words, "models": models}


def _predictor(report: IdentificationReport) -> Json:
    e = report.result.estimate
    return {
        "kind": e.problem.predictor,
        "interval_s": e.interval_s,
        "torque_delay_s": e.delay_s,
        "innovation_variance": e.lam0,
        "largest_error": e.largest_error,
        "colour": report.result.colour,
        "states": e.drive.states,
        "gain": e.K,
        "friction_speed_scale": e.problem.speed_scale,
        "converged": e.converged,
        "evaluations": e.iterations,
        "cost": e.cost,
    }


def _response(response: Any) -> Any:
    """A frequency response; other values, such as the texts beside them, unchanged."""
    if not isinstance(response, FrequencyResponse):
        return response
    return {
        "name": response.name,
        "frequency_hz": response.frequency_hz,
        "db": response.db,
        "sd_db": response.sd_db,
        "phase_rad": response.phase,
        "sd_phase_rad": response.sd_phase,
    }
