"""`axiswatch check` as a user sees it, and configurations without any bus: only for tables to be identified."""

from pathlib import Path

import pytest
from typer.testing import Result

from monitor_core.modeling import EXAMPLE_VALUES
from service.config import load
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from tests.demo_text import demo_text
from tests.service.command_line import axiswatch
from tests.service.config.config_texts import TABLES

TLS = Path(__file__).resolve().parents[2] / "tls"
CONFIG = Path(__file__).resolve().parents[3] / "config"


@pytest.mark.parametrize(
    ("name", "signals"),
    [
        ("axiswatch.toml", ("one-mass", "fc", "robot.dbc", "Axis6Torque.Torque", "Axis6Angle.Angle")),
        ("reference.toml", ("three-mass", "1/Ja", "robot.dbc", "Axis1Torque.Torque", "Axis1Angle.Angle")),
        ("demo.toml", ("three-mass", "1/Ja", "demo.dbc", "Axis1State.Torque", "Axis1State.Angle")),
    ],
)
def test_a_right_configuration_is_summed_up(name: str, signals: tuple[str, ...]) -> None:
    result = check(CONFIG / name)
    assert (result.exit_code, result.stderr) == (0, "")
    assert f"{CONFIG / name}: no problems\n" in result.stdout
    for words in ("can0", "axis1", "axis2", *signals):
        assert words in result.stdout


def test_coupling_is_shown_below_the_motion_that_it_is_added_to(tmp_path: Path) -> None:
    (tmp_path / "demo.dbc").symlink_to(CONFIG / "demo.dbc")
    text = demo_text(2).replace('name = "axis2"\n', 'name = "axis2"\ncoupling = { axis1 = -0.25 }\n')
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    result = check(tmp_path / "a.toml")
    assert (result.exit_code, result.stderr) == (0, "")
    before, _, after = result.stdout.partition("demo.axis2")
    assert ("-0.25 axis1" in before, "-0.25 axis1" in after) == (False, True)


def check(file: Path) -> Result:
    return axiswatch("check", "--config", file)


def test_all_problems_go_to_the_error_stream_one_a_line(tmp_path: Path) -> None:
    file = tmp_path / "[bold]wrong.toml"
    text = (CONFIG / "demo.toml").read_text(encoding="utf-8")
    text = text.replace('interface = "virtual"', 'interfase = "[red]"').replace("state_dir", "state_dri")
    file.write_text(text, encoding="utf-8")
    result = check(file)
    assert (result.exit_code, result.stdout) == (2, "")
    lines = result.stderr.splitlines()
    assert [line.split(": ")[:2] for line in lines[:-1]] == [
        [f"{file}:5", 'service.state_dri = "demo-state"'],
        [f"{file}:9", 'bus[1].interfase = "[red]"'],
    ]
    assert lines[-1] == "2 problems in the configuration"


def test_what_this_machine_lacks_is_a_note(tmp_path: Path) -> None:
    """A file may be checked on another machine than that of the daemon."""
    file = tmp_path / "robot.toml"
    (tmp_path / "demo.dbc").write_bytes((CONFIG / "demo.dbc").read_bytes())
    more = """
[web]
host = "0.0.0.0"
certificate = "daemon.crt"
key = "daemon.key"
[[links.webhook]]
name = "orders"
url = "https://orders.plant.example"
secret_file = "orders.secret"
"""
    file.write_text(demo_text(1) + more, encoding="utf-8")
    begin = "Note: the daemon would not start on this machine: "
    result = check(file)
    found = [line.removeprefix(begin) for line in result.stdout.splitlines() if line.startswith(begin)]
    assert found == [
        f"{tmp_path / 'daemon.crt'}: No such file or directory",
        f"{tmp_path / 'orders.secret'}: cannot read the secret: No such file or directory",
    ]
    for name in ("daemon.crt", "daemon.key"):
        (tmp_path / name).write_bytes((TLS / name.replace("daemon", "localhost")).read_bytes())
    (tmp_path / "orders.secret").write_text("0123456789abcdef", encoding="utf-8")
    result = check(file)
    assert f"{begin}other machines reach this host of [web], which needs a token" in result.stdout
    assert axiswatch("token", "new", "anna", "--scope", "read", "--config", file).exit_code == 0
    result = check(file)
    assert (result.exit_code, begin in result.stdout) == (0, False)


def with_memory(tmp_path: Path, memory_s: float) -> Path:
    """The demo's configuration, of which the first axis has this memory; beside it its DBC."""
    text = demo_text()
    (tmp_path / "demo.dbc").write_bytes((CONFIG / "demo.dbc").read_bytes())
    file = tmp_path / "demo.toml"
    file.write_text(text.replace("memory_s = 1.0", f"memory_s = {memory_s}", 1), encoding="utf-8")
    return file


def test_a_memory_too_short_for_the_predictor_is_a_mistake_in_one_line(tmp_path: Path) -> None:
    result = check(with_memory(tmp_path, 0.2))
    assert (result.exit_code, result.stdout) == (2, "")
    (line,) = result.stderr.splitlines()
    assert line.startswith("axiswatch: demo.axis1: a memory of 0.2 s is less than 0.45 s, too short for")


def test_with_a_short_memory_joint_state_is_the_default(tmp_path: Path) -> None:
    def joint(memory_s: float, line: str = "") -> bool:
        file = with_memory(tmp_path, memory_s)
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace("[robot.axis.estimator]", f"[robot.axis.estimator]\n{line}", 1))
        axis = load(file).axes[0]
        return axis_settings(axis, axis_model(axis.config)).joint_state

    assert (joint(1.0), joint(3.0)) == (True, False)
    assert (joint(1.0, "joint_state = false"), joint(3.0, "joint_state = true")) == (False, True)
    assert joint(0.2, "joint_state = true")  # refused where nothing is said


# --- without a bus: nothing can be watched ------------------------------------------------------------------


DRIVE = {name: value for name, value in EXAMPLE_VALUES["three-mass"].items() if name not in ("kT", "r")}
VALUES = ", ".join(f"{name} = {value}" for name, value in (DRIVE | {"fc": 0.01, "tau0": 0.01}).items())
NOISES = "estimator = { torque_noise = 0.05, output_noise = 1e-4 }\n"


@pytest.fixture
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "axis.toml").write_text(TABLES, encoding="utf-8")
    return tmp_path


def call(command: str) -> Result:
    name, *words = command.split()
    return axiswatch(name, "--config", "axis.toml", *words)


@pytest.mark.usefixtures("directory")
@pytest.mark.parametrize("command", ["run", "listen", "simulate", "play r.csv"])
def test_commands_that_need_a_bus_report_that_there_is_none(command: str) -> None:
    result = call(command)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("axiswatch: axis.toml: no bus: ")
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.usefixtures("directory")
def test_an_axis_that_is_not_identified_yet() -> None:
    result = call("check")
    assert result.exit_code == 0, result.stderr
    assert "column torque" in result.stdout
    assert "cell1.axis1: not identified yet; `axiswatch commission` or `identify` finds its values" in result.stdout


def test_values_to_start_an_identification_from_need_no_noises(directory: Path) -> None:
    """A record whose motion gives no start is refused with the advice to give them."""
    values = "{ J = 0.01, fm = 0.006, fc = 0.7, tau0 = 0, kT = 1 }"
    model = f'model = {{ drive = "one-mass", monitor = ["kT"], nominal = {values} }}\n'
    text = TABLES[: TABLES.index("model = ")] + model
    (directory / "axis.toml").write_text(text, encoding="utf-8")
    result = call("check")
    assert result.exit_code == 0, result.stderr
    assert "cell1.axis1: not identified yet; `axiswatch commission` or `identify` finds its values" in result.stdout


@pytest.mark.parametrize("command", ["replay", "calibrate"])
def test_a_table_is_watched_only_with_nominal_values(command: str, directory: Path) -> None:
    (directory / "r.csv").write_text("t,torque,angle\n0,0,0\n0.005,0.1,0\n", encoding="utf-8")
    result = call(f"{command} r.csv")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("axiswatch: cell1.axis1: Jm, ")
    assert "not known: identify the axis first, and name its nominal_file" in result.stderr


@pytest.mark.usefixtures("directory")
def test_the_model_needs_no_bus() -> None:
    result = call("model")
    assert (result.exit_code, result.stderr) == (0, "")
    assert "Hold kT and r known" in " ".join(result.stdout.split())


def test_a_motion_is_planned_without_a_bus_where_the_drive_is_known(directory: Path) -> None:
    words = "excite --torque-limit 2 -o m.csv --seconds 2"
    result = call(words)
    assert result.exit_code == 2
    assert f"the configuration has no {', '.join(DRIVE)}, torque_noise, output_noise: give" in result.stderr
    known = TABLES.replace("kT = 1,", f"kT = 1, {VALUES},").replace("model =", f"{NOISES}model =")
    (directory / "axis.toml").write_text(known.replace("torque_noise = 0.05, ", ""), encoding="utf-8")
    assert "has no torque_noise: give" in call(words).stderr
    (directory / "axis.toml").write_text(known, encoding="utf-8")
    assert call(words).exit_code == 0
    assert (directory / "m.csv").read_text(encoding="utf-8").startswith("t_s,torque_Nm")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("--free Jm", f"no value of {', '.join(n for n in DRIVE if n != 'Jm')}, to be held: give it in [robot.axis"),
        ("--fix fc", "no value of fc, to be held"),
        ("--start values", "--start values needs a value of Jm, Jg"),
        ("--start search", "--start search needs a value of Jm, Jg"),
        ("", "refused: r.csv: only 2 measured samples"),
    ],
)
def test_an_identification_needs_values_of_what_it_does_not_find(directory: Path, words: str, expected: str) -> None:
    (directory / "r.csv").write_text("torque,angle\n0,0\n1,1\n", encoding="utf-8")
    result = call(f"identify r.csv {words}")
    assert (result.exit_code, expected in result.stderr) == (2, True), result.stderr
    assert len(result.stderr.splitlines()) == (1 if words else 2)  # it is too short in two respects


def test_a_can_log_cannot_be_read_without_a_bus(directory: Path) -> None:
    (directory / "r.log").write_text("(0.0) can0 123#00\n", encoding="utf-8")
    result = call("identify r.log")
    assert result.exit_code == 2
    assert "r.log is a CAN log, and the configuration has no [[bus]]: add it with the file that" in result.stderr
    assert len(result.stderr.splitlines()) == 1
