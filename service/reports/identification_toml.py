"""nominal.toml: the nominal values, for the daemon and for people; see service/config/nominal_file.py."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from monitor_core.drive import DELAY, split_name
from monitor_core.identification import ParameterRow, Slope, Trace
from service.config.found_file import FORMAT
from service.config.nominal_file import structure_of
from service.ingest.identification_records import Source
from service.reports.identification_report import IdentificationReport
from service.reports.text_format import percent

_DIGITS, _FEW = 10, 5


def as_toml(report: IdentificationReport) -> str:
    """The whole file."""
    blocks = [list(part(report)) for part in (_head, _drive, _predictor, _noise, _values)]
    blocks += [list(_varying(slope)) for slope in report.result.slopes()]
    blocks += [list(part(report)) for part in (_deviations, _correlation, _fits, _provenance)]
    blocks += [list(_record(*trace)) for trace in report.traces()]
    return "\n".join("\n".join([*block, ""]) for block in blocks if block)


def _head(report: IdentificationReport) -> Iterator[str]:
    p = report.provenance
    yield f"# Nominal values of the axis {report.axis_id}, found by axiswatch {p.version} on {p.date[:10]}."
    yield "# The configuration of the daemon points here:"
    yield "#   [robot.axis.model]"
    yield '#   nominal_file = "nominal.toml"'
    yield "# All values are in SI units. They belong together: nominal values are those of this predictor, with this"
    yield "# gain, at this interval. To change one, identify again."
    yield from (f"# Note: {_one_line(word)}" for word in report.warnings)
    yield ""
    yield f"format = {FORMAT}"
    yield f"axis = {_text(report.axis_id)}"
    yield f"date = {_text(p.date)}"


def _drive(report: IdentificationReport) -> Iterator[str]:
    drive, e = report.result.estimate.problem.drive, report.result.estimate
    yield "# What these are parameters of; the structure is a digest of A, B, C and the states."
    yield "[drive]"
    yield f"name = {_text(drive.name)}"
    if report.provenance.drawing is not None:
        name, digest = report.provenance.drawing
        yield f"file = {_text(name)}"
        yield f"sha256 = {_text(digest)}"
    yield f"structure = {_text(structure_of(drive))}"
    yield f"output = {_text(drive.output)}  # measured quantity besides the torque"
    extended = str(len(e.drive.states) > len(drive.states)).lower()
    yield f"torque_disturbance = {extended}  # whether a torque disturbance d' = -d / Td + w is a state, too"
    yield f"friction_speed_scale = {_number(e.problem.speed_scale)}  # rad/s: Coulomb friction is fc tanh(speed / this)"


def _predictor(report: IdentificationReport) -> Iterator[str]:
    e = report.result.estimate
    kind, unit = e.problem.predictor, "rad" if e.drive.output == "angle" else "rad/s"
    yield "# x+ = x + K eps, eps = y - yhat; then the drive moves on with the torque held over the interval."
    yield "[predictor]"
    yield f"kind = {_text(kind)}"
    yield f"interval_s = {_number(e.interval_s)}"
    yield f"torque_delay_s = {_number(report.result.delay_s)}  # delay of the torque after its sample"
    yield f"innovation_variance = {_number(e.lam0)}  # lambda_0, ({unit})^2: of eps"
    words = "neighbouring errors are correlated: the daemon multiplies lambda_0 by this"
    yield f"colour = {_number(report.result.colour, _FEW)}  # {words}"
    with_gain = kind == "innovations"
    yield f"states = {_texts(f'{s.name} [{s.unit}]' for s in e.drive.states)}"
    yield f"gain = {_numbers(e.K if with_gain else [])}  # filter gain K, state for state, per {unit}"


def _noise(report: IdentificationReport) -> Iterator[str]:
    e = report.result.estimate
    yield "# Standard deviations of the noise that K follows from, per sample."
    yield "[noise]"
    units = {
        "torque": "N m, white",
        "output": "of the output, white",
        "slow": "N m, of d",
        "time_constant": "s, of d",
    }
    noise = e.noise or {"output": float(np.sqrt(e.lam0))}
    yield from (f"{name} = {_number(value)}  # {units[name]}" for name, value in noise.items())


def _values(report: IdentificationReport) -> Iterator[str]:
    yield "[values]"
    rows = {split_name(row.name)[0]: row for row in report.result.rows() if row.name != DELAY}
    for name, value in report.result.estimate.values.items():
        yield f"{_key(name)} = {_number(value)}  # {_about(name, rows, report)}"


def _about(name: str, rows: Mapping[str, ParameterRow], report: IdentificationReport) -> str:
    row, p = rows.get(name), report.result.estimate.drive.parameter(name)
    if row is None or row.held:
        sure = f"held: {row.held}" if row else "held"
    else:
        known = row.relative_sd is not None and not row.is_about_zero
        sure = f"+- {percent(row.relative_sd)}" if known else f"+- {row.sd:.2g}, about 0"
    return f"{p.unit}, {sure}; {p.meaning}"


def _varying(s: Slope) -> Iterator[str]:
    f = s.scheduled
    yield f"# {_one_line(f.parameter)} = its value above + slope ({f.term} - reference)"
    yield "[[schedule]]"
    yield f"parameter = {_text(f.parameter)}"
    yield f"signal = {_text(f.term)}  # of [[robot.axis.signal]] in the configuration"
    yield f"slope = {_number(s.slope)}"
    yield f"standard_deviation = {_number(s.sd, _FEW)}"
    yield f"reference = {_number(f.reference)}"
    yield f"range = {_numbers([f.low, f.high], _FEW)}  # of the signal in the records"


def _deviations(report: IdentificationReport) -> Iterator[str]:
    e = report.result.estimate
    yield "# Standard deviations of what was estimated, in the same units."
    yield "[standard_deviations]"
    yield from (f"{_key(n)} = {_number(sd, _FEW)}" for n, sd in zip(e.names, e.sd.tolist(), strict=True))


def _correlation(report: IdentificationReport) -> Iterator[str]:
    e = report.result.estimate
    yield "# Of the estimates: covariance = correlation times the two standard deviations."
    yield "[correlation]"
    yield f"names = {_texts(e.names)}"
    yield "matrix = ["
    yield from (f"  {_numbers(row, _FEW)}," for row in e.correlation)
    yield "]"


def _fits(report: IdentificationReport) -> Iterator[str]:
    e = report.result.estimate
    yield "# Do the prediction errors look like noise, and do they know nothing of the torque? Small p: no."
    yield "[residuals]"
    yield f"whiteness_p = {_number(e.whiteness.p_value, _FEW)}"
    yield f"independence_p = {_number(e.independence.p_value, _FEW)}"


def _provenance(report: IdentificationReport) -> Iterator[str]:
    p = report.provenance
    yield "[provenance]"
    yield f"axiswatch = {_text(p.version)}"
    yield f"command = {_text(p.command)}"
    yield f"evaluations = {report.result.estimate.iterations}"


def _record(purpose: str, s: Source, trace: Trace) -> Iterator[str]:
    yield "[[record]]"
    yield f"purpose = {_text(purpose)}"
    yield f"file = {_text(str(s.path))}"
    yield f"sha256 = {_text(s.sha256)}"
    yield f"range_s = {_numbers([s.start_s, s.end_s])}  # after the first sample of the file"
    yield f"samples = {s.samples}"
    yield f"used = {s.used}"
    dropped = ", ".join(f"{_key(reason)} = {count}" for reason, count in s.dropped.items() if count)
    yield f"dropped = {{ {dropped} }}" if dropped else "dropped = {}"
    yield f"fit = {_number(trace.fit, _FEW)}  # per cent, one step ahead: 100 (1 - |y - yhat| / |y - mean y|)"
    yield f"fit_simulation = {_number(trace.fit_simulation, _FEW)}  # the same, without looking at the output again"


def _number(value: float, digits: int = _DIGITS) -> str:
    """As a TOML float."""
    text = f"{value:.{digits}g}"
    return text if any(letter in text for letter in ".en") else f"{text}.0"


def _numbers(values: Iterable[float], digits: int = _DIGITS) -> str:
    return f"[{', '.join(_number(float(value), digits) for value in values)}]"


def _text(text: str) -> str:
    """JSON's escapes are TOML's, too, but for the delete character, which TOML wants escaped."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _texts(texts: Iterable[str]) -> str:
    return f"[{', '.join(map(_text, texts))}]"


def _key(name: str) -> str:
    return name if name.replace("_", "").isascii() and name.replace("_", "").isalnum() else _text(name)


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
