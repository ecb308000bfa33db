"""A calibration as files: thresholds.toml, see ``thresholds_file``; everything as JSON; the page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from monitor_core.calibration import FOUND_SHARE, DetectorResult, TrialResult
from monitor_core.detection import HypothesisThreshold
from monitor_core.settings import Threshold
from service.config.schema.found_file import FORMAT
from service.config.schema.thresholds_file import ThresholdsFile, made_with
from service.reports import calibration_report as content
from service.reports.calibration_report import DETECTORS, Calibration, promises
from service.reports.formats import Fact, Json, TextTable, fields_of, json_text, render, safe, toml_table
from service.reports.plot_style import LIMIT, PANEL, QUIET, TEXT, LineStyle, as_svg, figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def as_toml(calibration: Calibration) -> str:
    """The contents of thresholds.toml."""
    return "\n".join(_tables(calibration))


def _tables(calibration: Calibration) -> Iterator[str]:
    result, provenance = calibration.result, calibration.provenance
    about = f"Thresholds of axis {calibration.axis.id}, by `axiswatch calibrate` from its healthy records."
    head = {
        "format": FORMAT,
        "kind": ThresholdsFile.KIND,
        "axis": calibration.axis.id,
        "date": provenance.date,
    }
    yield toml_table("", head, "\n# ".join([about, *promises(calibration)]))
    thresholds = [
        toml_table("[[threshold]]", {"parameter": name, **_threshold(own)})
        for name, own in zip(result.model.monitored, result.settings.thresholds, strict=True)
    ]
    rules = (
        "# nu = alpha_1 sqrt(lambda_0 P_ii) + allowance * size,  h = alpha_2 * size\n"
        "# size_error: what healthy estimates are off by beyond P, in sizes; for names, and the deviations of sizes\n"
    )
    yield rules + "".join(thresholds)
    budget = {"budget_s": Fact(result.budget_s, "at most one in this time")}
    within = {"within_s": Fact(result.within_s, "faults are to be found within this time")}
    yield toml_table("[false_alarms]", budget | _rate(result.tests) | within)
    if result.bank is not None and result.by_bank is not None:
        about = "g, the sum of log-likelihood ratios less the allowance, exceeds h."
        hypotheses = [toml_table("[[hypothesis]]", _hypothesis(own)) for own in result.bank.thresholds.own]
        yield (
            f"# Of the multi-model detector: alarm when {about}\n"
            "# size_error: what the size of its cause is off by on the healthy axis, in the unit of size\n"
            + "".join(hypotheses)
        )
        yield toml_table("[bank_false_alarms]", _rate(result.by_bank))
        counted = {"evidence_share": result.bank.evidence_share}
        yield toml_table("[naming]", counted, "Share of the evidence that counts for the probabilities of causes.")
    if calibration.ranges:
        about = "# Conditions of the records (rms and top speed, signals): the promise holds within them.\n"
        yield about + "".join(toml_table("[[range]]", r._asdict()) for r in calibration.ranges)
    if calibration.poses:
        about = (
            "# Poses of the records, in cells of 5 or 10 degrees and their neighbours: nothing is tested in others.\n"
        )
        tables = [toml_table("[[poses]]", {"angles": m.angles, "known": m.to_hex()}) for m in calibration.poses]
        yield about + "".join(tables)
    monitor = made_with(result.model, result.settings)
    yield toml_table("[made_with]", monitor, "With any other of these the thresholds are not used.")
    yield toml_table("[nominal]", result.model.nominal)
    made = {"axiswatch": provenance.version, "command": provenance.command}
    records = [
        toml_table("[[record]]", {"file": s.text, "sha256": s.sha256, "samples": s.used}) for s in calibration.sources
    ]
    yield toml_table("[provenance]", made) + "".join(records)


def _threshold(own: Threshold) -> Json:
    return {
        "alpha_1": own.alpha1,
        "alpha_2": own.alpha2,
        "allowance": own.allowance,
        "size_error": own.size_error,
    }


def _rate(result: DetectorResult) -> Json:
    most, low, high = result.between_s
    return {"one_in_s": Fact(most, "most likely"), "interval_s": Fact([low, high], "90 %")}


def _hypothesis(own: HypothesisThreshold) -> Json:
    """The values without those that are None."""
    entries = {name: value for name, value in fields_of(own).items() if name != "alike" or value}
    return {name: value for name, value in entries.items() if name != "size" or math.isfinite(value)}


def as_json(calibration: Calibration) -> str:
    """All results of a calibration, for JSON."""
    result, made = calibration.result, calibration.provenance
    return json_text(
        {
            "axis": calibration.axis.id,
            "alarms": calibration.alarms,
            "budget_s": result.budget_s,
            "within_s": result.within_s,
            "false_alarms": {**_rate(result.tests), "confidence": 0.9},
            "memories": result.scatter.memories,
            "parameters": [_parameter(calibration, i) for i in range(len(result.model.monitored))],
            "multimodel": _bank(calibration),
            "onsets": result.onsets,
            "faults": [_fault(calibration, trial) for trial in result.caught],
            "first_named": _confusion(result.tests),
            "made_with": made_with(result.model, result.settings),
            "nominal": result.model.nominal,
            "conditions": [r._asdict() for r in calibration.ranges],
            "records": [
                {"text": s.text, "sha256": s.sha256, "samples": s.used, "seconds": s.end_s - s.start_s}
                for s in calibration.sources
            ],
            "warnings": calibration.warnings,
            "provenance": {"version": made.version, "date": made.date, "command": made.command},
        }
    )


def _parameter(calibration: Calibration, i: int) -> Json:
    result = calibration.result
    p, own = result.model.parameters[i], result.settings.thresholds[i]
    return {
        "name": p.name,
        "unit": p.unit,
        "nominal": result.model.theta0[i],
        "size": result.model.scale[i],
        **_threshold(own),
        "standard_deviation": result.scatter.sigma[i],
        "mean": result.scatter.mean_d[i],
        "one_false_alarm_in_s": result.settings.interval_s / result.rates.parameters[i],
        "smallest_found": _smallest(result.tests, p.name),
    }


def _bank(calibration: Calibration) -> Json | None:
    bank, result = calibration.result.bank, calibration.result.by_bank
    if bank is None or result is None:
        return None
    return {
        "false_alarms": {**_rate(result), "confidence": 0.9},
        "hypotheses": bank.thresholds.own,
        "evidence_share": bank.evidence_share,
        "faults": [_fault(calibration, trial) for trial in result.caught],
        "smallest_found": {name: _smallest(result, name) for name in calibration.result.model.monitored},
        "named": _confusion(result),
    }


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


# --- The page, with the plots of fault size against delay and share found ---------------------------------------------


_HEIGHT = 2.9


def as_html(calibration: Calibration) -> str:
    """The complete HTML page."""
    return render(
        "calibration.html",
        title=f"Calibration of {calibration.axis.id}",
        calibration=calibration,
        answer=content.answer(calibration),
        promises=list(content.promises(calibration)),
        power_pictures=list(_power_pictures(calibration)) if calibration.detectors[0].caught else [],
        smallest=_smallest_with_meaning(calibration),
        detectors=[
            (
                detector.detector,
                f"{DETECTORS[detector.detector]}, {content.part(calibration, detector)}",
                content.faults(calibration, detector),
                content.confusion(detector),
            )
            for detector in calibration.detectors
            if detector.caught
        ],
        thresholds=content.thresholds(calibration),
        hypotheses=content.hypotheses(calibration),
        counted=content.counted(calibration),
    )


def _smallest_with_meaning(calibration: Calibration) -> TextTable:
    """The tables of the terminal, with the meaning of each parameter."""
    (first, *titles), rows = content.smallest(calibration)
    meanings = [p.meaning for p in calibration.result.model.parameters]
    with_meaning = [(name, about, *sizes) for (name, *sizes), about in zip(rows, meanings, strict=True)]
    return TextTable((first, "what it is", *titles), with_meaning)


def _power_pictures(calibration: Calibration) -> Iterator[tuple[str, str]]:
    for number, name in enumerate(calibration.result.model.monitored):
        exact = {caught.exact for caught in calibration.result.caught if caught.fault.parameter == name}
        if exact:
            kind = "exact" if exact == {True} else "simulated"
            yield f"{name} ({kind})", safe(_power_picture(calibration, name, number))


def _power_picture(calibration: Calibration, name: str, number: int) -> str:
    """Faults of one parameter: probability of detection in time, and delay."""
    with figure(_HEIGHT) as drawn:
        left, right = drawn.subplots(1, 2)
        for result, look in zip(calibration.detectors, _LOOKS, strict=False):
            _curves(result, name, left, right, look)
        left.axhline(100 * FOUND_SHARE, **LIMIT)
        left.set_ylim(-3, 103)
        left.set_title(f"found within {calibration.result.within_s:.3g} s [%]")
        right.set_ylim(bottom=0)
        right.set_title("delay of the first alarm [s], of 9 of 10 dashed")
        for axes in (left, right):
            axes.set_xlabel(f"change of {name} [% of its size]")
        handles, labels = left.get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside upper left", ncols=len(labels))
        words = f"Faults of parameter {number + 1}: share found and delay by size"
        return as_svg(drawn, words, f"power{number}")


_LOOKS: tuple[LineStyle, LineStyle] = (
    {"color": TEXT, "marker": "o", "ms": 5},
    {"color": QUIET, "marker": "s", "ms": 5, "mfc": PANEL},
)
"""Line styles of the detector that alarms and of the other one"""


def _curves(result: DetectorResult, name: str, left: Axes, right: Axes, look: LineStyle) -> None:
    """Curves of one detector; without a delay where it detects nothing."""
    mine = [trial for trial in result.caught if trial.fault.parameter == name]
    mine.sort(key=lambda trial: trial.fault.size)
    sizes = [100 * trial.fault.size for trial in mine]
    shares = [100 * trial.found_within(result.within_s) for trial in mine]
    left.plot(sizes, shares, **look, label=DETECTORS[result.detector])
    for share, dashes in ((0.5, "-"), (FOUND_SHARE, (0, (4, 2)))):
        delays = [v if math.isfinite(v := trial.delay(share)) else math.nan for trial in mine]
        right.plot(sizes, delays, **look, ls=dashes)
