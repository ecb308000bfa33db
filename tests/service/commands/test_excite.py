"""``axiswatch excite``: file and table; every mistake with what would be right."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from monitor_core.modeling.simulated_axis import SimulatedAxis
from service.commands.command_line.options import configuration
from service.commands.commissioning.axis.planned_motion import torque_columns
from service.config import drive_of, given_values, load
from service.config.drive_sources import shipped
from tests import golden
from tests.service.command_line import session, shown

DEMO = shipped("demo.toml")


def excite(folder: Path, *arguments: str | Path) -> tuple[str | Path, ...]:
    """The command; of an option that is given twice the last counts."""
    start = ("excite", "--config", DEMO, "--axis", "axis1", "-o", folder / "e.csv")
    return (*start, "--seconds", "2", "--seed", "3", "--torque-limit", "2", *arguments)


def columns(file: Path) -> dict[str, np.ndarray]:
    with file.open(encoding="utf-8") as rows:
        read = list(csv.DictReader(rows))
    return {name: np.array([float(row[name]) for row in read]) for name in read[0]}


def test_the_file_is_what_the_drive_does_within_the_limits(tmp_path: Path) -> None:
    shown(*excite(tmp_path, "--speed-limit", "15", "--periods", "3"))
    c = columns(tmp_path / "e.csv")
    assert list(c) == ["t_s", "torque_Nm", "speed_rad_s", "angle_rad"]
    assert c["t_s"] == pytest.approx(np.arange(400 * 4 + 200) * 0.005)
    assert np.abs(c["torque_Nm"]).max() <= 2
    assert np.abs(c["speed_rad_s"]).max() <= 15
    config = configuration(DEMO).axes[0].config
    axis = SimulatedAxis(given_values(config), 1.0, drive=drive_of(config, "angle"))
    motion = [(0.0, 0.0), *(axis.step(u, 0.005) for u in c["torque_Nm"][:-1])]
    assert c["angle_rad"] == pytest.approx(np.array(motion)[:, 0], abs=1e-4)
    assert c["speed_rad_s"] == pytest.approx(np.array(motion)[:, 1], abs=1e-4)


@pytest.mark.parametrize(
    ("torque", "columns_of_it"),
    [
        ('{ column = "A1_Motorstrom" }', {"current_A": 1.0}),
        ('{ column = "A1 Istmoment [%]", factor = -1 }', {"torque_as_recorded": -1.0}),
        ('{ column = "A1 Istmoment [%]", factor = 0.02 }', {"torque_Nm": 1.0}),
        ('{ column = "A1_Motorstrom", kT_Nm_per_A = -0.5 }', {"torque_Nm": 1.0, "current_A": -2.0}),
        ('{ column = "A1_Moment" }', {"torque_Nm": 1.0}),
    ],
)
def test_a_current_is_not_called_a_torque(torque: str, columns_of_it: dict[str, float], tmp_path: Path) -> None:
    path = tmp_path / "axis.toml"
    path.write_text(
        '[[robot]]\nname = "cell"\n[[robot.axis]]\nname = "axis1"\nsample_interval_s = 0.004\n'
        f'torque = {torque}\nangle = {{ column = "A1_Istwinkel" }}\n'
        'model = { drive = "one-mass", monitor = ["kT"], nominal = { kT = 1 } }\n',
        encoding="utf-8",
    )
    assert torque_columns(load(path).axes[0]) == columns_of_it


def test_an_angle_is_also_in_the_unit_of_the_records(tmp_path: Path) -> None:
    """A controller of a linear axis takes mm."""
    path = tmp_path / "demo.toml"
    text = DEMO.read_text(encoding="utf-8").replace('messages = "', f'messages = "{DEMO.parent}/')
    angle = 'angle = { message = "Axis1State"'
    assert angle in text
    path.write_text(text.replace(angle, f"{angle}, factor = 0.25"), encoding="utf-8")
    shown(*excite(tmp_path, "--as", "angle", "--config", path))
    c = columns(tmp_path / "e.csv")
    assert c["angle_as_recorded"] == pytest.approx(c["angle_rad"] / 0.25)
    assert c["angle_reference_as_recorded"] == pytest.approx(c["angle_reference_rad"] / 0.25)
    assert np.ptp(c["angle_reference_rad"]) > 0.1


def test_the_table(tmp_path: Path) -> None:
    text = shown(*excite(tmp_path))
    assert re.search(r"demo\.axis1: 1400 samples, 7 s: 2 s to warm up, 2 periods of 2 s", text)
    assert re.search(r"torque +[\d.]+ N m +2 N m +99\.\d % +binds", text)
    assert re.search(r"speed +[\d.]+ rad/s +none", text)
    (crest,) = re.findall(r"crest factor ([\d.]+)", text)
    assert float(crest) < 1.55
    assert all(re.search(rf"^{name} +[\d.]+ %", text, re.M) for name in ("Jm", "ka", "fm", "fc"))
    assert "held at their nominal values: kT, r" in text
    assert "flat" not in text


def test_a_spectrum_for_what_is_to_be_found(tmp_path: Path) -> None:
    text = " ".join(shown(*excite(tmp_path, "--find", "1/Ja, fm")).split())
    assert "with a flat spectrum" in text
    gains = re.search(r"as with a flat one: 1/Ja (\d+\.?\d*), fm (\d+\.?\d*)", text)
    assert gains is not None
    assert max(map(float, gains.groups())) > 1.1


@pytest.mark.parametrize("quantity", ["speed", "angle"])
def test_a_reference_is_a_column_more(tmp_path: Path, quantity: str) -> None:
    shown(*excite(tmp_path, "--as", quantity))
    c = columns(tmp_path / "e.csv")
    name = {"speed": "speed_reference_rad_s", "angle": "angle_reference_rad"}[quantity]
    predicted = c[{"speed": "speed_rad_s", "angle": "angle_rad"}[quantity]]
    assert list(c)[-1] == name
    assert c[name] == pytest.approx(predicted, abs=0.2 * np.abs(predicted).max())


def test_a_seed_repeats_the_phases(tmp_path: Path) -> None:
    files = []
    for seed in ("1", "1", "2"):
        shown(*excite(tmp_path, "--seed", seed))
        files.append((tmp_path / "e.csv").read_bytes())
    assert files[0] == files[1] != files[2]


@pytest.mark.usefixtures("folder")
def test_mistakes() -> None:
    Path("demo.dbc").symlink_to(DEMO.with_name("demo.dbc"))
    Path("demo.toml").write_bytes(DEMO.read_bytes())
    start = "--config demo.toml --axis axis1 -o e.csv"
    limited = f"{start} --seconds 2 --seed 3 --torque-limit 2"
    wrong = (
        "--torque-limit -1",
        "--band 30 1",
        "--band 0 100",
        "--band 0.01 0.02",
        "--seconds 0.01",
        "--seconds nan",
        "--seconds 1e9",
        "--find jm",
        "--find Ja,1/Ja",
        "--free Ja --find fm",
        "--torque-limit 0.005",
        "-o no/such/folder.csv",
        "--axis axis9",
    )
    text = session("excite", start, *(f"{limited} {words}" for words in wrong))
    golden.check(text, Path(__file__).parent / "golden" / "excite_mistakes.txt")
