"""Nominal values and thresholds of an epoch as text, and the axis with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from monitor_core.wording import Sentence
from service.config import NamedAxis
from service.config.axis_settings import axis_settings, monitored_model
from service.config.epoch_values import EpochValuesError, content_of, fingerprint_of, from_files, recentred, with_epoch
from service.config.schema.thresholds_file import ThresholdsFile
from tests.service.found_files import nominal_text, thresholds_text
from tests.service.pipeline.robots import changed, demo


@pytest.fixture
def axis(tmp_path: Path) -> NamedAxis:
    """As the demo has it: nominal values, noises, P(0) and thresholds by keys."""
    return demo(tmp_path, 1).axes[0]


def from_commissioning(axis: NamedAxis, **values: float) -> NamedAxis:
    """The axis with files of nominal values and thresholds."""
    nominal = nominal_text(axis.config, {"values": {**monitored_model(axis).nominal, **values}})
    alone = with_epoch(axis, from_files(axis, nominal, None), 2)
    thresholds = thresholds_text(alone.config, alpha_1=4.0, alpha_2=31.0, allowance=0.02)
    return with_epoch(axis, from_files(axis, nominal, thresholds), 2)


def test_usual_mistakes_in_a_file_have_kinds(axis: NamedAxis) -> None:
    text = nominal_text(axis.config, {"values": {**monitored_model(axis).nominal, "fm": "much"}})
    mistaken = {"no TOML": "format = ", "key missing": "format = 1\n", "other kind": text}
    for kind, nominal in mistaken.items():
        with pytest.raises(EpochValuesError, match=r"^nominal\.toml") as found:
            from_files(axis, nominal, None)
        words = found.value.args[0]
        assert isinstance(words, Sentence)
        assert words.kind == kind


def settings_of(axis: NamedAxis) -> Any:
    return axis_settings(axis, monitored_model(axis))


def test_an_epoch_is_the_axis_again(axis: NamedAxis) -> None:
    again = with_epoch(axis, content_of(axis), 7)
    assert (again.epoch, again.configured, again.config) == (7, False, axis.config)
    filed = from_commissioning(axis)
    again = with_epoch(axis, content_of(filed), 3)
    assert monitored_model(again) == monitored_model(filed)
    assert settings_of(again) == settings_of(filed)


def test_files_replace_the_keys_that_they_contradict(axis: NamedAxis) -> None:
    filed = from_commissioning(axis, fm=0.09)
    assert monitored_model(filed).nominal["fm"] == 0.09
    assert [(t.alpha1, t.alpha2) for t in settings_of(filed).thresholds] == [(4.0, 31.0)] * 3
    assert settings_of(filed).P0 == ()
    assert axis.config.estimator.initial_p  # the configuration itself stays


@pytest.mark.parametrize("files", [False, True])
def test_a_window_moves_nominal_values_and_nothing_else(axis: NamedAxis, files: bool) -> None:
    before = from_commissioning(axis) if files else axis
    after = with_epoch(axis, recentred(before, {"fm": 0.071, "1/Ja": 0.0111}), 4)
    was, now = monitored_model(before), monitored_model(after)
    moved = {"fm": pytest.approx(0.071, rel=1e-14), "Ja": pytest.approx(1 / 0.0111, rel=1e-14)}
    assert now.nominal == {**was.nominal, **moved}
    assert monitored_model(after).theta0 == pytest.approx([1.0, 0.0111, 0.071], rel=1e-14)
    old, new = settings_of(before), settings_of(after)
    assert new.thresholds == old.thresholds
    assert [tuple(t) for t in new.tests(3)] == [tuple(t) for t in old.tests(3)]
    if files:
        assert (new.K, new.lam0) == (old.K, old.lam0)


def test_twice_recentred_is_the_last_one(axis: NamedAxis) -> None:
    once = with_epoch(axis, recentred(from_commissioning(axis), {"fm": 0.08}), 3)
    twice = with_epoch(axis, recentred(once, {"fm": 0.05, "kT": 1.1}), 4)
    assert monitored_model(twice).theta0 == pytest.approx([1.1, monitored_model(axis).theta0[1], 0.05])


def test_values_that_the_axis_cannot_have_are_refused(axis: NamedAxis, tmp_path: Path) -> None:
    bounded = changed(demo(tmp_path, 1), model={"bounds": {"fm": (0.05, 0.07)}}).axes[0]
    with pytest.raises(EpochValuesError, match=r"demo\.axis1: model\.bounds\.fm"):
        recentred(bounded, {"fm": 0.08})
    with pytest.raises(EpochValuesError, match=r"demo\.axis1: model\.nominal\.Ja"):
        recentred(axis, {"1/Ja": -0.01})


def test_the_fingerprint_is_of_nominal_values_and_files(axis: NamedAxis, tmp_path: Path) -> None:
    config = demo(tmp_path, 1)
    same = changed(config, trend={"lead_time": 1e5}, detector={"alpha_2": 30.0}).axes[0]
    assert fingerprint_of(same) == fingerprint_of(axis)
    others = [
        changed(config, model={"nominal": {**config.axes[0].config.model.nominal, "kg": 3e5}}).axes[0],
        changed(config, estimator={"torque_noise": 0.07}).axes[0],
        from_commissioning(axis),
    ]
    assert len({fingerprint_of(a) for a in (axis, *others)}) == 4


def test_the_fingerprint_is_the_same_in_each_version(axis: NamedAxis) -> None:
    """Of the version of 2026-11-27.  With another one, an upgrade would undo the baselines that were learned.

    So a new field is left out of the fingerprint while it has its default.
    """
    assert fingerprint_of(axis) == "ddf3e2c9fff4f4a6"
    thresholds = ThresholdsFile.model_validate(
        {
            "format": 1,
            "path": "thresholds.toml",
            "kind": "thresholds",
            "axis": "demo.axis1",
            "date": "2026-11-27",
            "made_with": {"forgetting": 0.995},
            "nominal": {"fm": 0.06},
            "threshold": [{"parameter": "fm", "alpha_1": 3.0, "alpha_2": 20.0, "allowance": 0.01}],
            "hypothesis": [{"cause": "fm", "size": 0.01, "h": 12.0}],
            "range": [{"condition": "speed", "low": 1.0, "high": 4.0}],
        }
    )
    model = axis.config.model.model_copy(update={"thresholds_file": thresholds})
    filed = axis._replace(config=axis.config.model_copy(update={"model": model}))
    assert fingerprint_of(filed) == "6ea8df3f5e3070a4"
