"""A robot with tools and a temperature, and its frames."""

from collections.abc import Sequence
from pathlib import Path

from service.can.frames import Frame
from service.config import Config
from service.simulation.robot import SimulatedFault
from tests.demo_text import demo_text
from tests.service.pipeline.robots import DEMO, START_US, moments

LENGTH_S = 40.0
CONDITIONS = """
[[robot.axis.signal]]
name = "temperature"
message = "RobotState"
signal = "Temperature1"
column = "warm"
[[robot.axis.signal]]
name = "mode"
message = "RobotState"
signal = "Mode"
column = "mode"
max_age_s = 0.5
[[robot.axis.signal]]
name = "angle2"
axis = "axis2"
factor = 0.5
[[robot.axis.gate]]
signal = "mode"
equals = [2, 3]
"""

VARYING = """
[[robot.axis.model.schedule]]
parameter = "fm"
signal = "temperature"
slope = -0.0012
reference = 40.0
range = [20.0, 60.0]
[[robot.axis.model.schedule]]
parameter = "Ja"
signal = "cos(angle2)"
slope = 15.0
reference = 0.9
"""

ALONE = "shadow = false\n"


def robot(folder: Path) -> Path:
    """The first two axes of the demo; the first one follows the temperature and the angle of the second.

    By the CUSUM alone: a multi-model detector that follows takes most of the time.
    """
    text = demo_text(2).replace("[robot.axis.detector]", f"[robot.axis.detector]\n{ALONE}")
    head, *axes = text.split("[[robot.axis]]\n")
    first, second = (axis.replace("virtual", "socketcan") for axis in axes[:2])
    first = first.replace("[robot.axis.model]\n", f"{CONDITIONS}\n[robot.axis.model]\n", 1)
    first = first.replace("[robot.axis.estimator]\n", f"{VARYING}\n[robot.axis.estimator]\n", 1)
    first = first.replace('signal = "Torque"', 'signal = "Torque"\ncolumn = "torque"', 1)
    first = first.replace('signal = "Angle"', 'signal = "Angle"\ncolumn = "angle"', 1)
    second = second.replace('signal = "Angle"', 'signal = "Angle"\ncolumn = "angle2"', 1)
    second = second.replace('signal = "Torque"', 'signal = "Torque"\ncolumn = "torque2"', 1)
    dbc = (DEMO.parent / "demo.dbc").read_text(encoding="utf-8")
    shared = (DEMO.parent / "robot.dbc").read_text(encoding="utf-8")
    state = shared[shared.index("BO_ 1024") : shared.index("\n\n", shared.index("BO_ 1024"))]
    at = dbc.index("CM_ ")
    (folder / "demo.dbc").write_text(f"{dbc[:at]}{state}\n\n{dbc[at:]}", encoding="utf-8")
    (folder / "robot.toml").write_text("[[robot.axis]]\n".join([head, first, second]), encoding="utf-8")
    return folder / "robot.toml"


def frames_of(
    config: Config, seed: int, faults: Sequence[SimulatedFault] = (), length_s: float = LENGTH_S
) -> list[Frame]:
    """The frames of a moment are received one after the other."""
    return [
        Frame(START_US + round(time_s * 1e6) + 40 * n, *f.key, f.data)
        for time_s, sent in moments(config, length_s, seed, faults)
        for n, f in enumerate(sent)
    ]
