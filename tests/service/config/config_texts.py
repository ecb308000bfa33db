"""Right configurations that the tests change: on a bus, with operating conditions, with a drive, of tables."""

import re
import shutil
from functools import cache
from pathlib import Path

from service.config import Config, load
from tests.demo_text import demo_text
from tests.service.found_files import nominal_text, thresholds_text

CONFIG = Path(__file__).resolve().parents[3] / "config"
BASE = (Path(__file__).parent / "config_base.toml").read_text(encoding="utf-8")

TEMPERATURE = """\
[[robot.axis.signal]]
name = "temperature"
message = "RobotState"
signal = "Temperature1"
"""
MODE = """\
[[robot.axis.signal]]
name = "mode"
message = "RobotState"
signal = "Mode"
max_age_s = 2.0
"""
OTHER = """\
[[robot.axis.signal]]
name = "speed2"
axis = "second"
factor = 0.01
"""
GATES = """\
[[robot.axis.gate]]
signal = "mode"
equals = [3, 4.0]
[[robot.axis.gate]]
signal = "temperature"
above = 5
"""
SCHEDULES = """\
[[robot.axis.model.schedule]]
parameter = "fm"
signal = "temperature"
slope = -0.0004
reference = 40.0
range = [20.0, 60.0]
[[robot.axis.model.schedule]]
parameter = "kT"
signal = "cos(speed2)"
slope = 0.1
reference = 1.0
"""


def with_conditions(signals: str = TEMPERATURE + MODE + OTHER, gates: str = GATES, schedules: str = SCHEDULES) -> str:
    """The base, whose first axis has these."""
    text = BASE.replace("[robot.axis.model]\nmonitor", f"{signals}{gates}[robot.axis.model]\nmonitor", 1)
    bounds = "bounds = { kT = [0.5, 2.0] }\n"
    return text.replace(bounds, f"{bounds}{schedules}", 1)


POSE = """\
[[robot.axis.signal]]
name = "angle2"
message = "Axis2Speed"
signal = "Speed"
"""
WEIGHT = """\
[[robot.axis.model.schedule]]
parameter = "tau0"
signal = "cos(angle2)"
slope = -0.4
reference = 0.5
range = [-1.0, 1.0]
"""


def weighed() -> str:
    """The base, whose first axis bears a weight and watches the load."""
    return with_conditions(POSE, "", WEIGHT).replace('monitor = ["kT", "fm"]', 'monitor = ["kT", "fm", "load"]')


HEAD = """\
[[bus]]
name = "can0"
channel = "can0"
messages = "demo.dbc"
[[robot]]
name = "r"
[[robot.axis]]
name = "a"
bus = "can0"
sample_interval_s = 0.005
torque = { message = "Axis1State", signal = "Torque" }
angle = { message = "Axis1State", signal = "Angle" }
estimator = { torque_noise = 0.05, output_noise = 1e-4 }
[robot.axis.model]
"""
RIGID = """\
model Rigid "A motor and a load on a rigid gear"
  import Modelica.Mechanics.Rotational.*;
  parameter Real Jm(unit = "kg.m2") = 0.001 "inertia of the motor";
  parameter Real Jl(unit = "kg.m2") = 2 "inertia of the load";
  parameter Real f(unit = "N.m.s/rad") = 0.004 "friction";
  parameter Real r(unit = "1") = 0.02 "gear ratio";
  Sources.Torque torque;
  Components.Inertia motor(J = Jm);
  Components.Damper bearing(d = f);
  Components.Fixed housing;
  Components.IdealGear gear(ratio = 1/r);
  Components.Inertia load(J = Jl);
  Sensors.AngleSensor encoder;
equation
  connect(torque.flange, motor.flange_a);
  connect(bearing.flange_a, motor.flange_a);
  connect(bearing.flange_b, housing.flange);
  connect(motor.flange_b, gear.flange_a);
  connect(gear.flange_b, load.flange_a);
  connect(encoder.flange, motor.flange_a);
end Rigid;
"""
"""The file rigid.mo"""
FILE = 'drive = "rigid.mo"\nmonitor = ["f"]\n'
TABLE_AXIS = """\
[[robot]]
name = "cell1"
[[robot.axis]]
name = "axis1"
sample_interval_s = 0.005
torque = { column = "torque" }
angle = { column = "angle" }
"""
"""The beginning of a configuration for tables alone."""
TABLES = TABLE_AXIS + 'model = { drive = "three-mass", monitor = ["1/Ja"], nominal = { kT = 1, r = 0.0085 } }\n'


def demo_axis() -> str:
    """The first axis of the demo, without P(0)."""
    return re.sub(r"^initial_p = .*\n", "", demo_text(), flags=re.MULTILINE)


def watched() -> str:
    """An axis that also monitors the delay of the torque and has limits."""
    text = demo_axis().replace('"fm"]', '"fm", "delay"]')
    limits = "[robot.axis.model.limits]\nfm = 0.09\nkT = [0.9, 1.1]\n"
    return text.replace("[robot.axis.estimator]", f"{limits}[robot.axis.trend]\n[robot.axis.estimator]")


def found() -> str:
    """An axis with files of nominal values and of thresholds, in place of values, noises and thresholds of its own."""
    start, rest = demo_axis().split("[robot.axis.model.nominal]")
    text = start + rest[rest.index("[robot.axis.estimator]") :]
    text = re.sub(r"^(torque_noise|output_noise|alpha_[12]) = .*\n", "", text, flags=re.MULTILINE)
    files = 'nominal_file = "nominal.toml"\nthresholds_file = "thresholds.toml"\n'
    return text.replace('drive = "three-mass"\n', f'drive = "three-mass"\n{files}')


@cache
def found_files() -> dict[str, str]:
    """The files that ``found`` names: they fit each other."""
    axis = load(CONFIG / "demo.toml", {}).axes[0].config
    return {"nominal.toml": nominal_text(axis), "thresholds.toml": thresholds_text(axis, 1.5, 7.0)}


LINKS = """\
[[links.webhook]]
name = "orders"
url = "https://orders.plant.example/axiswatch?key=1"
secret_file = "orders.secret"
[links.mqtt]
host = "broker.plant.example"
user = "cell1"
password_env = "MQTT_PASSWORD"
prefix = "plant/cell1"
[links.smtp]
host = "mail.plant.example"
user = "cell1"
password_file = "mail.secret"
sender = "cell1@plant.example"
to = ["maintenance@plant.example"]
[links.opcua]
host = "0.0.0.0"
certificate = "opcua.crt"
key = "opcua.key"
"""


DEFAULTS = """\
[[bus]]
name = "can0"
channel = "can0"
messages = "robot.dbc"
[[robot]]
name = "cell"
[robot.defaults]
sample_interval_s = 0.005
model = { drive = "one-mass", monitor = ["kT", "fm"], nominal = { kT = 1 } }
[[robot.axis]]
name = "axis1"
torque = { message = "Axis1Torque", signal = "Torque" }
angle = { message = "Axis1Angle", signal = "Angle" }
[[robot.axis]]
name = "axis2"
torque = { message = "Axis2Torque", signal = "Torque" }
angle = { message = "Axis2Angle", signal = "Angle" }
"""
TEXTS = {
    "base": BASE,
    "conditions": with_conditions(),
    "defaults": DEFAULTS,
    "demo": demo_axis().replace("memory_s = 1.0", "memory_s = 3.0"),
    "file": HEAD + FILE,
    "found": found(),
    "links": TABLES + LINKS,
    "tables": TABLES,
    "watched": watched(),
    "weighed": weighed(),
}


def furnish(folder: Path) -> Path:
    """A folder with the files that the texts name."""
    shutil.copy(CONFIG / "robot.dbc", folder)
    shutil.copy(CONFIG / "demo.dbc", folder)
    for name, text in {"rigid.mo": RIGID, **found_files()}.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def loaded(folder: Path, text: str) -> Config:
    """The configuration of a text in a folder, without the environment."""
    (folder / "a.toml").write_text(text, encoding="utf-8")
    return load(folder / "a.toml", {})
