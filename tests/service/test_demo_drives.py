"""The demo with any drive: how it moves, what is watched, what breaks and is named."""

from pathlib import Path

import numpy as np
import pytest

from service.commands.demo import with_drive_of
from service.config import Config
from service.pipeline.alarms import AxisAlarm
from service.pipeline.axis_monitors import FramePipeline
from service.simulation.axis import SPEED_RMS, ControlledAxis
from service.simulation.demonstration import usual_fault
from service.simulation.robot import Fault
from tests.service.command_line import axiswatch
from tests.service.pipeline.robots import blocks, demo, live

FAULT_S = 15.0

ROTATIONAL = "import Modelica.Mechanics.Rotational.*;\n"


def drawing(parameters: str, components: str, connections: str, name: str = "M") -> str:
    """A Modelica text with a motor whose torque and encoder are at motor.flange_a."""
    declared = "".join(f"parameter Real {p};\n" for p in parameters.split(", "))
    common = "Sources.Torque torque; Components.Inertia motor(J = Jm); Sensors.SpeedSensor encoder;\n"
    joined = "connect(torque.flange, motor.flange_a); connect(encoder.flange, motor.flange_a);\n"
    return f"model {name}\n{ROTATIONAL}{declared}{common}{components}\nequation\n{joined}{connections}\nend {name};\n"


BEARING = "Components.Damper bearing(d = f); Components.Fixed housing;\n"
BORNE = "connect(bearing.flange_a, motor.flange_a); connect(bearing.flange_b, housing.flange);\n"
ARM = "Components.SpringDamper spring(c = k, d = d); Components.Inertia arm(J = Ja);\n"
JOINED = "connect(motor.flange_b, spring.flange_a); connect(spring.flange_b, arm.flange_a);\n"

DRAWINGS = {
    "one mass": drawing("Jm = 0.01, f = 0.03", BEARING, BORNE),
    "torque constant": drawing(
        "Jm = 0.01, f = 0.03, kT = 1.2",
        BEARING + "Modelica.Blocks.Interfaces.RealInput u; Modelica.Blocks.Math.Gain gain(k = kT);\n",
        BORNE + "connect(u, gain.u); connect(gain.y, torque.tau);\n",
    ),
    "large": drawing("Jm = 20, Ja = 200, k = 2e5, d = 300, f = 60", ARM + BEARING, JOINED + BORNE),
    "small": drawing("Jm = 2e-6, Ja = 2e-5, k = 2e-2, d = 3e-5, f = 6e-6", ARM + BEARING, JOINED + BORNE),
    "without friction": drawing("Jm = 0.01, Ja = 0.05, k = 100, d = 0.05", ARM, JOINED),
    "rigid gear": drawing(
        "Jm = 0.001, Jl = 2, f = 0.004, r = 0.02",
        BEARING + "Components.IdealGear gear(ratio = 1/r); Components.Inertia load(J = Jl);\n",
        BORNE + "connect(motor.flange_b, gear.flange_a); connect(gear.flange_b, load.flange_a);\n",
    ),
    "spring to ground": drawing(
        "Jm = 2e-3, k = 5, d = 0.02",
        "Components.SpringDamper spring(c = k, d = d); Components.Fixed housing;\n",
        "connect(motor.flange_b, spring.flange_a); connect(spring.flange_b, housing.flange);\n",
    ),
    "weight on a gear": drawing(
        "Jm = 0.01, Jl = 0.5, f = 0.03, r = 0.1, gc = 8, gs = -3",
        BEARING
        + "Components.IdealGear gear(ratio = 1/r); Components.Inertia load(J = Jl);\n"
        + "AxisWatch.Gravity weight(gc = gc, gs = gs);\n",
        BORNE
        + "connect(motor.flange_b, gear.flange_a); connect(gear.flange_b, load.flange_a);\n"
        + "connect(weight.flange, load.flange_b);\n",
    ),
}

WATCHED = {
    "two-mass": ("kT", "1/Ja", "fm"),
    "three-mass": ("kT", "1/Ja", "fm"),
    "five-mass": ("kT", "1/J4", "fm"),
    "one mass": ("1/Jm", "f"),
    "torque constant": ("kT", "1/Jm"),  # nothing tells f from both
    "large": ("1/Ja", "f"),
    "small": ("1/Ja", "f"),
    "without friction": ("1/Ja",),
    "rigid gear": ("1/(Jm + Jl*r^2)", "f"),
    "spring to ground": ("1/Jm", "d"),
    "weight on a gear": ("1/(Jm + Jl*r^2)", "f"),
}


def config(folder: Path, name: str, *monitor: str, axes: int = 2) -> Config:
    """The demo's configuration with a drive of these, or of the library."""
    if name in DRAWINGS:
        (folder / "drive.mo").write_text(DRAWINGS[name], encoding="utf-8")
    given = str(folder / "drive.mo") if name in DRAWINGS else name
    return with_drive_of(demo(folder, axes), given, None, monitor)


@pytest.mark.parametrize("name", WATCHED)
def test_what_the_motion_tells_apart_is_watched(name: str, tmp_path: Path) -> None:
    axis = config(tmp_path, name).axes[0].config
    assert axis.model.monitor == WATCHED[name]
    friction = [name for name in axis.model.monitor if name in ("f", "fm", "d")]
    assert usual_fault(axis) == (friction or axis.model.monitor)[0]


@pytest.mark.parametrize("name", WATCHED)
def test_every_drive_moves_as_fast(name: str, tmp_path: Path, seed: int) -> None:
    axis = config(tmp_path, name, axes=1).axes[0]
    robot = ControlledAxis(axis, np.random.default_rng(seed))
    angle = np.array([robot.sample(k).motion for k in range(4000)])
    speed = np.diff(angle[2000:]) / axis.config.sample_interval_s
    assert 0.7 * SPEED_RMS < speed.std() < 1.4 * SPEED_RMS
    assert np.abs(angle).max() < 10
    assert abs(angle.mean()) < 0.5


@pytest.mark.parametrize("name", WATCHED)
def test_the_usual_fault_is_named_and_nothing_else(name: str, tmp_path: Path, seed: int) -> None:
    read = config(tmp_path, name)
    broken = usual_fault(read.axes[0].config)
    core, found = FramePipeline(read), dict[tuple[str, str], AxisAlarm]()
    faults = [Fault("demo.axis2", {broken: 1.3}, FAULT_S)]
    for change in live(core, blocks(read, FAULT_S + 15, seed, faults)):
        found.setdefault((change.axis_id, change.alarm.parameter), change)
    first = next(iter(found.values()))
    assert set(found) == {("demo.axis2", broken)}
    assert first.alarm.direction == "up"
    assert first.alarm.onset_us >= 1_760_000_000_000_000 + FAULT_S * 1e6


def test_a_part_of_a_merged_parameter_may_break(tmp_path: Path) -> None:
    axis = config(tmp_path, "rigid gear", axes=1).axes[0]
    robots = [ControlledAxis(axis, np.random.default_rng(1)) for _ in range(3)]
    robots[1].break_down({"Jl": 1.5})
    robots[2].break_down({"Jm + Jl*r^2": (0.001 + 1.5 * 0.02**2 * 2) / (0.001 + 0.02**2 * 2)})
    healthy, part, whole = ([robot.sample(k).motion for k in range(50)] for robot in robots)
    assert part == pytest.approx(whole, abs=1e-12)
    assert np.abs(np.subtract(part, healthy)).max() > 1e-3
    robots[1].break_down({"f": 2.0})
    with pytest.raises(KeyError):
        robots[1].break_down({"Jx": 2.0})
    with pytest.raises(ValueError, match="greater than zero"):
        robots[1].break_down({"Jl": -2.0})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--drive", "none.mo"], ("none.mo: cannot read the drawing: No such file",)),
        (["--drive", "fife-mass"], ('no such drive: did you mean "five-mass"?', "three-mass")),
        (["--drive", "{file}", "--model", "N"], ("drive.mo", "N", "M")),
        (["--model", "N"], ("--model", "--drive FILE.mo")),
        (["--drive", "{file}", "--monitor", "F"], ("--monitor", "F", "Jm, f")),
        (["--drive", "{file}", "--monitor", "f", "--monitor", "f"], ("--monitor", "f is monitored twice")),
        (["--monitor", "fx"], ("--monitor", "'fx'", "Jm, Jg")),
        (["--drive", "{file}", "--fault", "fx=2"], ("no parameter 'fx'", "there is Jm, f")),
        (["--drive", "{file}", "--fault", "Jm=-2"], ("Jm", "greater than zero")),
        (["--drive", "{bare}"], ("bare.mo", "no nominal value for Jm")),
        (["--drive", "{heavy}"], ("heavy.mo", "no torque moves it")),
    ],
    ids=" ".join,
)
def test_mistakes(arguments: list[str], words: tuple[str, ...], tmp_path: Path) -> None:
    text = DRAWINGS["one mass"]
    (tmp_path / "drive.mo").write_text(text, encoding="utf-8")
    (tmp_path / "bare.mo").write_text(text.replace("Jm = 0.01", "Jm"), encoding="utf-8")
    (tmp_path / "heavy.mo").write_text(text.replace("Jm = 0.01", "Jm = 1e300"), encoding="utf-8")
    files = {f"{{{name}}}": tmp_path / f"{name}.mo" for name in ("bare", "heavy")}
    files["{file}"] = tmp_path / "drive.mo"
    result = axiswatch("demo", "--port", "0", *(files.get(a, a) for a in arguments))
    assert result.exit_code == 2
    assert [word for word in words if word not in result.stderr] == []
