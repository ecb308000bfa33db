"""A simulated axis with any drive: how it moves, and the fault that its monitor names."""

from pathlib import Path

import numpy as np
import pytest

from service.config import Config
from service.config.drive_sources import LIBRARY, model_called
from service.pipeline.axes.axis_monitors import FramePipeline
from service.simulation.axis import SPEED_RMS, ControlledAxis
from service.simulation.robot import SimulatedFault
from tests.service.pipeline.robots import START_US, blocks, changed, demo, live
from tests.service.robot_tables import course
from tests.shares import soaked

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


def moved_by(folder: Path, name: str, *monitor: str, torque_noise: float = 1e-9) -> Config:
    """The demo's first axis with a drive of these, or of the library with its own values."""
    drive = name
    if name in DRAWINGS:
        drive = str(folder / "drive.mo")
        (folder / "drive.mo").write_text(DRAWINGS[name], encoding="utf-8")
    model = {"drive": drive, "nominal": model_called(drive).values, "monitor": monitor}
    return changed(demo(folder, 1), model=model, estimator={"torque_noise": torque_noise, "initial_p": {}})


@pytest.mark.parametrize("name", soaked([*LIBRARY, *DRAWINGS], "three-mass-weight", "large"))
def test_every_drive_moves_as_fast(name: str, tmp_path: Path, seed: int) -> None:
    axis = moved_by(tmp_path, name).axes[0]
    _, angle = course(axis, seed, 4000)
    speed = np.diff(angle[2000:]) / axis.config.sample_interval_s
    assert 0.7 * SPEED_RMS < speed.std() < 1.4 * SPEED_RMS
    assert np.abs(angle).max() < 10
    assert abs(angle.mean()) < 0.5


@pytest.mark.parametrize(
    ("name", "monitor"),
    soaked(
        [
            ("five-mass", ("kT", "1/J4", "fm")),
            ("one mass", ("f", "1/Jm")),
            (weight := ("weight on a gear", ("f", "1/(Jm + Jl*r^2)"))),
        ],
        weight,
    ),
)
def test_a_fault_of_any_drive_is_named_and_nothing_else(
    name: str, monitor: tuple[str, ...], tmp_path: Path, seed: int
) -> None:
    config = moved_by(tmp_path, name, *monitor, torque_noise=0.05)
    broken = "fm" if "fm" in monitor else "f"
    found = live(
        FramePipeline(config),
        blocks(config, FAULT_S + 15, seed, [SimulatedFault("demo.axis1", {broken: 1.3}, FAULT_S)]),
    )
    assert {change.alarm.parameter for change in found} == {broken}
    assert found[0].alarm.direction == "up"
    assert found[0].alarm.onset_us >= START_US + FAULT_S * 1e6


def test_a_part_of_a_merged_parameter_may_break(tmp_path: Path) -> None:
    axis = moved_by(tmp_path, "rigid gear").axes[0]
    robots = [ControlledAxis(axis, np.random.default_rng(1)) for _ in range(3)]
    robots[1].break_down({"Jl": 1.5})
    robots[2].break_down({"Jm + Jl*r^2": (0.001 + 1.5 * 0.02**2 * 2) / (0.001 + 0.02**2 * 2)})
    healthy, part, merged = ([robot.sample(k).motion for k in range(50)] for robot in robots)
    assert part == pytest.approx(merged, abs=1e-12)
    assert np.abs(np.subtract(part, healthy)).max() > 1e-3
    robots[1].break_down({"f": 2.0})
    with pytest.raises(KeyError):
        robots[1].break_down({"Jx": 2.0})
    with pytest.raises(ValueError, match="greater than zero"):
        robots[1].break_down({"Jl": -2.0})
