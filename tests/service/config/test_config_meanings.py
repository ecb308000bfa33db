"""What the configuration of an axis means to the engine: its drive, its operating conditions, its limits."""

import math
from pathlib import Path
from types import SimpleNamespace

import pytest

from monitor_core.drive.gates import Gate
from monitor_core.drive.operating_conditions import Conditions, NominalSchedule
from monitor_core.drive.signal_terms import Term
from monitor_core.kernel.tables import WEIGHT as WEIGHT_INPUT
from service.config import AxisConfig, Config, ConfigErrors, conditions_of, load, needed
from service.config.drives import axis_model, gear_ratio, given_values, limits_of
from tests.end_to_end.processes import demo_config, edit
from tests.service.command_line import shown
from tests.service.config.config_texts import (
    BASE,
    CONFIG,
    FILE,
    HEAD,
    RIGID,
    furnish,
    loaded,
    weighed,
    with_conditions,
)

MERGED = "Jm + Jl*r^2"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return furnish(tmp_path)


def read(folder: Path, model: str, head: str = HEAD) -> Config:
    return loaded(folder, head + model)


def test_values_of_a_file_of_the_configuration_and_of_merged_parameters(folder: Path) -> None:
    model = axis_model(read(folder, FILE).axes[0].config)
    assert model.drive.name == "Rigid"
    assert model.nominal == pytest.approx({MERGED: 0.001 + 0.02**2 * 2, "f": 0.004})
    model = axis_model(read(folder, FILE + "nominal = { Jl = 3, f = 0.005 }").axes[0].config)
    assert model.nominal == pytest.approx({MERGED: 0.001 + 0.02**2 * 3, "f": 0.005})
    text = f'drive = "rigid.mo"\nmonitor = ["1/({MERGED})"]\n[robot.axis.model.nominal]\n"{MERGED}" = 0.002\n'
    model = axis_model(read(folder, text).axes[0].config)
    assert model.theta0.tolist() == [500]


def test_one_mass_has_the_ratio_of_a_gear_that_is_no_part_of_its_drive(folder: Path) -> None:
    values = {"J": 0.03, "fm": 0.01, "fc": 0.2, "tau0": 0.0, "kT": 1.0}
    given = ", ".join(f"{name} = {value}" for name, value in values.items())
    for ratio, text in ((0.02, ", r = 0.02"), (1.0, "")):
        text = f'drive = "one-mass"\nmonitor = ["kT"]\nnominal = {{ {given}{text} }}\n'
        axis = read(folder, text).axes[0].config
        assert gear_ratio(axis) == ratio
        assert given_values(axis) == values
        assert axis_model(axis).nominal == values
    three = 'drive = "three-mass"\nmonitor = ["kT"]\nnominal = { kT = 1, r = 0.02 }\n'
    axis = read(folder, three).axes[0].config
    assert (gear_ratio(axis), given_values(axis)) == (0.02, {"kT": 1, "r": 0.02})
    with pytest.raises(ConfigErrors, match=r"nominal\.r = -2: the angle of the arm over that of the motor"):
        read(folder, three.replace("three", "one").replace("0.02", "-2"))


def test_which_model_of_a_file(folder: Path) -> None:
    second = RIGID.replace("Rigid", "Stiff").replace("= 2 ", "= 4 ")
    (folder / "rigid.mo").write_text(RIGID + second, encoding="utf-8")
    with pytest.raises(ConfigErrors, match=r"Rigid.*Stiff"):
        read(folder, FILE)
    stiff = axis_model(read(folder, FILE + 'drive_model = "Stiff"').axes[0].config)
    assert stiff.drive.name == "Stiff"
    assert stiff.nominal[MERGED] == pytest.approx(0.001 + 0.02**2 * 4)


def test_alarms_of_another_payload_can_be_hidden_whatever_is_monitored(folder: Path) -> None:
    """The multi-model detector names them, of an axis that bears a weight, and of one that does not."""
    axis = read(folder, FILE + '[robot.axis.alarms]\nsuppressed = ["load", "inertia"]\n').axes[0].config
    assert axis.alarms.suppressed == ("load", "inertia")


@pytest.mark.parametrize(
    ("monitor", "term"),
    [
        ('["kT", "fm"]', "cos(angle2)"),
        ('["kT", "fm", "load"]', "cos(angle2)"),
        ('["kT", "fm"]', "angle2"),
    ],
)
def test_a_weight_is_an_input_of_the_drive(monitor: str, term: str, folder: Path) -> None:
    """With the load among the monitored parameters, and without; a measured load does not turn."""
    text = weighed().replace('["kT", "fm", "load"]', monitor).replace("cos(angle2)", term)
    axis = loaded(folder, text).axes[0]
    conditions = conditions_of(axis)
    assert [str(follow.term) for follow in conditions.weight] == [term]
    assert conditions.schedules == ()
    assert axis_model(axis.config).drive.inputs[-1] == WEIGHT_INPUT


def test_a_monitored_torque_follows_the_pose_as_any_parameter(folder: Path) -> None:
    text = (
        weighed()
        .replace('["kT", "fm", "load"]', '["kT", "fm", "tau0"]')
        .replace("bounds = { kT = [0.5, 2.0] }", "scales = { tau0 = 1.0 }")
    )
    axis = loaded(folder, text).axes[0]
    assert conditions_of(axis).weight == ()
    assert [str(follow.term) for follow in conditions_of(axis).schedules] == ["cos(angle2)"]
    assert WEIGHT_INPUT not in axis_model(axis.config).drive.inputs


# --- operating conditions, and what `axiswatch check` says of them ------------------------------------------


def test_conditions_with_all_keys_and_with_none(folder: Path) -> None:
    config = loaded(folder, with_conditions().replace("_s = 0.005", "_s = 0.005\nmin_speed = 0.2", 1))
    axis, second = config.axes
    assert conditions_of(axis) == Conditions(
        ("temperature", "mode", "speed2"),
        (
            NominalSchedule("fm", Term.read("temperature"), -0.0004, 40.0, 20.0, 60.0),
            NominalSchedule("kT", Term.read("cos(speed2)"), 0.1, 1.0),
        ),
        (Gate("mode", (3.0, 4.0)), Gate("temperature", above=5.0)),
        0.2,
    )
    assert [(s.name, s.message, s.factor, s.max_age_s) for s in needed(axis)] == [
        ("temperature", "RobotState", 1.0, 10.0),
        ("mode", "RobotState", 1.0, 2.0),
        ("speed2", "Axis2Speed", 0.01, 10.0),
    ]
    assert not conditions_of(second)
    assert needed(second) == ()
    config = loaded(folder, BASE)
    assert not any(conditions_of(axis) for axis in config.axes)


def test_the_example_in_the_documents_is_right(folder: Path) -> None:
    document = (CONFIG.parent / "docs" / "operation.md").read_text(encoding="utf-8")
    section = document[document.index("## Operating conditions") :]
    example = section.split("```toml\n", 1)[1].split("```", 1)[0]
    axis, _ = loaded(folder, with_conditions(example, "", "").replace('name = "second"', 'name = "axis2"')).axes
    assert [source.name for source in axis.sources] == ["temperature", "angle2", "mode"]
    assert conditions_of(axis).gates == (Gate("mode", (2.0, 3.0)),)


def test_signals_of_tables_need_no_bus(folder: Path) -> None:
    """With a configuration that has none, only identification reads them."""
    content = """[[robot]]
name = "r"
[[robot.axis]]
name = "a"
sample_interval_s = 0.005
torque = { column = "u" }
angle = { column = "y" }
signal = [{ name = "t", column = "warm" }, { name = "other", axis = "b" }]
model = { drive = "three-mass", monitor = ["fm"], schedule = [
  { parameter = "fm", signal = "t", slope = 0.001, reference = 1.0 },
  { parameter = "fm", signal = "other", slope = 0.001, reference = 1.0 } ] }
[[robot.axis]]
name = "b"
sample_interval_s = 0.005
torque = { column = "v" }
angle = { column = "z", factor = 2.0 }
model = { drive = "three-mass", monitor = ["fm"] }
"""
    axis, _ = loaded(folder, content).axes
    assert [(s.column, s.factor, s.message) for s in axis.sources] == [("warm", 1.0, None), ("z", 2.0, None)]
    assert conditions_of(axis).schedules[0].high == math.inf


def test_where_the_load_follows_the_pose_all_angles_of_axes_are_in_it(folder: Path) -> None:
    """An angle that no term has may be that which counts; a speed is no pose."""
    content = """[[robot]]
name = "r"
[robot.defaults]
sample_interval_s = 0.005
torque = { column = "u" }
[[robot.axis]]
name = "a"
angle = { column = "x" }
signal = [{ name = "t", column = "warm" }, { name = "b2", axis = "b" }, { name = "c2", axis = "c" },
  { name = "b3", axis = "b", speed = true }, { name = "d2", axis = "d" }]
model = { drive = "one-mass", monitor = ["fm"], schedule = [
  { parameter = "tau0", signal = "cos(b2)", slope = 1.0, reference = 0.0 },
  { parameter = "fm", signal = "t", slope = 0.001, reference = 1.0 } ] }
[[robot.axis]]
name = "b"
angle = { column = "y" }
model = { drive = "one-mass", monitor = ["fm"] }
[[robot.axis]]
name = "c"
angle = { column = "z" }
model = { drive = "one-mass", monitor = ["fm"] }
[[robot.axis]]
name = "d"
speed = { column = "w" }
model = { drive = "one-mass", monitor = ["fm"] }
"""
    axis = loaded(folder, content).axes[0]
    assert conditions_of(axis).pose_angles == ("b2", "c2")
    assert [source.name for source in needed(axis)] == ["t", "b2", "c2"]
    axis = loaded(folder, content.replace('"cos(b2)"', '"b2"')).axes[0]
    assert conditions_of(axis).pose_angles == ("c2",), "nothing else uses it"
    assert [source.name for source in needed(axis)] == ["t", "b2", "c2"]
    gate = '[[robot.axis.gate]]\nsignal = "c2"\nabove = 1.0\n'
    gated = content.replace('"cos(b2)"', '"b2"').replace(
        '[[robot.axis]]\nname = "b"', f'{gate}[[robot.axis]]\nname = "b"'
    )
    assert conditions_of(loaded(folder, gated).axes[0]).pose_angles == ()
    # A signal of which the thresholds have poses is the angle of an axis that the configuration leaves out.
    thresholds = SimpleNamespace(poses=[SimpleNamespace(angles=["t", "c2"]), SimpleNamespace(angles=["x", "c2"])])
    model = axis.config.model.model_copy(update={"thresholds_file": thresholds})
    calibrated = axis._replace(config=axis.config.model_copy(update={"model": model}))
    assert conditions_of(calibrated).pose_angles == ("c2", "t")


def check(folder: Path, content: str) -> str:
    slow = content.replace("[robot.axis.estimator]\n", "[robot.axis.estimator]\nmemory_s = 10.0\n", 1)
    slow = slow.replace("{ predictor =", "{ memory_s = 10.0, predictor =", 1)
    (folder / "a.toml").write_text(slow, encoding="utf-8")
    return shown("check", "--config", folder / "a.toml")


def test_check_shows_the_conditions_and_what_it_assumes(folder: Path) -> None:
    output = check(folder, with_conditions())
    for words in ("fm follows temperature", "kT follows cos(speed2)", "only while mode is 3 or 4", "above 5"):
        assert words in output
    assert "demo: second: monitored as if the other axes stood still" in output


# --- limits, on the right side ------------------------------------------------------------------------------


def limited(folder: Path, limits: str, trend: str = "") -> AxisConfig:
    file = demo_config(folder, 'interface = "virtual"\nchannel = "limits"', axes=1)
    tables = f"[robot.axis.model.limits]\n{limits}\n\n[robot.axis.trend]\n{trend}\n\n[robot.axis.estimator]"
    return load(edit(file, ("[robot.axis.estimator]", tables)), {}).axes[0].config


def test_limits_are_those_of_the_monitored_parameters(tmp_path: Path) -> None:
    axis = limited(tmp_path, "fm = 0.09\nkT = [0.9, 1.1]\nJa = 120", 'lead_time = "3 weeks"')
    limits = limits_of(axis, axis_model(axis))
    (fm,) = limits["fm"]
    assert (fm.value, fm.shown) == (0.09, 0.09)
    assert (fm.upper, fm.name, fm.unit, fm.above) == (True, "fm", "N m s/rad", True)
    assert [(kT.value, kT.upper) for kT in limits["kT"]] == [(0.9, False), (1.1, True)]
    (Ja,) = limits["1/Ja"]  # more inertia is a smaller reciprocal
    assert Ja.value == pytest.approx(1 / 120)
    assert (Ja.upper, Ja.name, Ja.unit, Ja.above) == (False, "Ja", "kg m^2", True)
    assert (axis.trend.lead_time, axis.trend.interval_s) == (21 * 86400, 3600)
    usual = limited(tmp_path, "fm = 0.03")
    assert usual.trend.lead_time == 14 * 86400
    assert [limit.upper for limit in limits_of(usual, axis_model(usual))["fm"]] == [False]
