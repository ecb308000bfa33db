"""Limits in the configuration: of what is monitored, on the right side, and as the engine takes them."""

from pathlib import Path

import pytest

from service.config import load
from service.config.axis_settings import axis_model
from service.config.drives import limits_of
from tests.end_to_end.processes import demo_config


def written(folder: Path, limits: str, trend: str = "") -> Path:
    file = demo_config(folder, 'interface = "virtual"\nchannel = "limits"', axes=1)
    tables = f"[robot.axis.model.limits]\n{limits}\n\n[robot.axis.trend]\n{trend}\n\n[robot.axis.estimator]"
    text = file.read_text(encoding="utf-8").replace("[robot.axis.estimator]", tables, 1)
    file.write_text(text, encoding="utf-8")
    return file


def test_limits_are_those_of_the_monitored_parameters(tmp_path: Path) -> None:
    axis = (
        load(written(tmp_path, "fm = 0.09\nkT = [0.9, 1.1]\nJa = 120", 'lead_time = "3 weeks"'), {})
        .axes[0]
        .config
    )
    limits = limits_of(axis, axis_model(axis))
    (fm,) = limits["fm"]
    assert (fm.value, fm.shown) == (0.09, 0.09)
    assert (fm.upper, fm.name, fm.unit, fm.above) == (True, "fm", "N m s/rad", True)
    assert [(kT.value, kT.upper) for kT in limits["kT"]] == [(0.9, False), (1.1, True)]
    (Ja,) = limits["1/Ja"]  # more inertia is a smaller reciprocal
    assert Ja.value == pytest.approx(1 / 120)
    assert (Ja.upper, Ja.name, Ja.unit, Ja.above) == (False, "Ja", "kg m^2", True)
    assert (axis.trend.lead_time, axis.trend.interval_s) == (21 * 86400, 3600)


def test_defaults(tmp_path: Path) -> None:
    axis = load(written(tmp_path, "fm = 0.03"), {}).axes[0].config
    assert axis.trend.lead_time == 14 * 86400
    assert [limit.upper for limit in limits_of(axis, axis_model(axis))["fm"]] == [False]
