"""thresholds.toml: for the daemon to read and for people; see service/config/thresholds_file.py."""

from __future__ import annotations

import math
from collections.abc import Iterator

from service.calibration.found import Bank, Calibration
from service.calibration.told import Told
from service.config.threshold_match import made_with
from service.config.thresholds_file import FORMAT, KIND
from service.reports.calibration_words import promises
from service.reports.toml_words import toml_key, toml_value


def as_toml(of: Calibration) -> str:
    """The whole file."""
    blocks = [
        _head(of),
        _thresholds(of),
        _rate(of),
        *_bank(of),
        _made_with(of),
        _nominal(of),
        _provenance(of),
    ]
    return "\n".join("\n".join([*block, ""]) for block in blocks)


def _head(of: Calibration) -> Iterator[str]:
    yield f"# Thresholds of axis {of.axis.id}, by `axiswatch calibrate` from its healthy records."
    yield from (f"# {words}" for words in promises(of))
    yield f"format = {FORMAT}"
    yield f'kind = "{KIND}"'
    yield f"axis = {toml_value(of.axis.id)}"
    yield f"date = {toml_value(of.provenance.date)}"


def _thresholds(of: Calibration) -> Iterator[str]:
    yield "# nu = alpha_1 sqrt(lambda_0 P_ii) + allowance * size,  h = alpha_2 * size"
    for name, one in zip(of.model.monitored, of.settings.thresholds, strict=True):
        yield "[[threshold]]"
        yield f"parameter = {toml_value(name)}"
        yield from (f"{key} = {toml_value(value)}" for key, value in zip(_KEYS, one, strict=True))


_KEYS = ("alpha_1", "alpha_2", "allowance")


def _rate(of: Calibration) -> Iterator[str]:
    most, low, high = of.tests.between_s
    yield "[false_alarms]"
    yield f"budget_s = {toml_value(of.budget_s)}  # no more than one in so long"
    yield f"one_in_s = {toml_value(most)}  # most likely"
    yield f"interval_s = {toml_value([low, high])}  # 90 %"
    yield f"within_s = {toml_value(of.within_s)}  # faults are to be found in so long"


def _bank(of: Calibration) -> Iterator[Iterator[str]]:
    if of.bank is not None and of.by_bank is not None:
        yield _hypotheses(of.bank)
        yield _bank_rate(of.by_bank)


def _hypotheses(of: Bank) -> Iterator[str]:
    yield "# Of the bank of hypotheses: alarm when g, the sum of log-likelihood ratios less the allowance, exceeds h."
    for one in of.limits.own:
        yield "[[hypothesis]]"
        yield f"cause = {toml_value(one.cause)}"
        if math.isfinite(one.size):
            yield f"size = {toml_value(one.size)}"
        yield f"h = {toml_value(one.h)}"
        yield f"allowance = {toml_value(one.allowance)}"
        if one.alike:
            yield f"alike = {toml_value(list(one.alike))}"


def _bank_rate(told: Told) -> Iterator[str]:
    most, low, high = told.between_s
    yield "[bank_false_alarms]"
    yield f"one_in_s = {toml_value(most)}  # most likely"
    yield f"interval_s = {toml_value([low, high])}  # 90 %"


def _made_with(of: Calibration) -> Iterator[str]:
    yield "# With any other of these the thresholds are not used."
    yield "[made_with]"
    for key, value in made_with(of.model, of.settings).items():
        yield f"{key} = {toml_value(value)}"


def _nominal(of: Calibration) -> Iterator[str]:
    yield "[nominal]"
    for name, value in of.model.nominal.items():
        yield f"{toml_key(name)} = {toml_value(value)}"


def _provenance(of: Calibration) -> Iterator[str]:
    yield "[provenance]"
    yield f"axiswatch = {toml_value(of.provenance.version)}"
    yield f"command = {toml_value(of.provenance.command)}"
    for source in of.sources:
        yield "[[record]]"
        yield f"file = {toml_value(source.text)}"
        yield f"sha256 = {toml_value(source.sha256)}"
        yield f"samples = {source.samples}"
