"""An axis of the demo with tables for records, a healthy one, and what is identified from it."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from service.commands.commissioning.axis.identification_task import Request, prepare
from service.config import Config, load
from service.reports.formats import Provenance
from service.reports.identification_report import IdentificationReport
from tests.conftest import ROOT
from tests.demo_text import demo_text
from tests.service.robot_tables import course

SHIPPED = ROOT / "config"
TRUE = {"fc": 0.0, "tau0": 0.0}
"""No Coulomb friction: the plant's acts within an interval, the model's is held, which biases by half a per cent."""
GUESS = {"Jm": 0.004, "Ja": 150.0, "kg": 2e5, "ka": 4e5, "fm": 0.03}


def robot_text(values: Mapping[str, float] = {}) -> str:
    """The first axis of the demo, with columns, and with these nominal values."""
    text = demo_text()
    for signal, column in (("Torque", "torque"), ("Angle", "angle")):
        text = text.replace(f'signal = "{signal}"\n', f'signal = "{signal}"\ncolumn = "{column}"\n')
    text = text.replace("[robot.axis.time]\n", '[robot.axis.time]\ncolumn = "t"\n')
    for name, value in {**TRUE, **values}.items():
        text, count = re.subn(rf"^{name} = [\d.e+-]+", f"{name} = {value}", text, flags=re.MULTILINE)
        assert count == 1, name
    return text


def write_robot(folder: Path, values: Mapping[str, float] = {}) -> Path:
    """A configuration in a folder."""
    if not (folder / "demo.dbc").exists():
        (folder / "demo.dbc").symlink_to(SHIPPED / "demo.dbc")
    path = folder / "robot.toml"
    path.write_text(robot_text(values), encoding="utf-8")
    return path


def write_record(
    path: Path,
    config: Config,
    seconds: float,
    seed: int,
    fault: Mapping[str, float] = {},
    after_s: float = 0.0,
) -> Path:
    """A table of the simulated axis."""
    (axis,) = config.axes
    h = axis.config.sample_interval_s
    torque, motion = course(axis, seed, round(seconds / h), fault, round(after_s / h))
    rows = zip(torque, motion, strict=True)
    text = "".join(f"{k * h:.6f},{u:.10g},{y:.13g}\n" for k, (u, y) in enumerate(rows))
    path.write_text("t,torque,angle\n" + text, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Path:
    """robot.toml with a wrong guess, healthy.csv of 20 s, second.csv of 6 s."""
    made = tmp_path_factory.mktemp("identify")
    true = load(write_robot(made), {})
    write_record(made / "healthy.csv", true, 20, seed)
    write_record(made / "second.csv", true, 6, seed + 1)
    write_robot(made, GUESS)
    return made


@pytest.fixture(scope="session")
def robot(folder: Path) -> Config:
    return load(folder / "robot.toml", {})


FREE = ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm")
PROVENANCE = Provenance("1.2.3", "2002-02-02T02:02:02+00:00", "axiswatch identify <healthy.csv> & more")


@pytest.fixture(scope="session")
def found(folder: Path, robot: Config) -> IdentificationReport:
    request = Request(start="values", free=FREE)
    records = [str(folder / "healthy.csv")]
    task = prepare(robot, robot.axes[0], records, [str(folder / "second.csv")], request)
    return task.run(PROVENANCE)


def with_estimate(report: IdentificationReport, **changes: Any) -> IdentificationReport:
    """The report with another estimate."""
    estimate = replace(report.result.estimate, **changes)
    return replace(report, result=replace(report.result, estimate=estimate))
