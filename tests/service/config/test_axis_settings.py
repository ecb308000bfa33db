"""From the configuration to the engine."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor_core.drive.kalman import filter_gain, slowest_time_constant
from monitor_core.monitoring.recommended_settings import SETTLING_TIME_CONSTANTS
from service.config import NamedAxis
from service.config.axis_settings import AxisError, axis_settings
from service.config.drives import axis_model
from service.config.schema import SpeedConfig
from service.config.schema.found_file import read_found
from service.config.schema.nominal_file import NominalFile
from tests.service.found_files import nominal_text
from tests.service.pipeline.robots import changed, demo


def with_estimator(tmp_path: Path, estimator: dict[str, Any], **axis: Any) -> NamedAxis:
    return changed(demo(tmp_path, 1), estimator=estimator, **axis).axes[0]


def speed(tmp_path: Path, estimator: dict[str, Any]) -> NamedAxis:
    measured = SpeedConfig(message="Axis1State", signal="Angle")
    return with_estimator(tmp_path, estimator, angle=None, speed=measured)


def test_gain_and_innovation_variance_come_from_the_noises(tmp_path: Path) -> None:
    axis = with_estimator(tmp_path, {}, settling_time_s=None, torque_delay_s=0.001)
    model = axis_model(axis.config)
    settings = axis_settings(axis, model)
    K, lam0 = filter_gain(model, 0.005, 0.05, 1e-4)
    assert tuple(K) == settings.K
    assert settings.lam0 == lam0
    assert settings.settle_s == SETTLING_TIME_CONSTANTS * slowest_time_constant(model, K, 0.005)
    assert (settings.interval_s, settings.max_gap_s, settings.delay_s) == (0.005, 0.05, 0.001)
    assert (settings.lam, settings.alpha1, settings.alpha2, settings.speed_scale) == (0.995, 3.0, 20.0, 1.0)
    assert settings.P0 == (206.0, 0.0065, 30.6)


def test_what_is_given_goes_before_what_is_computed(tmp_path: Path) -> None:
    given = with_estimator(tmp_path, {"innovation_variance": 1e-7}, settling_time_s=3.0)
    settings = axis_settings(given, axis_model(given.config))
    assert (settings.lam0, settings.settle_s) == (1e-7, 3.0)


def test_output_error_has_no_gain(tmp_path: Path) -> None:
    axis = speed(tmp_path, {"predictor": "output-error", "output_noise": 0.5})
    settings = axis_settings(axis, axis_model(axis.config))
    assert (settings.K, settings.lam0) == ((), 0.25)


def test_a_gain_of_a_file_that_does_not_stabilise_is_refused_by_name(tmp_path: Path) -> None:
    config, file = demo(tmp_path, 1), tmp_path / "nominal.toml"
    gain = {"predictor": {"gain": [0.0, 0.0, -5.0, 0.0, 0.0, 0.1]}}
    file.write_text(nominal_text(config.axes[0].config, gain), encoding="utf-8")
    (axis,) = changed(config, model={"nominal_file": read_found(NominalFile, file)}).axes
    with pytest.raises(AxisError, match=r"demo\.axis1: the predictor is not stable: give another gain"):
        axis_settings(axis, axis_model(axis.config))


def test_model_has_names_scales_and_bounds(tmp_path: Path) -> None:
    own = {"monitor": ("fc", "kT"), "scales": {"fc": 0.5}, "bounds": {"kT": (0.5, 2.0)}}
    model = axis_model(changed(demo(tmp_path, 1), model=own).axes[0].config)
    assert model.drive.output == "angle"
    np.testing.assert_array_equal(model.scale, [0.5, 1.0])
    np.testing.assert_array_equal(model.limits[:, 1], [0.5, 2.0])
