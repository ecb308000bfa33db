"""A speed that the drive averages, from the configuration to the estimates."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from service.commands.main import app
from service.config import ConfigErrors, NamedAxis, load
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from service.pipeline.axes.axis_monitors import AxisMonitors
from tests.service import robot_tables
from tests.service.axis_with_columns import written

H, N, FAULT = 0.005, 6000, 4000
WATCHED = 'monitor = ["kT", "1/Ja", "fm"]'
NOISE = ("output_noise = 0.0001", "output_noise = 0.02")


def configured(folder: Path, line: str = "interval_mean = true", *changes: tuple[str, str]) -> Path:
    """The demo's first axis with its speed in place of its angle."""
    folder.mkdir(exist_ok=True)
    speed = ("[robot.axis.angle]", f"[robot.axis.speed]\n{line}")
    return written(folder, speed, NOISE, *changes, monitor=WATCHED)


def read(folder: Path, line: str = "interval_mean = true") -> NamedAxis:
    return load(configured(folder, line), {}).axes[0]


def run(axis: NamedAxis, u: np.ndarray, y: np.ndarray) -> AxisMonitor:
    monitors = AxisMonitors([axis])
    monitors.update({axis.id: SampleBlock(np.arange(len(u)) * 5000, u, y)})
    return monitors.by_id[axis.id]


@pytest.fixture(scope="module")
def course(seed: int, tmp_path_factory: pytest.TempPathFactory) -> tuple[np.ndarray, np.ndarray]:
    """Torque and mean speed of the simulated drive; kT falls by a fifth."""
    return robot_tables.course(read(tmp_path_factory.mktemp("course")), seed, N, {"kT": 0.8}, FAULT)


def test_the_model_has_the_mean_and_the_predictor_goes_with_it(tmp_path: Path) -> None:
    plain, averaged = read(tmp_path / "a", "interval_mean = false"), read(tmp_path / "b")
    assert [axis_model(a.config).drive.output for a in (plain, averaged)] == ["speed", "mean speed"]
    model = axis_model(averaged.config)
    settings = axis_settings(averaged, model)
    assert len(settings.K) == len(model.drive.states) == 6
    assert settings.K[-1] == 0
    assert len(settings.K_after) > 0


def test_estimates_are_right_and_the_fault_is_found(course: tuple[np.ndarray, np.ndarray], tmp_path: Path) -> None:
    u, y = course
    after = run(read(tmp_path / "a"), u, y)
    before = run(read(tmp_path / "b"), u[:FAULT], y[:FAULT])
    assert not before.open_alarms
    for p in before.status().parameters:
        assert abs(p.estimate - p.nominal) < 8 * p.standard_deviation, p.name
    kT = after.status().parameters[0]
    assert kT.estimate == pytest.approx(0.8, abs=8 * kT.standard_deviation)
    assert "kT" in {e.parameter for e in after.open_alarms}


def test_identified_watched_and_planned_with(course: tuple[np.ndarray, np.ndarray], tmp_path: Path) -> None:
    """The whole way: values 5 to 10 % off, a record, nominal.toml, the daemon with it quiet, the next motion."""
    wrong = ("fm = 0.06 ", "fm = 0.066 ")
    file = configured(tmp_path / "a", "interval_mean = true", wrong)
    rows = [f"{k * H:.3f},{a},{b}" for k, (a, b) in enumerate(zip(*(c.tolist() for c in course), strict=True))]
    (tmp_path / "a.csv").write_text("t,u,phi\n" + "\n".join(rows[:FAULT]))
    found = tmp_path / "a" / "nominal.toml"
    args = ["identify", str(tmp_path / "a.csv"), "--config", str(file), "-o", str(found)]
    result = CliRunner().invoke(app, [*args, "--free", "Jm,Ja,fm", "--start", "values"])
    assert result.exit_code == 0, result.output
    values = tomllib.loads(found.read_text())["values"]
    assert values["Jm"] == pytest.approx(0.005896, rel=0.02)
    assert values["fm"] == pytest.approx(0.06, rel=0.05)
    text = file.read_text()
    start = text.index("[robot.axis.model.nominal]")
    text = text[:start] + text[text.index("[robot.axis.estimator]") :]
    text = text.replace(WATCHED, f'{WATCHED}\nnominal_file = "nominal.toml"')
    file.write_text(text.replace("torque_noise = 0.05\n", "").replace("output_noise = 0.02\n", ""))
    axis = load(file, {}).axes[0]
    assert axis_model(axis.config).drive.output == "mean speed"
    assert not run(axis, course[0][:FAULT], course[1][:FAULT]).open_alarms
    plan = ["excite", "--config", str(file), "--torque-limit", "3", "--seed", "1", "--seconds", "2"]
    result = CliRunner().invoke(app, [*plan, "-o", str(tmp_path / "plan.csv")])
    assert result.exit_code == 0, result.output
    file.write_text(text.replace("interval_mean = true", "interval_mean = false"))
    with pytest.raises(ConfigErrors, match="found with the mean speed, but this axis measures the speed"):
        load(file, {})


def test_a_resolution_of_counts_in_an_interval(tmp_path: Path) -> None:
    """A drive that counts increments: one more or less is a step of its mean speed."""
    step = 2 * math.pi / 4096 / H
    file = configured(tmp_path / "a", f"interval_mean = true\nresolution = {step!r}", ("output_noise = 0.02\n", ""))
    axis = load(file, {}).axes[0]
    assert axis_settings(axis, axis_model(axis.config)).lam0 > step**2 / 12
