"""Parameters that follow signals: what the user writes, what is found, and what the files and reports say of it."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import Result

from monitor_core.drive.thermal_state import ThermalModel
from monitor_core.identification.parameter_selection import (
    ParameterSelection,
    ScheduledTerm,
    Slope,
    with_schedule,
)
from monitor_core.identification.problem import IdentificationError
from monitor_core.identification.thermal.warm_up import FoundWarmUp
from service.commands.commissioning.axis.identification_task import Request, prepare, read_schedule
from service.config import Config, load
from service.config.schema.found_file import read_found
from service.config.schema.nominal_file import NominalFile
from service.reports.formats import Provenance
from service.reports.temperature_words import temperature_remarks
from service.simulation.axis import ControlledAxis
from tests.service.command_line import axiswatch
from tests.service.commands.identify.conftest import SHIPPED, robot_text

pytestmark = pytest.mark.usefixtures("without_pictures")

SIGNALS = """
[[robot.axis.signal]]
name = "temperature"
column = "warm"
factor = 10.0
[[robot.axis.signal]]
name = "angle2"
column = "q2"
[[robot.axis.signal]]
name = "dead"
column = "dead"
"""
SLOPE, MIDDLE = -0.0012, 32.5
"""Of fm [N m s/rad per K], 0.06 in the middle of the temperatures."""


def temperature(t: float) -> float:
    """Stairs from 20 to 45 degrees in 12 s."""
    return 20 + 5 * (t // 2 % 6)


def write(path: Path, config: Config, seconds: float, seed: int) -> None:
    """A record; the column holds the tenth part of the temperature, and the angle of another axis does nothing."""
    (axis,) = config.axes
    h = axis.config.sample_interval_s
    plant, before = ControlledAxis(axis, np.random.default_rng(seed)), 1.0
    rows = ["t,torque,angle,warm,q2,dead"]
    for k in range(round(seconds / h)):
        factor = 1 + SLOPE / 0.06 * (temperature(k * h) - MIDDLE)
        if factor != before:
            plant.break_down({"fm": factor / before})
            before = factor
        u, y, *_ = plant.sample(k)
        rows.append(f"{k * h:.6f},{u:.10g},{y:.13g},{temperature(k * h) / 10},{(k // 300 % 5) / 2},")
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


@pytest.fixture(scope="module")
def warm(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Path:
    """robot.toml with the true values, warm.csv of 12 s, other.csv of 6 s."""
    made = tmp_path_factory.mktemp("varying")
    (made / "demo.dbc").symlink_to(SHIPPED / "demo.dbc")
    (made / "robot.toml").write_text(robot_text() + SIGNALS, encoding="utf-8")
    config = load(made / "robot.toml", {})
    write(made / "warm.csv", config, 12, seed)
    write(made / "other.csv", config, 6, seed + 1)
    return made


@pytest.fixture
def directory(warm: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(warm)
    return warm


def identify(*words: str, record: str = "warm.csv") -> Result:
    return axiswatch("identify", record, "--config", "robot.toml", "--start", "values", "--force", *words)


def test_friction_follows_the_temperature_and_the_inertia_follows_nothing(directory: Path) -> None:
    words = ("--free", "Jm", "--free", "fm", "--validate", "other.csv", "--json", "all.json")
    result = identify(*words, "--schedule", "fm: temperature", "--schedule", "Jm: cos(angle2)")
    assert result.exit_code == 0, result.output
    friction, inertia = json.loads((directory / "all.json").read_text(encoding="utf-8"))["schedule"]
    sd = friction["standard_deviation"]
    assert abs(friction["slope"] - SLOPE) < 5 * sd + 0.005 * abs(SLOPE)
    assert sd < 0.1 * abs(SLOPE)
    assert (friction["reference"], friction["range"]) == (MIDDLE, [20, 45])
    assert abs(inertia["slope"]) < 5 * inertia["standard_deviation"] + 1e-5
    assert inertia["signal"] == "cos(angle2)"
    assert inertia["range"] == pytest.approx([np.cos(2), 1])
    read = read_found(NominalFile, directory / "nominal.toml")
    assert read.predictor.colour < 4, "with the friction held at its middle the errors would be coloured: 17"
    assert read.values["fm"] == pytest.approx(0.06, abs=5 * sd * 12.5 + 0.01 * 0.06)
    assert [v.model_dump(exclude_defaults=True) for v in read.schedule] == [
        {**entry, "range": pytest.approx(tuple(entry["range"]), rel=1e-4), "slope": pytest.approx(entry["slope"]),
         "standard_deviation": pytest.approx(entry["standard_deviation"], rel=1e-4)}
        for entry in (friction, inertia)
    ]  # fmt: skip
    deviations = tomllib.loads((directory / "nominal.toml").read_text(encoding="utf-8"))["standard_deviations"]
    assert set(deviations) == {"Jm", "fm", "fm per temperature", "Jm per cos(angle2)"}
    output = " ".join(result.stdout.split())
    assert f"fm follows temperature, by {friction['slope']:.5g} N m s/rad for each 1 of it" in output
    assert "at 32.5, " in output
    page = (directory / "report.html").read_text(encoding="utf-8")
    assert "What follows measured signals" in page
    assert "fm follows temperature" in page
    assert "at 32.5, " in page


def test_the_schedule_of_the_configuration_is_the_default(directory: Path) -> None:
    """As of an axis that has been commissioned: without it, its records would seem not to be explained."""
    schedule = 'parameter = "fm"\nsignal = "temperature"\nslope = -0.001\nreference = 32.5\n'
    text = (directory / "robot.toml").read_text("utf-8") + f"[[robot.axis.model.schedule]]\n{schedule}"
    sent = text.replace('column = "warm"\n', 'column = "warm"\nmessage = "Axis1State"\nsignal = "Counter"\n')
    (directory / "scheduled.toml").write_text(sent, encoding="utf-8")
    words = ("--config", "scheduled.toml", "--free", "fm", "--json", "all.json")
    for more, signals in (((), ["temperature"]), (("--schedule", "fm: angle2"), ["angle2"])):
        result = identify(*words, *more)
        assert result.exit_code == 0, result.output
        followed = json.loads((directory / "all.json").read_text(encoding="utf-8"))["schedule"]
        assert [entry["signal"] for entry in followed] == signals


def test_friction_follows_a_signal_that_is_called_temperature_by_itself(directory: Path, seed: int) -> None:
    """In a record that is long enough to look for a warm-up."""
    write(directory / "long.csv", load(directory / "robot.toml", {}), 64, seed)
    result = identify("--free", "Jm", "--free", "fm", "--validate", "other.csv", record="long.csv")
    assert result.exit_code == 0, result.output
    (friction,) = read_found(NominalFile, directory / "nominal.toml").schedule
    assert (friction.parameter, friction.signal) == ("fm", "temperature")
    assert friction.slope == pytest.approx(SLOPE, abs=5 * friction.standard_deviation)
    assert "fm follows temperature, by" in " ".join(result.stdout.split())
    assert "Follows the signal temperature: fm. In the records it is 20 to 45." in " ".join(result.stdout.split())
    assert friction.model_error > 0
    assert "Beside the temperature fm is off by" in " ".join(result.stdout.split())
    short = " ".join(identify("--free", "fm").stdout.split())
    assert "Friction does not follow the signal temperature: it does not clearly fall" in short


def test_the_remark_says_why_friction_follows_a_temperature_or_not(directory: Path, seed: int) -> None:
    write(directory / "long.csv", load(directory / "robot.toml", {}), 64, seed)
    config = load(directory / "robot.toml", {})
    task = prepare(config, config.axes[0], ["long.csv"], [], Request(start="values", free=("Jm", "fm")))
    axis, found = config.axes[0].config, task.run(Provenance("1", "2026-01-01", "identify")).result
    follows = "Follows the signal temperature: fm. In the records it is 20 to 45. Below 17.5 and above 47.5 nothing is"
    days = replace(found, options=replace(found.options, begins_s=(0.0, 90_000.0)))
    for share, more in ((None, 0), (0.95, 0), (0.8, 1)):
        first, *others = temperature_remarks(axis, replace(days, temperature_share=share))
        assert first.startswith(follows), first
        assert len(others) == more, share
    assert "explains 80 % of what the heat" in others[0]
    for begins_s in ((0.0,), (None, None), (0.0, 4000.0)):
        morning = replace(found, options=replace(found.options, begins_s=begins_s))
        _, doubt = temperature_remarks(axis, morning)
        assert "if that thermometer is not on this axis, remove the signal temperature" in doubt
        assert "with a break of a quarter of an hour shows whether it follows the motion" in doubt
        assert len([*temperature_remarks(axis, replace(morning, temperature_follows_motion=True))]) == 1
    _, doubt = temperature_remarks(axis, replace(days, temperature_follows_motion=False))
    assert "does not follow the motion of this axis" in doubt
    assert "if that thermometer is not on this axis, remove the signal temperature" in doubt

    by_heat = replace(found, options=replace(found.options, scheduled=()), temperature_errors={})
    warm_up = FoundWarmUp(ThermalModel(600.0, 0.06, 0.0, 10.0), {"fm": (-0.001, 1e-5)}, ((0.0,),), (0.0,))
    for share, warmed, why in (
        (None, None, "it does not clearly fall while that rises, or not alike"),
        (None, warm_up, "it does not clearly fall while that rises, or not alike"),
        (0.3, warm_up, "the heat of the axis's own motion explains it better; the signal explains 30 % of that."),
        (-0.1, warm_up, "the signal explains 0 % of that."),
    ):
        (remark,) = temperature_remarks(axis, replace(by_heat, temperature_share=share, warm_up=warmed))
        assert why in remark
    measured = replace(by_heat, temperature_share=0.9, temperature_follows_motion=False, warm_up=warm_up)
    (remark,) = temperature_remarks(axis, measured)
    assert (
        "Friction does not follow the signal temperature, because that does not follow the motion of this axis"
        in remark
    )
    assert "give that of this axis, or remove the signal temperature" in remark
    assert not [*temperature_remarks(axis.model_copy(update={"signal": ()}), found)]


def test_a_long_term_has_a_number_in_tables(directory: Path) -> None:
    term = "cos(angle2) - 0.5 * square(angle2) * sin(angle2)"
    result = identify("--free", "Jm", "--free", "fm", "--schedule", "fm: temperature", "--schedule", f"Jm: {term}")
    assert result.exit_code == 0, result.output
    page = (directory / "report.html").read_text(encoding="utf-8")
    assert "<li>slope 1: fm follows temperature, by" in page
    assert f"<li>slope 2: Jm follows {term}, by" in page
    assert "<th>slope 2</th>" in page
    assert f"<th>Jm per {term}</th>" not in page


@pytest.mark.parametrize(
    ("words", "start"), [((), "cold"), (("Jm: cos(angle2)",), "cold"), (("fm: temperature",), None)]
)
def test_a_warm_up_is_looked_for_unless_friction_follows_a_measured_signal(
    directory: Path, words: tuple[str, ...], start: str | None
) -> None:
    config = load(directory / "robot.toml", {})
    task = prepare(config, config.axes[0], ["warm.csv"], [], Request(start="values", schedule=words))
    assert task.options.thermal == start


def test_it_explains_what_constant_values_do_not(directory: Path) -> None:
    """The whole of the friction's change: the fit of a constant is worse in cost, by far more than by one number."""
    costs = {}
    for name, words in {"follows": ("--schedule", "fm: temperature"), "constant": ()}.items():
        assert identify("--free", "fm", "--json", "c.json", *words).exit_code == 0
        costs[name] = json.loads((directory / "c.json").read_text(encoding="utf-8"))["predictor"]
    assert costs["constant"]["cost"] > 1.05 * costs["follows"]["cost"]
    page = (directory / "report.html").read_text(encoding="utf-8")
    assert "What follows measured signals" not in page


@pytest.mark.usefixtures("directory")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("fm temperature",), 'write PARAMETER: SIGNAL, as "fm: temperature"'),
        ((": temperature",), "write PARAMETER: SIGNAL"),
        (("fm:",), "write PARAMETER: SIGNAL"),
        (("fm: temprature",), 'no signal temprature: did you mean "temperature"? there is temperature, angle2, dead'),
        (("fm: tan(angle2)",), "no function tan of signals: there is cos, sin, square"),
        (("fm: angle2*2",), '"angle2*2" is neither a signal nor one of cos(...)'),
        (("fm: angle2,",), '"" is neither a signal nor'),
        (("fm: angle2, angle2",), "fm follows angle2 twice"),
        (("fm: angle2", "fm: angle2"), "fm follows angle2 twice"),
        (("fn: angle2",), "the drive has no parameter fn: there is"),
        (("kT: angle2",), "kT is scheduled but held (known from the data sheet): name it in --free"),
        (("fm: dead",), "warm.csv: the signal dead was never measured in it"),
    ],
)  # fmt: skip
def test_mistakes(words: tuple[str, ...], expected: str) -> None:
    result = identify(*(part for word in words for part in ("--schedule", word)))
    assert (result.exit_code, result.stdout) == (2, "")
    assert expected in result.stderr
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.usefixtures("directory")
def test_names_are_those_of_what_is_free() -> None:
    result = identify("--free", "1/Ja", "--schedule", "Ja: temperature")
    assert (result.exit_code, "1/Ja is free: write the same in both" in result.stderr) == (2, True)
    result = identify("--fix", "fm", "--schedule", "fm: temperature")
    assert (result.exit_code, "fm is scheduled but held (fixed by --fix)" in result.stderr) == (2, True)


def test_a_constant_signal_determines_no_slope(directory: Path) -> None:
    rows = (directory / "warm.csv").read_text(encoding="utf-8").splitlines()
    (directory / "cold.csv").write_text("\n".join(rows[:400]) + "\n", encoding="utf-8")
    result = identify("--schedule", "fm: temperature", record="cold.csv")
    assert result.exit_code == 2
    assert "temperature is 20 throughout the records" in result.stderr


def test_what_the_user_writes_is_read(warm: Path) -> None:
    (axis,) = load(warm / "robot.toml", {}).axes
    none = axis.config.model_copy(update={"signal": ()})
    with pytest.raises(IdentificationError, match=r'add \[\[robot\.axis\.signal\]\] with name = "temperature"'):
        read_schedule(("fm: temperature",), none)
    (axis,) = load(warm / "robot.toml", {}).axes
    found = read_schedule(("1/Ja:cos( angle2 ),temperature", "fm : square(angle2)"), axis.config)
    assert found == {"1/Ja": ("cos(angle2)", "temperature"), "fm": ("square(angle2)",)}


def test_a_reciprocal_that_follows_a_signal_is_what_is_found() -> None:
    choice = ParameterSelection(("Jm", "Ja", "fm"), {"kT": "known"})
    assert with_schedule(choice, {"1/Ja": ("t",), "fm": ("t",)}, ()).free == ("Jm", "1/Ja", "fm")
    assert with_schedule(choice, {}, ()) == choice


def test_a_slope_counts_from_its_reference_and_may_be_none() -> None:
    follows = ScheduledTerm("fm", "temperature", 30.0, 20.0, 45.0)
    slope = Slope(follows, 0.06, -0.001, 0.0001)
    assert [slope.at(t) for t in (20, 30, 45)] == pytest.approx([0.07, 0.06, 0.045])
    assert slope.is_significant
    assert not slope._replace(sd=0.0005).is_significant
