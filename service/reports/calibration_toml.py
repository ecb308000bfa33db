"""thresholds.toml: for the daemon to read and for people; see service/config/thresholds_file.py."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

from monitor_core.calibration import DetectorResult, MultiModelCalibration
from service.config.found_file import FORMAT
from service.config.thresholds_file import ThresholdsFile, made_with
from service.reports.calibration_report import Calibration, promises


def as_toml(calibration: Calibration) -> str:
    """The whole file."""
    blocks = [
        _head(calibration),
        _thresholds(calibration),
        _rate(calibration),
        *_bank(calibration),
        _made_with(calibration),
        _nominal(calibration),
        _provenance(calibration),
    ]
    return "\n".join("\n".join([*block, ""]) for block in blocks)


def _head(calibration: Calibration) -> Iterator[str]:
    yield f"# Thresholds of axis {calibration.axis.id}, by `axiswatch calibrate` from its healthy records."
    yield from (f"# {words}" for words in promises(calibration))
    yield f"format = {FORMAT}"
    yield f'kind = "{ThresholdsFile.KIND}"'
    yield f"axis = {toml_value(calibration.axis.id)}"
    yield f"date = {toml_value(calibration.provenance.date)}"


def _thresholds(calibration: Calibration) -> Iterator[str]:
    yield "# nu = alpha_1 sqrt(lambda_0 P_ii) + allowance * size,  h = alpha_2 * size"
    for name, entry in zip(
        calibration.result.model.monitored, calibration.result.settings.thresholds, strict=True
    ):
        yield "[[threshold]]"
        yield f"parameter = {toml_value(name)}"
        yield from (f"{key} = {toml_value(value)}" for key, value in zip(_KEYS, entry, strict=True))


_KEYS = ("alpha_1", "alpha_2", "allowance")


def _rate(calibration: Calibration) -> Iterator[str]:
    most, low, high = calibration.result.tests.between_s
    yield "[false_alarms]"
    yield f"budget_s = {toml_value(calibration.result.budget_s)}  # at most one in this time"
    yield f"one_in_s = {toml_value(most)}  # most likely"
    yield f"interval_s = {toml_value([low, high])}  # 90 %"
    yield f"within_s = {toml_value(calibration.result.within_s)}  # faults are to be found within this time"


def _bank(calibration: Calibration) -> Iterator[Iterator[str]]:
    if calibration.result.bank is not None and calibration.result.by_bank is not None:
        yield _hypotheses(calibration.result.bank)
        yield _bank_rate(calibration.result.by_bank)


def _hypotheses(multimodel: MultiModelCalibration) -> Iterator[str]:
    yield "# Of the multi-model detector: alarm when g, the sum of log-likelihood ratios less the allowance, exceeds h."
    for entry in multimodel.limits.own:
        yield "[[hypothesis]]"
        yield f"cause = {toml_value(entry.cause)}"
        if math.isfinite(entry.size):
            yield f"size = {toml_value(entry.size)}"
        yield f"h = {toml_value(entry.h)}"
        yield f"allowance = {toml_value(entry.allowance)}"
        if entry.alike:
            yield f"alike = {toml_value(list(entry.alike))}"


def _bank_rate(result: DetectorResult) -> Iterator[str]:
    most, low, high = result.between_s
    yield "[bank_false_alarms]"
    yield f"one_in_s = {toml_value(most)}  # most likely"
    yield f"interval_s = {toml_value([low, high])}  # 90 %"


def _made_with(calibration: Calibration) -> Iterator[str]:
    yield "# With any other of these the thresholds are not used."
    yield "[made_with]"
    for key, value in made_with(calibration.result.model, calibration.result.settings).items():
        yield f"{key} = {toml_value(value)}"


def _nominal(calibration: Calibration) -> Iterator[str]:
    yield "[nominal]"
    for name, value in calibration.result.model.nominal.items():
        yield f"{toml_key(name)} = {toml_value(value)}"


def _provenance(calibration: Calibration) -> Iterator[str]:
    yield "[provenance]"
    yield f"axiswatch = {toml_value(calibration.provenance.version)}"
    yield f"command = {toml_value(calibration.provenance.command)}"
    for source in calibration.sources:
        yield "[[record]]"
        yield f"file = {toml_value(source.text)}"
        yield f"sha256 = {toml_value(source.sha256)}"
        yield f"samples = {source.samples}"


# --- Values as TOML writes them ---------------------------------------------------------------------------------------


_DIGITS = 10


def toml_value(value: bool | float | str | list[float] | list[str]) -> str:
    """A value; numbers with ten digits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, str):
        # JSON's escapes are TOML's, too, but for the delete character, which TOML wants escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    text = f"{float(value):.{_DIGITS}g}"
    return text if any(letter in text for letter in ".en") else f"{text}.0"


def toml_key(name: str) -> str:
    """A key, in quotes where it must be."""
    plain = name.replace("_", "")
    return name if plain.isascii() and plain.isalnum() else toml_value(name)
